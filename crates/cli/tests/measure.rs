//! `measure`: two photographs of the scene of an accident, control points with known distances, and a table of lengths that holds the truth.

use crate::support::{Run, folder, json_lines, resight};
use resight::core::camera::{ImageSize, Pinhole};
use resight::core::target::{Chessboard, NamedPoint};
use resight::core::{Camera, CameraMatrix, Pixel, Point, Pose, Target, Vector6};
use resight::render::{Finish, Placed, Scene, Style, render};
use serde_json::Value;
use std::fmt::Write;
use std::path::{Path, PathBuf};

const CAMERA: &str = "model = \"pinhole\"\nwidth_px = 1600\nheight_px = 1066\nfx_px = 1300.0\nfy_px = 1300.0\ncx_px = 799.5\ncy_px = 532.5\n";
/// Known distances between the control points, metres' worth of tape.
const TAPES: [(&str, &str); 5] = [("A", "B"), ("B", "C"), ("C", "D"), ("D", "A"), ("A", "C")];
const TAPE_SIGMA_M: f64 = 0.01;

/// Control points A–D and skid marks P, Q, S on the road, corners V, W of a vehicle, a post from F to T.
const POINTS: [(&str, [f64; 3]); 11] = [
    ("A", [0.0, 0.0, 0.0]),
    ("B", [7.0, 0.0, 0.0]),
    ("C", [7.5, 6.0, 0.0]),
    ("D", [-0.5, 5.5, 0.0]),
    ("P", [1.0, 1.2, 0.0]),
    ("Q", [4.6, 3.4, 0.0]),
    ("S", [5.8, 5.4, 0.0]),
    ("V", [5.4, 7.2, 0.6]),
    ("W", [7.0, 7.8, 1.1]),
    ("F", [-1.2, 7.0, 0.0]),
    ("T", [-1.2, 7.0, 1.3]),
];
const ON_ROAD: [&str; 8] = ["A", "B", "C", "D", "P", "Q", "S", "F"];

fn place(name: &str) -> Point {
    Point::from(POINTS.iter().find(|p| p.0 == name).expect("a point").1)
}

fn camera(change: [f64; 4]) -> Camera {
    let [f, g, c, d] = change;
    let matrix = CameraMatrix { fx_px: 1300.0 + f, fy_px: 1300.0 + g, cx_px: 799.5 + c, cy_px: 532.5 + d };
    Camera::new(Pinhole { matrix }, Some(ImageSize { width_px: 1600, height_px: 1066 })).expect("a camera")
}

/// Upright, at eye height.
fn eye(centre: [f64; 3], at: [f64; 3]) -> Pose {
    let (centre, at) = (Point::from(centre), Point::from(at));
    let z = (at - centre).normalize();
    let x = z.cross(&Point::new(0.0, 0.0, 1.0)).normalize();
    let y = z.cross(&x);
    let mut pose = Pose::identity();
    for (row, axis) in [x, y, z].iter().enumerate() {
        pose.rotation.set_row(row, &axis.transpose());
    }
    pose.translation = -(pose.rotation * centre);
    pose
}

fn photos() -> [(&'static str, Pose); 2] {
    [("south", eye([-1.5, -6.5, 2.6], [3.4, 3.6, 0.2])), ("east", eye([10.5, -4.0, 2.4], [3.0, 4.2, 0.2]))]
}

/// A linear congruential generator and Box and Muller: a person's hand.
struct Hand(u64);

impl Hand {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64 + 0.5) * 0.5f64.powi(53)
    }

    fn normal(&mut self) -> f64 {
        (-2.0 * self.unit().ln()).sqrt() * (std::f64::consts::TAU * self.unit()).cos()
    }
}

/// What a test changes of the scene.
#[derive(Default)]
struct Change {
    /// Added to u of this point in this photograph.
    slip: Option<(&'static str, &'static str, f64)>,
    /// Added to this tape.
    tape: Option<(usize, f64)>,
    /// This tape was read so many times as long.
    slipped: Option<(usize, f64)>,
    with_files: bool,
}

/// Writes scene, camera and image points into a folder; all that is stated is drawn from its sigma.
fn write_scene(folder: &Path, seed: u64, change: &Change) -> PathBuf {
    let mut hand = Hand(seed);
    let lens = camera([4.0, 4.0, 3.0, 3.0].map(|sigma| sigma * hand.normal()));
    let mut image_points = String::from("photo,point,u_px,v_px,sigma_px\n");
    for (photo, cam_from_world) in photos() {
        for (name, x) in POINTS {
            let seen = lens.project(&(cam_from_world * Point::from(x))).expect("in front");
            let slip = change.slip.filter(|s| s.0 == photo && s.1 == name).map_or(0.0, |s| s.2);
            let pixel = seen + Pixel::new(hand.normal() + slip, hand.normal());
            writeln!(image_points, "{photo},{name},{:.3},{:.3},1.0", pixel.x, pixel.y).expect("a string");
        }
    }
    let mut scene = String::from("image_points = \"clicks.csv\"\n");
    for (photo, _) in photos() {
        let file = if change.with_files { format!("file = \"{photo}.png\"\n") } else { String::new() };
        write!(
            scene,
            "\n[[photo]]\nname = \"{photo}\"\n{file}camera = \"camera.toml\"\n\
             intrinsics_sigma = {{ fx_px = 4.0, fy_px = 4.0, cx_px = 3.0, cy_px = 3.0 }}\n"
        )
        .expect("a string");
    }
    for (i, (a, b)) in TAPES.iter().enumerate() {
        let wrong = change.tape.filter(|t| t.0 == i).map_or(0.0, |t| t.1);
        let read_m = (place(a) - place(b)).norm() + TAPE_SIGMA_M * hand.normal() + wrong;
        let distance_m = change.slipped.filter(|t| t.0 == i).map_or(1.0, |t| t.1) * read_m;
        let entry =
            format!("a = \"{a}\"\nb = \"{b}\"\ndistance_m = {distance_m:.4}\nsigma_m = {TAPE_SIGMA_M}\n");
        write!(scene, "\n[[known_distance]]\n{entry}").expect("a string");
    }
    let road = ON_ROAD.map(|p| format!("\"{p}\"")).join(", ");
    write!(scene, "\n[plane]\npoints = [{road}]\nsigma_m = 0.005\n").expect("a string");
    scene += "\n[[upright]]\nfoot = \"F\"\ntop = \"T\"\nsigma_rad = 0.02\n";
    for (kind, points, _) in queries() {
        let points = points.iter().map(|p| format!("\"{p}\"")).collect::<Vec<_>>().join(", ");
        write!(scene, "\n[[query]]\nkind = \"{kind}\"\npoints = [{points}]\n").expect("a string");
    }
    scene += "\n[birdseye]\npixel_limit_m = 0.03\nerror_limit_m = 0.1\n";
    for (name, text) in
        [("scene.toml", &scene), ("clicks.csv", &image_points), ("camera.toml", &CAMERA.to_string())]
    {
        std::fs::write(folder.join(name), text).expect("written");
    }
    folder.join("scene.toml")
}

/// Kind, points, truth by plain formulas.
fn queries() -> Vec<(&'static str, Vec<&'static str>, f64)> {
    let d = |a: &str, b: &str| (place(a) - place(b)).norm();
    vec![
        ("distance", vec!["P", "Q"], d("P", "Q")),
        ("distance", vec!["V", "W"], d("V", "W")),
        ("distance", vec!["S", "A"], d("S", "A")),
        ("polyline", vec!["P", "Q", "S"], d("P", "Q") + d("Q", "S")),
        ("angle", vec!["P", "Q", "S"], (place("P") - place("Q")).angle(&(place("S") - place("Q")))),
        (
            "area",
            vec!["P", "Q", "S"],
            (place("Q") - place("P")).cross(&(place("S") - place("P"))).norm() / 2.0,
        ),
        ("height", vec!["W"], 1.1),
        ("height", vec!["T"], 1.3),
    ]
}

fn run(scene: &Path, extra: &[&str]) -> Run {
    resight(&[&["measure", scene.to_str().expect("a path")], extra].concat())
}

/// The key of a kind's numbers.
fn suffix(kind: &str) -> &'static str {
    match kind {
        "angle" => "rad",
        "area" => "m2",
        _ => "m",
    }
}

/// Thirty scenes, eight questions each: 228 of 240 intervals are expected to hold the truth. Answers of one scene go together; at the
/// worst as if there were only thirty of them per question: 0.95 ± 5 √(0.05·0.95/30)/√8.
#[test]
fn intervals_hold_the_truth() {
    let folder = folder("measure_truth");
    let (mut held, mut all) = (0, 0);
    for seed in 0..30 {
        let said = run(&write_scene(&folder, 1000 + 77 * seed, &Change::default()), &["--json"]);
        assert_eq!(said.code, 0, "{}{}", said.stdout, said.stderr);
        let lines = json_lines(&said);
        assert_eq!(lines.len(), queries().len() + 1);
        for (line, (kind, _, truth)) in lines.iter().zip(queries()) {
            let number = |key: &str| line[format!("{key}_{}", suffix(kind))].as_f64().expect("a number");
            let (low, high, value) = (number("low_95"), number("high_95"), number("value"));
            assert!(low < value && value < high && (value - truth).abs() < 6.0 * number("sigma"), "{line}");
            held += usize::from((low..=high).contains(&truth));
            all += 1;
        }
        let network = &lines[queries().len()];
        assert_eq!(
            (network["kind"].as_str(), network["status"].as_str()),
            (Some("network"), Some("ok")),
            "{network}"
        );
    }
    println!("{held} of {all} intervals hold the truth");
    let part = held as f64 / all as f64;
    assert!((part - 0.95).abs() < 5.0 * (0.05f64 * 0.95 / 30.0).sqrt() / 8f64.sqrt(), "{part}");
}

/// The road is paved with squares of 0.5 m; posts and corners are balls.
fn photograph(cam_from_world: &Pose) -> Vec<u8> {
    // The pavement's y runs the other way, its z into the ground.
    let half_rotation = Pose::exp(&Vector6::new(std::f64::consts::PI, 0.0, 0.0, 0.0, 0.0, 0.0));
    let world_from_pavement = Pose::new(half_rotation.rotation, Point::new(-3.0, 11.0, -0.001));
    let pavement = Placed {
        target: Target::Chessboard(Chessboard { rows: 31, columns: 31, square_m: 0.5 }),
        cam_from_target: *cam_from_world * world_from_pavement,
        style: Style { ink: 92.0, paper: Some(118.0), margin_m: Some(0.0), ..Style::default() },
    };
    let named = |(name, x): &(&str, [f64; 3])| NamedPoint {
        name: name.to_string(),
        position: Point::from(*x),
        sigma_m: 0.0,
    };
    let points = Placed {
        target: Target::Points(POINTS.iter().map(named).collect()),
        cam_from_target: *cam_from_world,
        style: Style::lamps(0.10),
    };
    let scene = Scene { placed: vec![pavement, points], background: 170.0, clutter: Vec::new() };
    let image = render(&scene, &camera([0.0; 4]), &Finish::default()).expect("an image");
    resight::overlay::canvas::Canvas::from_photograph(&image, 1, 0, [0; 3]).png().expect("a PNG")
}

/// The acceptance of a surveyor: a table, a plan and both grounds from above, all readable, and the plan names everything.
#[test]
fn table_and_drawings_are_written() {
    let folder = folder("measure_files");
    for (photo, cam_from_world) in photos() {
        std::fs::write(folder.join(format!("{photo}.png")), photograph(&cam_from_world)).expect("written");
    }
    let scene = write_scene(&folder, 4242, &Change { with_files: true, ..Change::default() });
    let out = folder.join("out");
    let said = run(&scene, &["-o", out.to_str().expect("a path")]);
    assert_eq!(said.code, 0, "{}{}", said.stdout, said.stderr);
    assert!(said.stdout.contains("P–Q") && said.stdout.contains("±"), "{}", said.stdout);
    println!("{}", said.stdout);

    let table = std::fs::read_to_string(out.join("table.csv")).expect("a table");
    assert_eq!(table.lines().count(), queries().len() + 1, "{table}");
    let number = |line: &str, column: usize| line.split(',').nth(column).and_then(|x| x.parse::<f64>().ok());
    for (line, (_, _, truth)) in table.lines().skip(1).zip(queries()) {
        let truth = if line.contains(",angle,") { truth.to_degrees() } else { truth };
        let (low, high) = (number(line, 6).expect("low_95"), number(line, 7).expect("high_95"));
        assert!(low < high && (low - (high - low)..high + (high - low)).contains(&truth), "{line}: {truth}");
    }

    let svg = std::fs::read_to_string(out.join("plan.svg")).expect("a drawing");
    let document = closed_xml(&svg);
    for (name, _) in POINTS.iter().filter(|p| p.0 != "F" && p.0 != "T") {
        assert!(document.contains(&format!(">{name}</text>")), "{name}");
    }
    assert!(document.contains(">F, T</text>"), "the post's foot and top share a name tag");
    assert!(svg.contains("±") && svg.contains("photo south") && svg.contains("95 % ellipses"), "captions");
    for name in ["plan.png", "birdseye-south.png", "birdseye-east.png"] {
        let image = resight::GrayImage::read(out.join(name)).expect(name);
        assert!(500 < image.width_px && 300 < image.height_px, "{name}");
    }
}

/// Every tag closed: the drawing is well-formed as far as its own few tags go.
fn closed_xml(svg: &str) -> String {
    assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"));
    assert_eq!(svg.matches("<text ").count(), svg.matches("</text>").count());
    assert_eq!(svg.matches('<').count(), svg.matches('>').count());
    assert!(!svg.contains("NaN") && !svg.contains("inf"));
    svg.to_string()
}

/// A slip of the hand and a misread tape are named, with about their size.
#[test]
fn wrong_constraints_are_named() {
    let folder = folder("measure_wrong");
    let slip = Change { slip: Some(("south", "B", 40.0)), ..Change::default() };
    let said = run(&write_scene(&folder, 5, &slip), &[]);
    assert!(
        said.stdout.contains("inconsistent: the image point of B in south is off by about"),
        "{}",
        said.stdout
    );
    let tape = Change { tape: Some((4, 0.4)), ..Change::default() };
    let said = run(&write_scene(&folder, 6, &tape), &["--json"]);
    let lines = json_lines(&said);
    let network = lines.last().expect("a network");
    assert_eq!(network["status"].as_str(), Some("inconsistent"));
    let suspects: Vec<String> =
        network["suspects"].as_array().expect("suspects").iter().map(|s: &Value| s.to_string()).collect();
    assert!(suspects.iter().take(2).any(|s| s.contains("the distance A–C")), "{suspects:?}");
    assert_eq!(said.code, 1);
    assert!(lines.iter().all(|line| line["status"].as_str() == Some("inconsistent")), "{}", said.stdout);
}

/// Each tape ten times too long or too short: named first, before any number; no answer is `ok`, and the table says why.
#[test]
fn a_slipped_decimal_is_named_before_the_numbers() {
    let folder = folder("measure_slipped");
    for (i, (a, b)) in TAPES.iter().enumerate() {
        let times = if i % 2 == 0 { 10.0 } else { 0.1 };
        let change = Change { slipped: Some((i, times)), ..Change::default() };
        let scene = write_scene(&folder, 60 + i as u64, &change);
        let out = folder.join("out");
        let said = run(&scene, &["-o", out.to_str().expect("a path")]);
        assert_eq!(said.code, 1, "{}{}", said.stdout, said.stderr);
        let first = said.stdout.lines().next().expect("a verdict");
        assert!(first.starts_with(&format!("inconsistent: the distance {a}–{b} of ")), "{first}");
        assert!(first.contains("has a slipped decimal point: the others say"), "{first}");
        assert_eq!(said.stdout.matches("INCONSISTENT").count(), queries().len(), "{}", said.stdout);
        let table = std::fs::read_to_string(out.join("table.csv")).expect("a table");
        assert!(table.lines().skip(1).all(|line| line.ends_with(",inconsistent")), "{table}");
        let plan = std::fs::read_to_string(out.join("plan.svg")).expect("a plan");
        assert!(plan.contains("slipped decimal point"), "the plan warns");
        let lines = json_lines(&run(&scene, &["--json"]));
        assert!(lines.iter().all(|line| line["status"].as_str() == Some("inconsistent")), "{lines:?}");
    }
}

/// Control points by coordinates on one line: no number at all, exit status 1, and the control points are named.
#[test]
fn control_points_on_one_line_are_named() {
    let folder = folder("measure_line");
    let scene = write_scene(&folder, 9, &Change::default());
    let good = std::fs::read_to_string(&scene).expect("a scene");
    let (start, end) =
        (good.find("[[known_distance]]").expect("distances"), good.find("[plane]").expect("a plane"));
    let control_point = |name: &str, x: f64, y: f64| {
        format!("[[control_point]]\nname = \"{name}\"\nx_m = {x}\ny_m = {y}\nz_m = 0.0\nsigma_m = 0.01\n")
    };
    let control_points = [
        control_point("A", 0.0, 0.0),
        control_point("P", 1.0, 0.01),
        control_point("Q", 4.6, -0.01),
        control_point("B", 7.0, 0.0),
    ]
    .concat();
    std::fs::write(&scene, format!("{}{control_points}{}", &good[..start], &good[end..])).expect("written");
    let said = run(&scene, &[]);
    assert_eq!(said.code, 1, "{}{}", said.stdout, said.stderr);
    let wanted = "degenerate: the control points stand nearly on one line, from A to B (7.00 m)";
    assert!(said.stdout.starts_with(wanted), "{}", said.stdout);
    assert_eq!(said.stdout.matches("no value").count(), queries().len(), "{}", said.stdout);
    let lines = json_lines(&run(&scene, &["--json"]));
    assert!(lines.iter().all(|line| line["status"].as_str() == Some("degenerate")), "{lines:?}");
}

fn refused(scene: &Path, wanted: &str) {
    let said = run(scene, &[]);
    assert_eq!((said.code, said.stdout.as_str()), (2, ""), "{wanted}: {}", said.stderr);
    assert!(said.stderr.contains(wanted), "{wanted}: {}", said.stderr);
}

/// What people get wrong first.
#[test]
fn mistakes_in_the_scene_are_named() {
    let folder = folder("measure_mistakes");
    let scene = write_scene(&folder, 7, &Change::default());
    let good = std::fs::read_to_string(&scene).expect("a scene");
    let with = |from: &str, to: &str| {
        assert!(good.contains(from), "{from}");
        std::fs::write(&scene, good.replacen(from, to, 1)).expect("written");
    };
    with("\"P\", \"Q\"]", "\"P\", \"Z\"]");
    refused(&scene, "no point `Z`");
    with("kind = \"distance\"", "kind = \"length\"");
    refused(&scene, "unknown variant `length`");
    with("distance_m = 7", "distanz_m = 7");
    refused(&scene, "unknown field `distanz_m`");
    with("camera.toml", "camera.tml");
    refused(&scene, "camera.tml");
    with("sigma_m = 0.005", "sigma_m = -1.0");
    refused(&scene, "sigma_m of the plane is -1");
    with("fx_px = 4.0", "fy = 4.0");
    refused(&scene, "has no `fy`");
    with("clicks.csv", "camera.toml");
    refused(&scene, "no column `photo`");
    let start = good.find("[[known_distance]]").expect("distances");
    let end = good.find("[plane]").expect("a plane");
    std::fs::write(&scene, format!("{}{}", &good[..start], &good[end..])).expect("written");
    refused(&scene, "no length is known");
}

/// A point clicked once and on no plane gets no value but a reason; the rest is answered, and the exit status says so.
#[test]
fn an_undetermined_point_is_named() {
    let folder = folder("measure_undetermined");
    let scene = write_scene(&folder, 8, &Change::default());
    let image_points = std::fs::read_to_string(folder.join("clicks.csv")).expect("image_points");
    let fewer: Vec<&str> = image_points.lines().filter(|line| !line.starts_with("east,V,")).collect();
    std::fs::write(folder.join("clicks.csv"), fewer.join("\n")).expect("written");
    let said = run(&scene, &[]);
    assert_eq!(said.code, 1);
    assert!(said.stdout.contains("no value: point V is undetermined: it was seen once"), "{}", said.stdout);
    assert!(said.stdout.contains("P–Q"), "{}", said.stdout);
}

/// The page for surveyors shows the shipped scene and what the program says of it.
#[test]
fn the_page_shows_what_is_said() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let page = std::fs::read_to_string(root.join("docs/measuring.md")).expect("a page");
    let block = |language: &str| {
        let after = page.split(&format!("```{language}\n")).nth(1).expect("a block");
        after.split("```").next().expect("its end").to_string()
    };
    let scene = root.join("testdata/measure/accident.toml");
    let shipped = std::fs::read_to_string(&scene).expect("a scene");
    assert_eq!(block("toml").trim(), shipped.trim());
    let said = run(&scene, &[]);
    assert!(crate::support::same(&said.stdout, &block("text")), "said\n{}", said.stdout);
}

/// A stereo pair from a rig file: positions in the rig's frame, the pair's own uncertainty counted.
#[test]
fn views_of_a_rig_are_triangulated() {
    let folder = folder("measure_rig");
    let one = |name: &str, covariance: &str, x: f64| {
        format!(
            "[[camera]]\nname = \"{name}\"\n{CAMERA}[camera.placement]\nb = \"{name}\"\na = \"left\"\n\
             rotation_wxyz = [1.0, 0.0, 0.0, 0.0]\ntranslation_m = [{x}, 0.0, 0.0]\n{covariance}\n"
        )
    };
    let rows: Vec<String> = (0..6)
        .map(|i| {
            let row: Vec<String> =
                (0..6).map(|j| if i == j { "1e-8".into() } else { "0.0".to_string() }).collect();
            format!("[{}]", row.join(", "))
        })
        .collect();
    let left = format!("[[camera]]\nname = \"left\"\n{CAMERA}\n");
    let right = one("right", &format!("covariance = [{}]", rows.join(", ")), -0.5);
    std::fs::write(folder.join("rig.toml"), format!("{left}{right}")).expect("written");
    let mut image_points = String::from("photo,point,u_px,v_px\n");
    let points = [("near", Point::new(0.3, -0.1, 4.0)), ("far", Point::new(-1.0, 0.4, 9.0))];
    for (name, x) in points {
        for (photo, shift) in [("left", 0.0), ("right", -0.5)] {
            let p = camera([0.0; 4]).project(&(x + Point::new(shift, 0.0, 0.0))).expect("in front");
            writeln!(image_points, "{photo},{name},{},{}", p.x, p.y).expect("a string");
        }
    }
    std::fs::write(folder.join("clicks.csv"), image_points).expect("written");
    let path = |name: &str| folder.join(name).display().to_string();
    let said = resight(&[
        "measure",
        "--views",
        &path("rig.toml"),
        "--clicks",
        &path("clicks.csv"),
        "--sigma-px",
        "0.5",
        "--json",
    ]);
    assert_eq!(said.code, 0, "{}{}", said.stdout, said.stderr);
    let lines = json_lines(&said);
    for (line, (name, x)) in lines.iter().zip(points) {
        assert_eq!(line["query"].as_str(), Some(name));
        for axis in 0..3 {
            let value = line["value_m"][axis].as_f64().expect("a number");
            assert!((value - x[axis]).abs() < 1e-4, "{line}");
        }
    }
    // Depth by 0.5 m of baseline: σ_z = z²/(f b) · √2 · 0.5 px, and the pair's own 0.1 mrad on top.
    let sigma_z = lines[1]["sigma_m"][2].as_f64().expect("a number");
    let by_pixels = 81.0 / (1300.0 * 0.5) * 2f64.sqrt() * 0.5;
    let by_turn = 81.0 / 0.5 * 1e-4;
    let expected = by_pixels.hypot(by_turn);
    assert!((sigma_z / expected - 1.0).abs() < 0.1, "{sigma_z} {expected}");
}

/// A file of image points that is joined with itself, and tapes that are listed twice, change no number.
#[test]
fn equal_image_points_and_distances_count_once() {
    let folder = folder("measure_repeated");
    let scene = write_scene(&folder, 4, &Change::default());
    let once = json_lines(&run(&scene, &["--json"]));
    let clicks = std::fs::read_to_string(folder.join("clicks.csv")).expect("read");
    let (header, rows) = clicks.split_once('\n').expect("a header");
    std::fs::write(folder.join("clicks.csv"), format!("{header}\n{rows}{rows}{rows}")).expect("written");
    let text = std::fs::read_to_string(&scene).expect("read");
    let first = text.find("[[known_distance]]").expect("a tape");
    let second = first + 1 + text[first + 1..].find("[[known_distance]]").expect("another");
    std::fs::write(&scene, format!("{}{}{}", &text[..first], &text[first..second], &text[first..]))
        .expect("written");
    let copied = json_lines(&run(&scene, &["--json"]));
    let (network, others) = copied.split_last().expect("a network");
    assert_eq!(once[..queries().len()], *others);
    let remarks = network["remarks"].to_string();
    assert!(remarks.contains("45 of 72 rows repeat another"), "{remarks}");
}

/// Tapes in centimetres: everything agrees, but is a hundred times too large, and no tape is that long. The file can declare such lengths.
#[test]
fn tapes_in_centimetres_are_implausible() {
    let folder = folder("measure_units");
    let scene = write_scene(&folder, 4, &Change::default());
    let metres = std::fs::read_to_string(&scene).expect("read");
    let hundredfold = |line: &str| match line.split_once(" = ") {
        Some((key @ ("distance_m" | "sigma_m"), number)) => {
            format!("{key} = {}", 100.0 * number.parse::<f64>().expect("a number"))
        }
        _ => line.to_string(),
    };
    let centimetres: Vec<String> = metres.lines().map(hundredfold).collect();
    let centimetres = centimetres.join("\n");
    std::fs::write(&scene, &centimetres).expect("written");
    let said = run(&scene, &["-q"]);
    assert!(
        said.code == 1 && said.stdout.starts_with("implausible: the shortest distance"),
        "{}",
        said.stdout
    );
    assert!(said.stdout.contains("centimetres (") && said.stdout.contains("IMPLAUSIBLE"), "{}", said.stdout);
    let lines = json_lines(&run(&scene, &["--json"]));
    assert!(lines.iter().all(|line| line["status"] == "implausible"), "{lines:?}");
    let meant = format!("lengths_are_metres = true\n{centimetres}");
    for (text, code) in [(&meant, 0), (&metres, 0)] {
        std::fs::write(&scene, text).expect("written");
        let said = run(&scene, &[]);
        assert!(said.code == code && !said.stdout.contains("mplausible"), "{}", said.stdout);
    }
}

/// One of two photographs upside down: nothing tells which, both are named, and the numbers are those of the right rows.
#[test]
fn a_photograph_whose_rows_are_counted_upwards_is_named() {
    let folder = folder("measure_upwards");
    let scene = write_scene(&folder, 4, &Change::default());
    let clicks = std::fs::read_to_string(folder.join("clicks.csv")).expect("read");
    let upwards = |line: &str| match line.strip_prefix("east,") {
        Some(_) => {
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            cells[3] = (1065.0 - cells[3].parse::<f64>().expect("v_px")).to_string();
            cells.join(",")
        }
        None => line.to_owned(),
    };
    let upwards: Vec<String> = clicks.lines().map(upwards).collect();
    std::fs::write(folder.join("clicks.csv"), upwards.join("\n")).expect("written");
    let said = run(&scene, &[]);
    assert_eq!(said.code, 1);
    for photo in ["east", "south"] {
        let wanted = format!("v of all points in {photo} looks counted from the bottom");
        assert!(said.stdout.contains(&wanted), "{}", said.stdout);
    }
    assert!(said.stdout.contains("the numbers below are with the first corrected"), "{}", said.stdout);
}

/// The labels B and C of one photograph exchanged: they are named, the numbers are those of the right labels, and the answer is not `ok`.
#[test]
fn exchanged_labels_are_named() {
    let folder = folder("measure_exchanged");
    let scene = write_scene(&folder, 4, &Change::default());
    let right = json_lines(&run(&scene, &["--json"]));
    let clicks = std::fs::read_to_string(folder.join("clicks.csv")).expect("read");
    let exchanged =
        clicks.replace("east,B,", "east,x,").replace("east,C,", "east,B,").replace("east,x,", "east,C,");
    std::fs::write(folder.join("clicks.csv"), exchanged).expect("written");
    let said = run(&scene, &[]);
    assert_eq!(said.code, 1);
    assert!(said.stdout.starts_with("inconsistent: B and C in east look exchanged"), "{}", said.stdout);
    let found = json_lines(&run(&scene, &["--json"]));
    for (right, found) in right.iter().zip(&found).take(queries().len()) {
        assert_eq!((right["status"].as_str(), found["status"].as_str()), (Some("ok"), Some("inconsistent")));
        for key in ["value_m", "value_m2", "value_rad"] {
            if let (Some(a), Some(b)) = (right[key].as_f64(), found[key].as_f64()) {
                assert!((a - b).abs() < 1e-4 * a.abs(), "{key}: {a} {b}");
            }
        }
    }
}
