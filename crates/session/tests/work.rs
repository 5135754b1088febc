//! Sessions with real work: many measurements, many steps, large photographs, files written by hand.

use resight::GrayImage;
use resight_session::{
    Command, FILES_BYTES, GivenLens, GivenLine, LineDirection, MOST_PHOTOS, MeasuredKind, Photograph,
    Session, Template, View,
};
use std::time::Instant;

/// A photograph of noise, which packs badly.
fn noise(width_px: u32, height_px: u32, seed: u32) -> GrayImage {
    let mut image = GrayImage::filled(width_px, height_px, 0);
    let mut draw = seed;
    for value in &mut image.data {
        draw = draw.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        *value = (draw >> 24) as u8;
    }
    image
}

fn photograph(name: &str, width_px: u32, height_px: u32) -> Photograph {
    let jpeg = noise(width_px, height_px, width_px).jpeg(90).expect("a JPEG");
    Photograph::decode(name, jpeg).expect("a photograph")
}

/// Where a place of the ground is seen: a camera 5 m up that looks down 35°, 60° across.
fn seen(width_px: f64, height_px: f64, x: f64, y: f64) -> [f64; 2] {
    let (sin, cos) = 35f64.to_radians().sin_cos();
    let (f, z) = (width_px / 2.0 / 30f64.to_radians().tan(), y * cos + 5.0 * sin);
    [f * x / z + width_px / 2.0 - 0.5, f * (5.0 * cos - y * sin) / z + height_px / 2.0 - 0.5]
}

const SIZE: (f64, f64) = (4000.0, 3000.0);

/// Four marks with their distances on a photograph of 12 megapixels.
fn posed(photograph: Photograph) -> Session {
    let size = photograph.size();
    let size = (f64::from(size.width_px), f64::from(size.height_px));
    let mut session = Session::new();
    session.add_photograph(photograph).expect("room");
    session.apply(0, Command::SetLens { lens: GivenLens::FieldOfView { hfov_deg: 60.0 } });
    session.apply(0, Command::SetTemplate { template: Template::FourPoints });
    let marks = [("A", -2.0, 5.0), ("B", 2.0, 5.0), ("C", 2.0, 9.0), ("D", -2.0, 9.0)];
    for (name, x, y) in marks {
        put(&mut session, name, seen(size.0, size.1, x, y), false);
    }
    for (i, j) in [(0, 1), (2, 0), (2, 1), (3, 0), (3, 1)] {
        let (a, b): ((&str, f64, f64), (&str, f64, f64)) = (marks[i], marks[j]);
        let distance_m = (a.1 - b.1).hypot(a.2 - b.2);
        session.apply(
            0,
            Command::SetDistance { a: a.0.into(), b: b.0.into(), distance_m, sigma_m: Some(0.005) },
        );
    }
    session
}

fn put(session: &mut Session, name: &str, [u_px, v_px]: [f64; 2], drag: bool) -> View {
    session.change(0, Command::PutPoint { name: name.into(), u_px, v_px, drag, sigma_px: None })
}

fn add(session: &mut Session, name: &str, what: MeasuredKind, points: Vec<[f64; 2]>) -> View {
    session.change(0, Command::AddMeasurement { name: name.into(), what, points })
}

fn at(x: f64, y: f64) -> [f64; 2] {
    seen(SIZE.0, SIZE.1, x, y)
}

fn lengths(session: &mut Session, n: usize) {
    for i in 0..n {
        let (x, y) = (-2.0 + 0.4 * (i % 10) as f64, 5.2 + 0.7 * (i / 10) as f64);
        add(session, &format!("length {i}"), MeasuredKind::Length, vec![at(x, y), at(x + 0.3, y + 0.2)]);
    }
}

/// What a dragged mark shows at once is the pose; measurements are of before until they are taken, and then those of the whole.
#[test]
fn the_pose_comes_first_and_measurements_follow() {
    let mut session = posed(photograph("a.jpg", 4000, 3000));
    lengths(&mut session, 50);
    let task = session.measuring().expect("something to measure");
    session.take(task.run());
    let before = session.view(0);
    assert!(!before.is_measuring && before.measurements.iter().all(|m| m.value.is_some()));
    let mut slowest_ms: f64 = 0.0;
    for i in 1..=40 {
        let began = Instant::now();
        let [u, v] = at(-2.0, 9.0);
        let view = put(&mut session, "D", [u + 0.5 * f64::from(i), v], true);
        slowest_ms = slowest_ms.max(1e3 * began.elapsed().as_secs_f64());
        assert!(view.is_measuring && view.measurements[0].value == before.measurements[0].value);
    }
    let began = Instant::now();
    let task = session.measuring().expect("something to measure");
    session.take(task.run());
    println!(
        "50 lengths: pose within {slowest_ms:.1} ms, all measured within {:.1} ms",
        1e3 * began.elapsed().as_secs_f64()
    );
    let after = session.view(0);
    assert!(!after.is_measuring && after.measurements[0].value != before.measurements[0].value);
}

/// While a mark is dragged lengths follow to first order; with the whole answer they hardly change. A mark that contradicts the distances leaves the values
/// as they were until it is let go.
#[test]
fn lengths_follow_a_dragged_mark() {
    let mut session = posed(photograph("a.jpg", 4000, 3000));
    lengths(&mut session, 50);
    let [u, v] = at(-2.0, 9.0);
    put(&mut session, "D", [u + 0.5, v], true);
    session.take(session.measuring_provisionally().expect("something to measure").run());
    let provisional = session.view(0);
    assert!(provisional.is_measuring && session.measuring_provisionally().is_none());
    session.take(session.measuring().expect("the whole answer").run());
    let whole = session.view(0);
    assert!(!whole.is_measuring && session.measuring_provisionally().is_none());
    for (first, then) in provisional.measurements.iter().zip(&whole.measurements) {
        assert_eq!((first.status, then.status), (Some("ok"), Some("ok")));
        let off = (first.value.expect("a value") - then.value.expect("a value")).abs();
        let [to_first_order, half] = [first, then].map(|m| m.half_width_95.expect("an interval"));
        assert!(off < 1e-3 * half, "{}: {off}", then.name);
        assert!((to_first_order / half - 1.0).abs() < 0.1, "{}: {to_first_order} {half}", then.name);
    }
    put(&mut session, "D", [u + 200.0, v], true);
    let contradicts = session.view(0);
    assert!(contradicts.is_measuring && session.measuring_provisionally().is_none());
    for (now, before) in contradicts.measurements.iter().zip(&whole.measurements) {
        assert_eq!(now.value, before.value, "{}", now.name);
    }
    session.take(session.measuring().expect("the whole answer").run());
    let contradicts = session.view(0);
    assert!(!contradicts.is_measuring);
    assert!(contradicts.measurements.iter().all(|m| m.status != Some("ok")), "a contradiction is no answer");
}

/// A wavy line along the ground.
fn kerb(session: &mut Session, name: &str, n: usize) {
    let along = |i: usize| at(-1.9 + 3.8 * i as f64 / n as f64, 7.0 + (0.2 * i as f64).sin());
    add(session, name, MeasuredKind::Polyline, (0..n).map(along).collect());
}

/// Measures, and returns for how long, ms: the shortest of three times.
fn measured_ms(session: &mut Session) -> f64 {
    let task = session.measuring().expect("something to measure");
    let timed = |_| {
        let (began, task) = (Instant::now(), task.clone());
        let measured = task.run();
        (1e3 * began.elapsed().as_secs_f64(), measured)
    };
    let mut all: Vec<_> = (0..3).map(timed).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (took_ms, measured) = all.swap_remove(0);
    session.take(measured);
    took_ms
}

/// Two hundred points have one length with its interval; `--nocapture` prints how long that takes.
#[test]
fn a_long_polyline_has_a_length() {
    let mut session = posed(photograph("a.jpg", 4000, 3000));
    kerb(&mut session, "kerb", 200);
    let took_ms = measured_ms(&mut session);
    println!("200 points: {took_ms:.1} ms");
    let view = session.view(0);
    let m = &view.measurements[0];
    let (low, high) = (m.low.expect("a length"), m.high.expect("a length"));
    assert!(low < m.value.expect("a length") && m.value.expect("a length") < high, "{}", m.words);
}

/// Thousands of points have values, and `--nocapture` prints how long they take. That numbers are kept in proportion to the points is asserted
/// where they are kept (`least_squares::arrow` of the core).
#[test]
fn thousands_of_points_are_measured() {
    for n in [4, 16] {
        let mut session = posed(photograph("a.jpg", 4000, 3000));
        (0..n).for_each(|i| kerb(&mut session, &format!("kerb {i}"), 200));
        let took_ms = measured_ms(&mut session);
        println!("{} points: {took_ms:.1} ms", 200 * n);
        let view = session.view(0);
        assert_eq!(view.measurements.len(), n);
        assert!(view.measurements.iter().all(|m| m.value.is_some()));
    }
}

/// A measurement that is moved is measured again; whatever it does not touch is taken over, and comes out as if all had been measured.
#[test]
fn what_nothing_touched_is_taken_over_and_is_right() {
    let mut session = posed(photograph("a.jpg", 4000, 3000));
    lengths(&mut session, 12);
    add(
        &mut session,
        "post",
        MeasuredKind::Height,
        vec![at(0.0, 7.0), [at(0.0, 7.0)[0], at(0.0, 7.0)[1] - 300.0]],
    );
    add(&mut session, "tile", MeasuredKind::Area, vec![at(0.0, 6.0), at(1.0, 6.0), at(1.0, 7.0)]);
    session.take(session.measuring().expect("something").run());
    let [u_px, v_px] = at(1.5, 8.8);
    let commands = [
        Command::MoveMeasurement { name: "length 3".into(), index: 1, u_px, v_px, drag: false },
        Command::RemoveMeasurement { name: "length 5".into() },
        Command::AddMeasurement {
            name: "new".into(),
            what: MeasuredKind::Length,
            points: vec![at(-1.0, 6.0), at(1.0, 8.0)],
        },
        Command::SetSigma { sigma_px: 2.0 },
        Command::Undo,
        Command::MoveMeasurement {
            name: "post".into(),
            index: 1,
            u_px: at(0.0, 7.0)[0] + 40.0,
            v_px: at(0.0, 7.0)[1] - 250.0,
            drag: false,
        },
    ];
    for command in commands {
        let words = format!("{command:?}");
        let view = session.apply(0, command);
        let whole = Session::load(&session.save().expect("a file")).expect("the same").view(0);
        assert_eq!(view.measurements.len(), whole.measurements.len(), "{words}");
        for (m, n) in view.measurements.iter().zip(&whole.measurements) {
            let (a, b) = (m.value.expect("a value"), n.value.expect("a value"));
            // Both are converged to a thousandth of a standard deviation.
            let tolerance = 2e-3 * m.half_width_95.expect("an interval");
            assert!((a - b).abs() < tolerance, "{words}, {}: {a} {b}", m.name);
            let (low, high) = (m.low.zip(n.low).expect("ends"), m.high.zip(n.high).expect("ends"));
            assert!(
                (low.0 - low.1).abs() < 2.0 * tolerance && (high.0 - high.1).abs() < 2.0 * tolerance,
                "{words}, {}",
                m.name
            );
        }
    }
}

/// Whichever is clicked first, the foot is on the ground.
#[test]
fn a_top_before_its_foot_is_understood() {
    let mut session = posed(photograph("a.jpg", 4000, 3000));
    let (foot, top) = (at(0.3, 7.0), [at(0.3, 7.0)[0], at(0.3, 7.0)[1] - 400.0]);
    let value = |view: View| view.measurements.last().and_then(|m| m.value).expect("a height");
    let add = |session: &mut Session, name: &str, points: Vec<[f64; 2]>| {
        session.apply(0, Command::AddMeasurement { name: name.into(), what: MeasuredKind::Height, points })
    };
    let right = value(add(&mut session, "a", vec![foot, top]));
    let turned = value(add(&mut session, "b", vec![top, foot]));
    assert!((right - turned).abs() < 1e-3 && 0.1 < right, "{right} {turned}");
}

/// However often a photograph is replaced and whatever camera files come, the steps that can be undone stay small.
#[test]
fn steps_take_bounded_memory() {
    let mut session = Session::new();
    for seed in 0..40 {
        // 16 megapixels of one grey pack to nothing; the decoded photograph is what weighs.
        let png = GrayImage::filled(4000, 4000, seed).png().expect("a PNG");
        session.add_photograph(Photograph::decode("same.png", png).expect("a photograph")).expect("room");
    }
    assert_eq!(session.n_photographs(), 1);
    assert!(session.weight_bytes() < (16 << 20) + (130 << 20), "{}", session.weight_bytes());
    let text = format!("{}# {}", include_str!("../../../testdata/demo/left.toml"), "x".repeat(900_000));
    let mut session = posed(photograph("a.jpg", 800, 600));
    for i in 0..300 {
        let lens =
            GivenLens::File { name: format!("{i}.toml"), text: text.replace("left", &format!("left{i}")) };
        session.change(0, Command::SetLens { lens });
    }
    assert!(session.weight_bytes() < 135 << 20, "{}", session.weight_bytes());
    session.forget_steps();
    assert!(session.weight_bytes() < 4 << 20 && session.apply(0, Command::Undo).error.is_some());
}

/// What a session holds is bounded through every entrance, and said with the number.
#[test]
fn too_much_is_refused_however_it_comes() {
    let mut session = Session::new();
    for i in 0..MOST_PHOTOS {
        session.add_photograph(photograph(&format!("{i}.jpg"), 64, 48)).expect("room");
    }
    let refused = session.add_photograph(photograph("more.jpg", 64, 48)).expect_err("no room");
    assert!(refused.text.contains('6'), "{}", refused.text);
    let saved = session.save().expect("a file");
    let (begin, end) = (
        saved.find("[[session.photos]]").expect("photographs"),
        saved.find("[session.positions]").unwrap_or(saved.len()),
    );
    let one = &saved[begin..begin + 1 + saved[begin + 1..].find("[[session.photos]]").expect("a second")];
    let many = |n: usize| format!("{}{}{}", &saved[..begin], one.repeat(n), &saved[end..]);
    assert!(Session::load(&many(MOST_PHOTOS)).is_ok());
    let began = Instant::now();
    let refused = Session::load(&many(40)).expect_err("too many");
    assert!(refused.text.contains('6'), "{}", refused.text);
    // By its length alone, before anything is decoded.
    let large = saved.replacen(
        "image_base64 = \"",
        &format!("image_base64 = \"{}", "A".repeat(FILES_BYTES / 3 * 4)),
        1,
    );
    let refused = Session::load(&large).expect_err("too large");
    assert!(refused.text.contains("96 MB"), "{}", refused.text);
    assert!(began.elapsed().as_secs() < 20);
    for (from, to) in [("sigma_px = 1.0", "sigma_px = -1.0"), ("[session]", "[sessions]")] {
        assert!(Session::load(&saved.replacen(from, to, 2)).is_err(), "{to}");
    }
}

/// Thirty lengths close together: labels of the drawing that find no room are left out, and none lies over another.
#[test]
fn labels_of_a_drawing_do_not_lie_over_each_other() {
    let mut session = posed(photograph("a.jpg", 4000, 3000));
    lengths(&mut session, 30);
    let task = session.measuring().expect("something to measure");
    session.take(task.run());
    let svg = session.export(0, "svg", 0.0).expect("a drawing").text;
    let number = |line: &str, key: &str| -> f64 {
        let (_, behind) = line.split_once(&format!(" {key}=\"")).expect(key);
        behind.split('"').next().and_then(|text| text.parse().ok()).expect("a number")
    };
    let mut areas: Vec<[f64; 4]> = Vec::new();
    for line in svg.lines().filter(|line| line.starts_with("<text")) {
        let text = line.split(['<', '>']).nth(2).expect("a text");
        let (x, y, size) = (number(line, "x"), number(line, "y"), number(line, "font-size"));
        areas.push([x, y - 0.8 * size, x + 0.5 * size * text.chars().count() as f64, y + 0.2 * size]);
    }
    assert!(svg.contains(">A</text>") && 5 < areas.len() && areas.len() < 34, "{}", areas.len());
    for (i, a) in areas.iter().enumerate() {
        for b in &areas[i + 1..] {
            assert!(!(a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]), "{a:?} {b:?}");
        }
    }
}

/// A standard deviation beyond what it belongs to is refused, by command and in a saved session, and the session stays measured.
#[test]
fn standard_deviations_are_bounded() {
    let mut session = posed(photograph("a.jpg", 800, 600));
    let length = [-1.0, 1.0].map(|x| seen(800.0, 600.0, x, 6.0)).to_vec();
    add(&mut session, "m", MeasuredKind::Length, length);
    let distance = |sigma_m| Command::SetDistance {
        a: "A".into(),
        b: "B".into(),
        distance_m: 4.0,
        sigma_m: Some(sigma_m),
    };
    let position = |sigma_m| Command::SetPosition { name: "A".into(), x_m: 0.0, y_m: 0.0, z_m: 0.0, sigma_m };
    let point = |sigma_px| Command::PutPoint {
        name: "A".into(),
        u_px: 1.0,
        v_px: 1.0,
        drag: false,
        sigma_px: Some(sigma_px),
    };
    for (command, said) in [
        (distance(1e300), "10 000 km"),
        (position(1e300), "10 000 km"),
        (Command::SetSigma { sigma_px: 1e300 }, "0.000001 to 1000000 px"),
        (Command::SetSigma { sigma_px: 1e-300 }, "0.000001 to 1000000 px"),
        (point(1e300), "0.000001 to 1000000 px"),
        (point(1e-300), "0.000001 to 1000000 px"),
    ] {
        let view = session.apply(0, command.clone());
        let error = view.error.unwrap_or_else(|| panic!("{command:?} was taken"));
        assert!(error.text.contains(said), "{}", error.text);
        assert!(!view.is_measuring && view.measurements[0].value.is_some());
    }
    let saved = session.save().expect("a file");
    assert!(saved.contains("sigma_px = 1.0") && Session::load(&saved).is_ok());
    for large in ["sigma_px = 1e300", "sigma_px = 1e-300"] {
        assert!(Session::load(&saved.replace("sigma_px = 1.0", large)).is_err(), "{large}");
    }
    for command in [distance(1e7), position(1e7), Command::SetSigma { sigma_px: 1e6 }] {
        let view = session.apply(0, command);
        assert!(view.error.is_none() && !view.is_measuring);
    }
}

/// The same file again is no step; another one of its name is shown in its place, under a hash of its own.
#[test]
fn photographs_are_known_by_what_they_hold() {
    let mut session = Session::new();
    let first = session.add_photograph(photograph("image.jpg", 80, 60)).expect("room");
    let again = session.add_photograph(photograph("image.jpg", 80, 60)).expect("room");
    assert!(first.can_undo && again.version == first.version);
    let jpeg = noise(80, 60, 5).jpeg(90).expect("a JPEG");
    let other =
        session.add_photograph(Photograph::decode("image.jpg", jpeg).expect("a photograph")).expect("room");
    let hash = |view: &View| view.photo.as_ref().expect("a photograph").sha256.clone();
    assert!(other.photos.len() == 1 && hash(&other) != hash(&first) && hash(&other).len() == 64);
    assert_eq!(hash(&session.apply(0, Command::Undo)), hash(&first));
}

/// A report says what it rests on; a table has no cell that a spreadsheet would run.
#[test]
fn a_report_names_its_evidence_and_tables_run_nothing() {
    let mut session = posed(photograph("street & <b>.jpg", 800, 600));
    let at = |x, y| seen(800.0, 600.0, x, y);
    for name in ["=HYPERLINK(\"http://x\")", "kerb"] {
        add(&mut session, name, MeasuredKind::Length, vec![at(-1.0, 6.0), at(1.0, 6.0)]);
    }
    let view = session.apply(
        0,
        Command::AddMeasurement {
            name: "drain".into(),
            what: MeasuredKind::Position,
            points: vec![at(0.0, 6.0)],
        },
    );
    let report = session.export(0, "report", 1_773_500_966.0).expect("a report").text;
    let hash = &view.photo.as_ref().expect("a photograph").sha256;
    for part in [
        hash.as_str(),
        "2026-03-14 15:09 UTC",
        "field of view stated: 60°",
        "Distances typed",
        "4 m",
        "residual",
        "Resight ",
        "street &amp; &lt;b&gt;",
    ] {
        assert!(report.contains(part), "{part}");
    }
    // Only what could be wider than the paper is broken within a word, and every page repeats the head of its table.
    assert_eq!(report.matches("class=\"long\"").count(), 1);
    assert!(
        report.contains(&format!("<td class=\"long\">{hash}</td>")) && 4 <= report.matches("<thead>").count()
    );
    assert!(
        !report.contains("<b>.jpg")
            && view.points.iter().all(|p| report.contains(&format!("<td>{}</td>", p.name)))
    );
    let csv = session.export(0, "csv", 0.0).expect("a table").text;
    assert!(csv.contains("\"'=HYPERLINK(\"\"http://x\"\")\",length,"), "{csv}");
    assert_eq!(csv.lines().filter(|line| line.starts_with("drain,position,")).count(), 3, "{csv}");
}

/// A report has every photograph of the session, those without a pose too, and says in which of them something is measured.
#[test]
fn a_report_holds_every_photograph_of_the_session() {
    let mut session = posed(photograph("first.jpg", 800, 600));
    for (name, width_px) in [("second.jpg", 801), ("third.jpg", 802)] {
        session.add_photograph(photograph(name, width_px, 600)).expect("room");
    }
    session.apply(1, Command::SetLens { lens: GivenLens::FieldOfView { hfov_deg: 60.0 } });
    for (name, x, y) in [("A", -2.0, 5.0), ("B", 2.0, 5.0), ("C", 2.0, 9.0), ("D", -2.0, 9.0)] {
        let [u_px, v_px] = seen(801.0, 600.0, x, y);
        session.apply(1, Command::PutPoint { name: name.into(), u_px, v_px, drag: false, sigma_px: None });
    }
    let at = |x, y| seen(801.0, 600.0, x, y);
    let points = vec![at(-1.0, 6.0), at(1.0, 6.0)];
    let add = Command::AddMeasurement { name: "kerb".into(), what: MeasuredKind::Length, points };
    assert!(session.apply(1, add).measurements[0].value.is_some());
    for shown in [0, 1] {
        let report = session.export(shown, "report", 1_773_500_966.0).expect("a report").text;
        let at = |part: &str| report.find(part).unwrap_or_else(|| panic!("{part}"));
        let names = ["first.jpg", "second.jpg", "third.jpg"];
        assert_eq!(report.matches("<h1>").count(), 3);
        assert!(
            names
                .iter()
                .all(|name| at(&format!("<h1>{}</h1>", names[shown])) <= at(&format!("<h1>{name}</h1>")))
        );
        for photo in 0..3 {
            assert!(report.contains(&session.photograph(photo).expect("a photograph").sha256));
        }
        // A picture of each, a pose of two, and once what belongs to all.
        assert_eq!([report.matches("<svg").count(), report.matches("<image").count()], [3, 3]);
        assert_eq!([report.matches("<h2>Pose").count(), report.matches("<h2>Marks").count()], [2, 2]);
        for title in ["Distances typed", "Measurements", "Report"] {
            assert_eq!(report.matches(&format!("<h2>{title}</h2>")).count(), 1, "{title}");
        }
        assert!(report.contains("<td>second.jpg</td></tr>") && report.contains("<strong>no pose</strong>: "));
    }
}

/// What the page saves `resight measure` reads, and the page too: photographs of 0.1, 3, 12 and 48 megapixels.
#[test]
fn saved_sessions_are_read_at_the_sizes_of_real_photographs() {
    let path = std::env::temp_dir().join(format!("resight-saved-{}.toml", std::process::id()));
    for (width_px, height_px) in [(360, 280), (2000, 1500), (4000, 3000), (8000, 6000)] {
        let mut session = posed(photograph("a.jpg", width_px, height_px));
        let at = |x, y| seen(f64::from(width_px), f64::from(height_px), x, y);
        add(&mut session, "kerb", MeasuredKind::Length, vec![at(-1.0, 6.0), at(1.0, 6.0)]);
        add(
            &mut session,
            "post",
            MeasuredKind::Height,
            vec![at(0.0, 7.0), [at(0.0, 7.0)[0], at(0.0, 7.0)[1] * 0.9]],
        );
        let view = session.apply(0, Command::Show { grid: false, axes: false });
        let saved = session.save().expect("a file");
        std::fs::write(&path, &saved).expect("written");
        let began = Instant::now();
        let scene = resight::measure::read_scene(&path);
        println!("{width_px} × {height_px} px: {} MB read in {:?}", saved.len() >> 20, began.elapsed());
        let answer = resight::measure(&scene.expect("a scene")).expect("an answer").solved.expect("solved");
        for (m, answer) in view.measurements.iter().zip(&answer.answers) {
            let value = answer.result.as_ref().expect("a value")[0].value;
            let tolerance = 2e-3 * m.half_width_95.expect("an interval");
            assert!(
                (value - m.value.expect("a value")).abs() < tolerance,
                "{}: {value} {:?}",
                m.name,
                m.value
            );
        }
        assert_eq!(Session::load(&saved).expect("the same").view(0).figures, view.figures);
    }
    std::fs::remove_file(&path).expect("removed");
}

/// Lines that are parallel in the scene say how long the lens is, and marks on one plane then give a pose; a camera of the list does too.
#[test]
fn a_lens_that_nobody_knows_is_found_otherwise() {
    let mut session = posed(photograph("a.jpg", 4000, 3000));
    let true_f = 2000.0 / 30f64.to_radians().tan();
    let up = |x: f64, y: f64| {
        // A point 3 m above the ground, seen by the camera of `seen`.
        let (sin, cos) = 35f64.to_radians().sin_cos();
        let (down, z) = (2.0 * cos - y * sin, y * cos + 2.0 * sin);
        [true_f * x / z + 1999.5, true_f * down / z + 1499.5]
    };
    let line = |direction, a, b| GivenLine { direction, ends: [a, b] };
    let mut lines: Vec<GivenLine> =
        [-2.0, 0.0, 2.0].map(|x| line(LineDirection::Along, at(x, 5.0), at(x, 12.0))).to_vec();
    lines.extend([-2.0, 2.0].map(|x| line(LineDirection::Up, at(x, 9.0), up(x, 9.0))));
    lines.extend([6.0, 9.0].map(|y| line(LineDirection::Across, at(-2.0, y), at(2.0, y))));
    let view = session.apply(0, Command::SetLens { lens: GivenLens::Lines { lines: lines.clone() } });
    assert_eq!(view.status(), Some("ok"), "{:?} {:?}", view.error, view.refusal);
    let hfov_deg = view.lens.as_ref().and_then(|lens| lens.hfov_deg).expect("a field of view");
    assert!((hfov_deg - 60.0).abs() < 2.0, "{hfov_deg}");
    let view = session.apply(0, Command::SetLens { lens: GivenLens::Lines { lines: lines[..2].to_vec() } });
    assert!(view.error.is_some_and(|error| error.step == "lens" && error.text.contains("lines")));
    // The horizon is above the photograph here; it and two upright lines are enough, and alone it says what to add.
    let level = 1499.5 - true_f * 35f64.to_radians().tan();
    let horizon = line(LineDirection::Horizon, [0.0, level], [3999.0, level]);
    let three = vec![horizon, lines[3], lines[4]];
    let view = session.apply(0, Command::SetLens { lens: GivenLens::Lines { lines: three } });
    let hfov_deg = view.lens.as_ref().and_then(|lens| lens.hfov_deg).expect("a field of view");
    assert!(view.status() == Some("ok") && (hfov_deg - 60.0).abs() < 2.0, "{hfov_deg} {:?}", view.error);
    let view = session.apply(0, Command::SetLens { lens: GivenLens::Lines { lines: vec![horizon] } });
    assert!(view.error.is_some_and(|error| error.text.contains("mark two upright lines")));
    for camera in resight_session::COMMON_CAMERAS {
        let lens = GivenLens::Common { name: camera.name.to_owned() };
        assert!(session.apply(0, Command::SetLens { lens }).error.is_none(), "{}", camera.name);
    }
    let view = session.apply(0, Command::SetLens { lens: GivenLens::Common { name: "a shoe box".into() } });
    assert!(view.error.is_some_and(|error| error.text.contains("list")));
}

/// Where a camera at (0, 7, 6) m that looks straight down sees a place of the ground, 60° across.
fn seen_from_above(width_px: f64, height_px: f64, x: f64, y: f64) -> [f64; 2] {
    let f = width_px / 2.0 / 30f64.to_radians().tan();
    [f * x / 6.0 + width_px / 2.0 - 0.5, f * (7.0 - y) / 6.0 + height_px / 2.0 - 0.5]
}

/// A photograph straight from above leaves the focal length open; a second one by the same camera, at a slant, gives it, and only one of its size.
#[test]
fn a_second_photograph_gives_the_lens() {
    let mut session = Session::new();
    for (name, width_px) in [("above.jpg", 800), ("slant.jpg", 800), ("other.jpg", 640)] {
        session.add_photograph(photograph(name, width_px, 600)).expect("room");
    }
    session.apply(0, Command::SetTemplate { template: Template::Own });
    let places = [(-2.0, 5.0), (2.0, 5.0), (2.0, 9.0), (-2.0, 9.0), (0.0, 6.0), (1.0, 8.0)];
    for (i, (x_m, y_m)) in places.into_iter().enumerate() {
        let name = format!("P{i}");
        session.apply(0, Command::SetPosition { name: name.clone(), x_m, y_m, z_m: 0.0, sigma_m: 0.0 });
        for (photo, [u_px, v_px]) in
            [(0, seen_from_above(800.0, 600.0, x_m, y_m)), (1, seen(800.0, 600.0, x_m, y_m))]
        {
            let (name, sigma_px) = (name.clone(), Some(0.3));
            session.apply(photo, Command::PutPoint { name, u_px, v_px, drag: false, sigma_px });
        }
    }
    let of = |name: &str| Command::SetLens { lens: GivenLens::Photograph { name: name.to_owned() } };
    let open = session.apply(0, Command::SetLens { lens: GivenLens::Unknown });
    assert_eq!(open.lens.as_ref().map(|lens| lens.state), Some("open"));
    let refusal = open.refusal.expect("a sentence");
    assert!(refusal.step == "lens" && refusal.text.contains("second photograph"), "{}", refusal.text);
    // Nothing to take yet.
    let early = session.apply(0, of("slant.jpg"));
    let lens = early.lens.expect("a lens");
    assert!(lens.state == "refused" && lens.error.is_some_and(|error| error.contains("no lens yet")));
    assert!(early.photos.iter().all(|photo| !photo.lends_lens));
    session.apply(1, Command::SetLens { lens: GivenLens::Unknown });
    let view = session.view(0);
    assert_eq!(view.status(), Some("ok"), "{:?} {:?}", view.lens, view.refusal);
    assert_eq!(view.photos.iter().map(|photo| photo.lends_lens).collect::<Vec<_>>(), [false, true, false]);
    let height = view.figures.iter().find(|f| f.name == "height").expect("a height");
    assert!(
        (height.value - 6.0).abs() < height.half_width_95 && height.half_width_95 < 1.0,
        "{}",
        height.words
    );
    // It follows the other photograph, and is saved.
    assert_eq!(
        Session::load(&session.save().expect("a file")).expect("the same").view(0).figures,
        view.figures
    );
    for (photo, name, said) in [
        (1, "above.jpg", "takes its lens"),
        (0, "none.jpg", "No photograph"),
        (1, "slant.jpg", "takes its lens"),
    ] {
        let error = session.apply(photo, of(name)).error.expect("a sentence");
        assert!(error.step == "lens" && error.text.contains(said), "{}", error.text);
    }
    let lens = session.apply(2, of("slant.jpg")).lens.expect("a lens");
    assert!(lens.error.is_some_and(|error| error.contains("800 × 600 px")));
}

/// A point is not suspected for being the last in a row.
#[test]
fn rank_is_no_fault() {
    let session = posed(photograph("a.jpg", 4000, 3000));
    let view = session.view(0);
    assert!(view.points.iter().all(|p| !p.is_suspect), "{:?}", view.points);
}
