//! The session on images with known truth: photograph, lens and points in, pose and measurements out.

use resight::core::{Camera, Pixel, Point, Pose};
use resight_session::{
    Command, GivenLens, GivenTarget, MeasuredKind, Photograph, Session, SnapTo, Template, View,
};
use std::path::Path;

fn file(name: &str) -> Vec<u8> {
    std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(name)).expect(name)
}

fn text(name: &str) -> String {
    String::from_utf8(file(name)).expect("text")
}

fn demo() -> Session {
    let mut session = Session::new();
    let photograph = Photograph::decode("left.png", file("testdata/demo/left.png")).expect("a photograph");
    session.add_photograph(photograph).expect("room");
    session
}

fn lens() -> Command {
    Command::SetLens {
        lens: GivenLens::File { name: "left.toml".into(), text: text("testdata/demo/left.toml") },
    }
}

fn camera() -> Camera {
    let read = resight::formats::read_cameras_from_bytes("left.toml", file("testdata/demo/left.toml"));
    read.expect("a camera").cameras.remove(0).camera
}

/// A camera 5 m up that looks down 40°.
fn truth() -> Pose {
    let down = Pose::exp(&resight::core::Vector6::new(130f64.to_radians(), 0.0, 0.0, 0.0, 0.0, 0.0));
    let centre = Point::new(1.5, -5.0, 5.0);
    Pose::new(down.rotation, -(down.rotation * centre))
}

fn pixel(x: f64, y: f64, z: f64) -> Pixel {
    camera().project(&(truth() * Point::new(x, y, z))).expect("in front")
}

fn put(session: &mut Session, name: &str, at: Pixel, drag: bool) -> View {
    session.apply(0, Command::PutPoint { name: name.into(), u_px: at.x, v_px: at.y, drag, sigma_px: None })
}

fn distance(session: &mut Session, a: &str, b: &str, distance_m: f64) -> View {
    session.apply(0, Command::SetDistance { a: a.into(), b: b.into(), distance_m, sigma_m: Some(0.001) })
}

/// Six points at known places that are not in one plane.
fn spread_points(session: &mut Session) {
    let places = [
        (0.0, 0.0, 0.0),
        (3.0, 0.0, 0.0),
        (3.0, 2.0, 0.0),
        (0.0, 2.0, 0.0),
        (1.0, 1.0, 1.2),
        (2.2, 0.4, 1.5),
    ];
    for (i, (x_m, y_m, z_m)) in places.into_iter().enumerate() {
        let name = format!("P{i}");
        session.apply(0, Command::SetPosition { name: name.clone(), x_m, y_m, z_m, sigma_m: 0.0 });
        put(session, &name, pixel(x_m, y_m, z_m), false);
    }
}

/// Four clicks: three on a line and one off it.
fn four_clicks() -> (Session, View) {
    four_clicks_on(demo())
}

fn four_clicks_on(mut session: Session) -> (Session, View) {
    session.apply(0, lens());
    session.apply(0, Command::SetSigma { sigma_px: 0.2 });
    let places = [("A", 0.0, 0.0), ("B", 1.5, 0.0), ("C", 3.0, 0.0), ("D", 0.8, 1.6)];
    for (name, x, y) in places {
        // B is off by a fifth of a pixel, as a hand would be.
        let slip = if name == "B" { 0.2 } else { 0.0 };
        put(&mut session, name, pixel(x, y, 0.0) + Pixel::new(0.0, slip), false);
    }
    distance(&mut session, "A", "B", 1.5);
    distance(&mut session, "B", "C", 1.5);
    distance(&mut session, "D", "A", 0.8f64.hypot(1.6));
    let view = distance(&mut session, "D", "C", 2.2f64.hypot(1.6));
    (session, view)
}

#[test]
fn four_clicks_give_the_pose() {
    let (_, view) = four_clicks();
    assert!(matches!(view.status(), Some("ok" | "ambiguous")), "{:?} {:?}", view.refusal, view.missing);
    let figure = |name: &str| view.figures.iter().find(|f| f.name == name).expect(name);
    for (name, value) in
        [("height", 5.0), ("tilt", 40.0), ("roll", 0.0), ("x", 1.5), ("y", -5.0), ("heading", 90.0)]
    {
        let f = figure(name);
        assert!((f.value - value).abs() < f.half_width_95, "{name}: {}", f.words);
        assert!(0.0 < f.half_width_95 && f.words.contains(" ± "), "{name}: {}", f.words);
    }
    assert!(figure("height").half_width_95 < 0.5, "{}", figure("height").words);
    let overlay = view.overlay.expect("an overlay");
    assert!(4 < overlay.grid.len() && overlay.axes.len() == 3 && overlay.ellipses.len() == 4);
    assert_eq!(view.points.iter().filter(|p| p.is_worst).count(), 1);
}

/// A length, an area and a height on the photograph are those of the scene, within their intervals.
#[test]
fn what_is_measured_is_true() {
    let (mut session, _) = four_clicks();
    let at = |x, y, z| {
        let p = pixel(x, y, z);
        [p.x, p.y]
    };
    let mut add = |name: &str, what, points: Vec<[f64; 2]>| {
        session.apply(0, Command::AddMeasurement { name: name.into(), what, points })
    };
    add("kerb", MeasuredKind::Length, vec![at(0.5, 0.5, 0.0), at(2.5, 0.5, 0.0)]);
    add(
        "tile",
        MeasuredKind::Area,
        vec![at(0.5, 0.0, 0.0), at(2.0, 0.0, 0.0), at(2.0, 1.0, 0.0), at(0.5, 1.0, 0.0)],
    );
    let view = add("post", MeasuredKind::Height, vec![at(1.0, 1.0, 0.0), at(1.0, 1.0, 0.9)]);
    for (m, truth) in view.measurements.iter().zip([2.0, 1.5, 0.9]) {
        let (low, high) = (m.low.unwrap_or(f64::NAN), m.high.unwrap_or(f64::NAN));
        assert!(
            low < truth && truth < high && high - low < 0.3 * truth,
            "{}: {} {:?} {low}..{high}",
            m.name,
            m.words,
            m.error
        );
    }
    let png = session.birdseye_png(0).expect("a bird's-eye view");
    assert!(png.starts_with(b"\x89PNG"));
}

/// A JPEG whose EXIF says how many degrees from magnetic north the camera looked.
fn looking(jpeg: &[u8], deg: u8) -> Vec<u8> {
    let list = |entries: &[[u8; 12]]| [&[0, entries.len() as u8][..], &entries.concat(), &[0; 4]].concat();
    // The header ends at 8, the first list at 26, the second at 56.
    let first = list(&[[0x88, 0x25, 0, 4, 0, 0, 0, 1, 0, 0, 0, 26]]);
    let second =
        list(&[[0, 0x10, 0, 2, 0, 0, 0, 2, b'M', 0, 0, 0], [0, 0x11, 0, 5, 0, 0, 0, 1, 0, 0, 0, 56]]);
    let tiff = [b"MM\0*\0\0\0\x08", &first[..], &second, &[0, 0, 0, deg, 0, 0, 0, 1]].concat();
    let exif = [b"Exif\0\0", &tiff[..]].concat();
    [&jpeg[..2], &[0xff, 0xe1, 0, exif.len() as u8 + 2], &exif, &jpeg[2..]].concat()
}

/// A JPEG whose EXIF names a model and its focal length in millimetres, and no more of its lens.
fn by_model(jpeg: &[u8], model: &str, focal_mm: u8) -> Vec<u8> {
    let list = |entries: &[[u8; 12]]| [&[0, entries.len() as u8][..], &entries.concat(), &[0; 4]].concat();
    // The header ends at 8, the first list at 38, the second at 56; the fraction and the model follow.
    let length = model.len() as u8 + 1;
    let first = list(&[
        [0x01, 0x10, 0, 2, 0, 0, 0, length, 0, 0, 0, 64],
        [0x87, 0x69, 0, 4, 0, 0, 0, 1, 0, 0, 0, 38],
    ]);
    let second = list(&[[0x92, 0x0a, 0, 5, 0, 0, 0, 1, 0, 0, 0, 56]]);
    let fraction = [0, 0, 0, focal_mm, 0, 0, 0, 1];
    let tiff = [b"MM\0*\0\0\0\x08", &first[..], &second, &fraction, model.as_bytes(), b"\0"].concat();
    let exif = [b"Exif\0\0", &tiff[..]].concat();
    [&jpeg[..2], &[0xff, 0xe1, 0, exif.len() as u8 + 2], &exif, &jpeg[2..]].concat()
}

/// A photograph whose EXIF does not say how long its lens is as of film is offered the camera of the list that it names, and says what to do else.
#[test]
fn a_photograph_without_a_stated_lens_says_what_to_do_next() {
    let jpeg = file("examples/photo/left03.jpg");
    for (bytes, offered, said) in [
        (by_model(&jpeg, "RP_imx219", 3), Some("Raspberry Pi Camera Module 2"), "The list has it"),
        (by_model(&jpeg, "EOS 5D", 50), None, "names EOS 5D and 50 mm, but not the size of its sensor"),
        (jpeg.clone(), None, "Drop the original file"),
    ] {
        let mut session = Session::new();
        let photograph = Photograph::decode("left03.jpg", bytes).expect("a photograph");
        let view = session.add_photograph(photograph).expect("room");
        let photo = view.photo.expect("a photograph");
        assert!(!photo.has_exif_lens && photo.common_camera == offered, "{:?}", photo.common_camera);
        let advice = photo.exif_advice.expect("advice");
        assert!(advice.contains(said) && advice.contains("mark lines"), "{advice}");
        let refused = session.apply(0, Command::SetLens { lens: GivenLens::Exif }).error.expect("an error");
        assert_eq!(refused.text, advice);
        if let Some(name) = offered {
            let lens = GivenLens::Common { name: name.to_owned() };
            let view = session.apply(0, Command::SetLens { lens });
            assert!(view.error.is_none() && view.lens.expect("a lens").hfov_deg.is_some());
        }
    }
}

/// Where a photograph says which way it looks, its bird's-eye view shows north.
#[test]
fn north_is_drawn_where_it_is_known() {
    let jpeg = file("examples/photo/left03.jpg");
    let from_above = |bytes: Vec<u8>| {
        let mut session = Session::new();
        let photograph = Photograph::decode("left03.jpg", bytes).expect("a photograph");
        let heading = photograph.heading;
        session.add_photograph(photograph).expect("room");
        let (mut session, _) = four_clicks_on(session);
        let at = |x, y| [pixel(x, y, 0.0).x, pixel(x, y, 0.0).y];
        let points = vec![at(0.5, 0.5), at(2.5, 0.5)];
        session.apply(0, Command::AddMeasurement { name: "kerb".into(), what: MeasuredKind::Length, points });
        (heading.map(|h| (h.deg, h.is_magnetic)), session.birdseye_png(0).expect("a bird's-eye view"))
    };
    let (none, plain) = from_above(jpeg.clone());
    let (east, with_east) = from_above(looking(&jpeg, 90));
    let (north, with_north) = from_above(looking(&jpeg, 0));
    assert_eq!((none, east, north), (None, Some((90.0, true)), Some((0.0, true))));
    assert!(plain != with_east && plain != with_north && with_east != with_north);
    if let Some(folder) = std::env::var_os("SCREENSHOTS") {
        std::fs::write(Path::new(&folder).join("north.png"), with_east).expect("a folder");
    }
}

#[test]
fn a_drag_is_one_step_back() {
    let (mut session, _) = four_clicks();
    let steps = |session: &mut Session| {
        let mut n = 0;
        while session.apply(0, Command::Undo).error.is_none() {
            n += 1;
        }
        while session.apply(0, Command::Redo).error.is_none() {}
        n
    };
    let before = steps(&mut session);
    for i in 0..5 {
        let view = put(&mut session, "D", pixel(0.8, 1.6, 0.0) + Pixel::new(f64::from(i), 0.0), true);
        assert!(view.advice.is_none());
    }
    put(&mut session, "D", pixel(0.8, 1.6, 0.0) + Pixel::new(9.0, 0.0), false);
    assert_eq!(steps(&mut session), before + 1);
    let view = session.apply(0, Command::Undo);
    let d = view.points.iter().find(|p| p.name == "D").expect("D");
    assert!((d.u_px - pixel(0.8, 1.6, 0.0).x).abs() < 1e-9);
}

/// Two marks that are exchanged contradict each other while the second is still dragged; that they are exchanged is said when it is let go.
#[test]
fn the_cause_of_a_contradiction_is_named_when_the_mark_is_let_go() {
    let mut session = demo();
    session.apply(0, lens());
    session.apply(0, Command::SetTemplate { template: Template::Own });
    session.apply(0, Command::SetSigma { sigma_px: 0.2 });
    spread_points(&mut session);
    put(&mut session, "P1", pixel(3.0, 2.0, 0.0), false);
    let onto = pixel(3.0, 0.0, 0.0);
    let message = |view: &View| match &view.refusal {
        Some(refusal) => refusal.text.clone(),
        None => serde_json::to_value(&view.answer).expect("an answer")["message"].to_string(),
    };
    let dragged = message(&put(&mut session, "P2", onto, true));
    let let_go = message(&put(&mut session, "P2", onto, false));
    assert!(let_go.contains("the points agree with"), "{let_go}");
    assert!(!dragged.contains("the points agree with") && dragged.len() < let_go.len(), "{dragged}");
}

/// A refused command changes nothing; the last good answer stays, marked old.
#[test]
fn what_is_wrong_is_said_and_nothing_is_lost() {
    let (mut session, good) = four_clicks();
    let bad: Vec<Command> = vec![
        Command::PutPoint { name: "A".into(), u_px: f64::NAN, v_px: 3.0, drag: false, sigma_px: None },
        Command::PutPoint { name: "A".into(), u_px: 1e9, v_px: 3.0, drag: false, sigma_px: None },
        Command::PutPoint { name: String::new(), u_px: 3.0, v_px: 3.0, drag: false, sigma_px: None },
        Command::SetDistance { a: "A".into(), b: "B".into(), distance_m: -1.0, sigma_m: None },
        Command::SetDistance { a: "A".into(), b: "A".into(), distance_m: 1.0, sigma_m: None },
        Command::SetLens { lens: GivenLens::File { name: "x.toml".into(), text: "no camera".into() } },
        Command::SetLens { lens: GivenLens::Exif },
        Command::SetLens { lens: GivenLens::FieldOfView { hfov_deg: 400.0 } },
        Command::SetSigma { sigma_px: 0.0 },
        Command::RemovePoint { name: "nobody".into() },
        Command::FindTarget { target: GivenTarget::Family { family: "tag36h11".into(), size_m: f64::NAN } },
        Command::AddMeasurement { name: "m".into(), what: MeasuredKind::Area, points: vec![[1.0, 1.0]] },
    ];
    for command in bad {
        let words = format!("{command:?}");
        let view = session.apply(0, command);
        let error = view.error.unwrap_or_else(|| panic!("{words}"));
        assert!(10 < error.text.len(), "{}", error.text);
        assert_eq!(view.figures, good.figures, "{words}");
    }
    // All points on one line: no pose, the old one is still there.
    for (i, name) in ["A", "B", "C", "D"].iter().enumerate() {
        session.apply(0, Command::SetTemplate { template: Template::Own });
        let x_m = i as f64;
        session
            .apply(0, Command::SetPosition { name: (*name).into(), x_m, y_m: 0.0, z_m: 0.0, sigma_m: 0.0 });
    }
    let mut view = session.view(0);
    for (i, name) in ["A", "B", "C", "D"].iter().enumerate() {
        view = put(&mut session, name, pixel(i as f64, 0.0, 0.0), false);
    }
    let refusal = view.refusal.expect("a sentence");
    assert!(view.is_old && refusal.text.contains("line"), "{}", refusal.text);
    assert!(view.overlay.is_some());
    // A camera file for another size.
    let other = text("testdata/demo/left.toml").replace("= 800", "= 1000");
    let view = session
        .apply(0, Command::SetLens { lens: GivenLens::File { name: "other.toml".into(), text: other } });
    assert!(view.error.is_some_and(|e| e.step == "lens"));
}

#[test]
fn a_target_is_found() {
    let mut session = demo();
    session.apply(0, lens());
    let target = GivenTarget::File { name: "grid.toml".into(), text: text("testdata/demo/grid.toml") };
    let view = session.apply(0, Command::FindTarget { target });
    assert_eq!(view.status(), Some("ok"), "{:?}", view.error);
    assert!(20 < view.points.len());
    let tag = GivenTarget::Family { family: "any".into(), size_m: 0.1 };
    let view = session.apply(0, Command::FindTarget { target: tag });
    assert_eq!(view.points.len(), 4, "{:?}", view.error);
}

/// Without a lens its focal length is estimated from points that are not in one plane.
#[test]
fn the_lens_is_estimated() {
    let mut session = demo();
    session.apply(0, Command::SetLens { lens: GivenLens::Unknown });
    session.apply(0, Command::SetTemplate { template: Template::Own });
    session.apply(0, Command::SetSigma { sigma_px: 0.2 });
    spread_points(&mut session);
    let view = session.view(0);
    let lens = view.lens.as_ref().expect("a lens");
    assert_eq!(lens.state, "estimated");
    let height =
        view.figures.iter().find(|f| f.name == "height").unwrap_or_else(|| panic!("{:?}", view.refusal));
    assert!((height.value - 5.0).abs() < height.half_width_95, "{}", height.words);
}

#[test]
fn a_saved_session_is_the_same_one_and_measure_reads_it() {
    let (mut session, _) = four_clicks();
    let (a, b) = (pixel(0.5, 0.5, 0.0), pixel(2.5, 0.5, 0.0));
    let points = vec![[a.x, a.y], [b.x, b.y]];
    let view =
        session.apply(0, Command::AddMeasurement { name: "kerb".into(), what: MeasuredKind::Length, points });
    let saved = session.save().expect("a file");
    let loaded = Session::load(&saved).expect("the same");
    let again = loaded.view(0);
    assert_eq!(again.figures, view.figures);
    assert_eq!(again.measurements[0].value, view.measurements[0].value);
    let path = std::env::temp_dir().join(format!("resight-session-{}.toml", std::process::id()));
    std::fs::write(&path, &saved).expect("written");
    let scene = resight::measure::read_scene(&path).expect("a scene");
    let answer = resight::measure(&scene).expect("an answer").solved.expect("solved");
    std::fs::remove_file(&path).expect("removed");
    let value = answer.answers[0].result.as_ref().expect("a length")[0].value;
    assert!((value - view.measurements[0].value.expect("a length")).abs() < 1e-6, "{value}");
    for broken in ["", "x = 1", "[session]\nsigma_px = 1.0", &saved[..saved.len() / 2]] {
        assert!(Session::load(broken).is_err());
    }
    for format in ["json", "svg", "report", "csv", "opencv", "colmap", "ros"] {
        let export = session.export(0, format, 0.0).unwrap_or_else(|e| panic!("{format}: {e}"));
        assert!(export.text.len() > 20, "{format}");
    }
    // Formats that cannot hold this lens, which is bent, say so.
    for format in resight_session::exports() {
        let refused = session.export(0, format, 0.0).err();
        assert!(refused.is_none_or(|e| !e.text.contains("no export")), "{format}");
    }
    assert!(session.export(0, "homography", 0.0).is_err_and(|e| e.text.contains("bent")));
    assert!(session.export(0, "nonsense", 0.0).is_err_and(|e| e.text.contains("opencv")));
}

/// Dots and corners are found where they are.
#[test]
fn points_snap() {
    let mut session = demo();
    session.apply(0, lens());
    let target = GivenTarget::File { name: "grid.toml".into(), text: text("testdata/demo/grid.toml") };
    let found = session.apply(0, Command::FindTarget { target });
    let corner = found.points[0].clone();
    let view = session
        .apply(0, Command::Snap { u_px: corner.u_px + 2.0, v_px: corner.v_px - 1.0, to: SnapTo::Corner });
    let snap = view.snap.expect("a corner");
    assert!((snap.u_px - corner.u_px).hypot(snap.v_px - corner.v_px) < 1.0, "{snap:?} {corner:?}");
    assert_eq!(view.points.len(), found.points.len());
    // What snapped is as sure as the detector says; what is moved by hand afterwards is not.
    let snapped = |sigma_px| Command::PutPoint {
        name: corner.name.clone(),
        u_px: snap.u_px,
        v_px: snap.v_px,
        drag: false,
        sigma_px,
    };
    let sigma =
        |view: &View| view.points.iter().find(|p| p.name == corner.name).expect("the corner").sigma_px;
    assert_eq!(sigma(&session.apply(0, snapped(Some(snap.sigma_px)))), snap.sigma_px);
    assert_eq!(sigma(&session.apply(0, snapped(None))), 1.0);
    let refused = session.apply(0, snapped(Some(0.0)));
    assert!(refused.error.is_some_and(|e| e.text.contains("positive")));
}

/// A second photograph of the scene: a point without a place, clicked in both, gets one.
#[test]
fn two_photographs_give_a_place() {
    let (mut session, _) = four_clicks();
    let second = Photograph::decode("second.png", file("testdata/demo/left.png")).expect("a photograph");
    let view = session.add_photograph(second).expect("room");
    assert_eq!(view.names_elsewhere, ["A", "B", "C", "D"]);
    session.apply(1, lens());
    let camera = camera();
    let turned = Pose::exp(&resight::core::Vector6::new(125f64.to_radians(), 0.0, 0.0, 0.0, 0.0, 0.0));
    let cam_from_world = Pose::new(turned.rotation, -(turned.rotation * Point::new(3.2, -5.5, 5.5)));
    let seen = |x, y, z| camera.project(&(cam_from_world * Point::new(x, y, z))).expect("in front");
    for (name, x, y) in [("A", 0.0, 0.0), ("B", 1.5, 0.0), ("C", 3.0, 0.0), ("D", 0.8, 1.6)] {
        let at = seen(x, y, 0.0);
        session.apply(
            1,
            Command::PutPoint { name: name.into(), u_px: at.x, v_px: at.y, drag: false, sigma_px: None },
        );
    }
    put(&mut session, "lamp", pixel(1.2, 1.0, 0.7), false);
    let at = seen(1.2, 1.0, 0.7);
    let view = session.apply(
        1,
        Command::PutPoint { name: "lamp".into(), u_px: at.x, v_px: at.y, drag: false, sigma_px: None },
    );
    assert!(view.names_elsewhere.is_empty(), "{:?}", view.names_elsewhere);
    let lamp = view.points.iter().find(|p| p.name == "lamp").expect("lamp");
    let place = lamp.position_m.expect("a place");
    let off = (Point::from(place) - Point::new(1.2, 1.0, 0.7)).norm();
    assert!(off < 0.05, "{place:?}");
}
