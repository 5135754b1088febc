//! Results dropped in: rigs and whiskers from files.

use crate::client::{post, server};
use serde_json::{Value, json};

fn file(path: &str) -> Value {
    let whole = format!("{}/../../{path}", env!("CARGO_MANIFEST_DIR"));
    let name = path.rsplit('/').next().expect("a name");
    json!({ "name": name, "text": std::fs::read_to_string(whole).expect(path) })
}

fn files(paths: &[&str]) -> Value {
    json!({ "files": paths.iter().map(|path| file(path)).collect::<Vec<_>>() })
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("a list").iter().map(|x| x.as_f64().expect("a number")).collect()
}

/// A camera turned by a right angle: its position is −Rᵀt, its axes the rows of R, and its covariance is turned too.
#[test]
fn a_rig_is_turned_round() {
    let place = server(None);
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let mut covariance = [[0.0; 6]; 6];
    for (i, variance) in [1e-6, 1e-6, 1e-6, 4e-6, 1e-6, 9e-6].into_iter().enumerate() {
        covariance[i][i] = variance;
    }
    let answer = json!({
        "status": "ok",
        "cameras": { "left": {
            "cam_from_rig": { "rotation_wxyz": [half, 0.0, 0.0, half], "translation_m": [1.0, 2.0, 3.0] },
            "covariance": covariance
        } }
    });
    let view =
        post(place, "/api/rig", &json!({ "files": [{ "name": "a", "text": answer.to_string() }] })).json();
    let camera = &view["cameras"][0];
    // R turns x to y: x_in_cam = (−y, x, z) + t, so the centre is (−2, 1, −3).
    let near = |seen: &Value, wanted: [f64; 3]| {
        let seen = numbers(seen);
        assert!((0..3).all(|i| (seen[i] - wanted[i]).abs() < 1e-12), "{seen:?} {wanted:?}");
    };
    near(&camera["position_m"], [-2.0, 1.0, -3.0]);
    near(&camera["sigma_m"], [1e-3, 2e-3, 3e-3]);
    let chi = 7.814_727_903_251_18_f64.sqrt();
    near(&camera["half_axes_m"][0], [0.0, 0.0, 3e-3 * chi]);
    assert_eq!(camera["border_m"], json!([]));
}

/// The example, from its files and by its name: the same; lenses come from the rig file, counts from the answer.
#[test]
fn the_example_of_a_rig_is_that_of_its_files() {
    let place = server(None);
    let named = post(place, "/api/rig", &json!({ "example": true })).json();
    assert_eq!(
        named,
        post(place, "/api/rig", &files(&["examples/rig/rig.toml", "examples/rig/answer.json"])).json()
    );
    assert_eq!(named["status"], "ok");
    assert_eq!(named["cameras"].as_array().expect("cameras").len(), 4);
    let (mut n_used, mut n_seen) = (0, 0);
    for view in named["views"].as_array().expect("views") {
        for cell in view["cells"].as_array().expect("cells").iter().filter(|cell| !cell.is_null()) {
            n_used += cell["n_used"].as_u64().expect("a count");
            n_seen += cell["n_seen"].as_u64().expect("a count");
        }
    }
    assert_eq!((json!(n_used), json!(n_seen)), (named["n_used"].clone(), named["n_seen"].clone()));
    assert_eq!(named["rejected"][0]["kind"], "observation");
    let residuals: Vec<f64> = named["rejected"]
        .as_array()
        .expect("rows")
        .iter()
        .filter_map(|row| row["residual_px"].as_f64())
        .collect();
    assert!(residuals.windows(2).all(|w| w[1] <= w[0]) && 10 < residuals.len());

    let answer_alone = post(place, "/api/rig", &files(&["examples/rig/answer.json"])).json();
    assert!(answer_alone["remarks"][0].as_str().expect("a remark").contains("rig file"));
    assert_eq!(answer_alone["cameras"][1]["border_m"], json!([]));
    let file_alone = post(place, "/api/rig", &files(&["examples/rig/rig.toml"])).json();
    for (alone, both) in file_alone["cameras"].as_array().expect("cameras").iter().zip(
        ["front", "left", "rear", "right"].map(|name| {
            named["cameras"]
                .as_array()
                .expect("cameras")
                .iter()
                .find(|one| one["name"] == name)
                .expect("a camera")
                .clone()
        }),
    ) {
        let (a, b) = (numbers(&alone["position_m"]), numbers(&both["position_m"]));
        assert!((0..3).all(|i| (a[i] - b[i]).abs() < 1e-9), "{a:?} {b:?}");
        let (a, b) = (numbers(&alone["sigma_m"]), numbers(&both["sigma_m"]));
        assert!((0..3).all(|i| (a[i] - b[i]).abs() < 1e-9), "{a:?} {b:?}");
    }
}

/// What other programs write is shown too: positions, and fields of view through the lenses.
#[test]
fn rigs_of_other_programs_are_shown() {
    let place = server(None);
    for path in [
        "testdata/formats/kalibr_camchain.yaml",
        "testdata/formats/caliscope.toml",
        "testdata/formats/basalt.json",
    ] {
        let answer = post(place, "/api/rig", &files(&[path]));
        assert_eq!(answer.status, 200, "{path}: {}", String::from_utf8_lossy(&answer.body));
        let view = answer.json();
        let cameras = view["cameras"].as_array().expect("cameras");
        assert!(1 < cameras.len(), "{path}");
        assert!(cameras.iter().all(|one| 8 < one["border_m"].as_array().expect("a border").len()), "{path}");
        assert!(view["status"].is_null(), "{path}");
    }
}

/// A wrong file is named, with what is wrong with it.
#[test]
fn a_wrong_file_gets_a_sentence() {
    let place = server(None);
    for (path, wrong, said) in [
        ("/api/rig", "testdata/formats/target_tag.toml", "this is a target"),
        ("/api/rig", "examples/rig/detections.csv", "detections.csv"),
        ("/api/whisker", "examples/rig/rig.toml", "rig.toml"),
        ("/api/whisker", "examples/rig/answer.json", "answer.json"),
        ("/api/whisker", "testdata/whisker/square.json", "no contacts"),
    ] {
        let answer = post(place, path, &files(&[wrong]));
        assert_eq!(answer.status, 422, "{wrong}");
        assert!(answer.message().contains(said) && answer.message().ends_with('.'), "{}", answer.message());
    }
    let two = post(place, "/api/rig", &files(&["examples/rig/answer.json", "examples/rig/answer.json"]));
    assert!(two.message().contains("second answer"), "{}", two.message());
}

/// The square of the example: side and angle within three standard deviations of the truth in its file, the outline through them.
#[test]
fn the_example_of_a_whisker_finds_its_square() {
    let place = server(None);
    let played = post(place, "/api/whisker", &json!({ "example": true })).json();
    assert_eq!(played["is_consistent"], true);
    assert_eq!(played["readings"].as_array().expect("readings").len(), 316);
    let found = &played["found"];
    assert_eq!((&found["is_named"], &found["identification"]["verdict"]), (&json!(true), &json!("square")));
    let parameter = |name: &str| {
        let one = &found["identification"]["parameters"][name];
        (one["value"].as_f64().expect(name), one["sigma"].as_f64().expect(name))
    };
    for (name, truth) in [("side_m", 0.04), ("angle_rad", 20f64.to_radians())] {
        let (value, sigma) = parameter(name);
        assert!((value - truth).abs() < 3.0 * sigma, "{name}: {value} ± {sigma}");
    }
    let (mu, sigma) = (played["mu"].as_f64().expect("mu"), played["mu_sigma"].as_f64().expect("its sigma"));
    assert!((mu - 0.2).abs() < 3.0 * sigma, "{mu} ± {sigma}");
    assert_eq!(found["outline_m"].as_array().expect("corners").len(), 4);
    assert_eq!(played["given_outline_m"].as_array().expect("corners").len(), 4);
    // The whisker leaves the clamp at the hub, is as long as it is, and touches where its contact is.
    for one in played["readings"].as_array().expect("readings") {
        let shape: Vec<Vec<f64>> = one["shape_m"].as_array().expect("a shape").iter().map(numbers).collect();
        let hub = numbers(&one["hub"]);
        assert!((shape[0][0] - hub[0]).hypot(shape[0][1] - hub[1]) < 2e-6);
        let length: f64 = shape.windows(2).map(|w| (w[1][0] - w[0][0]).hypot(w[1][1] - w[0][1])).sum();
        assert!((length - 0.2).abs() < 1e-4, "{length}");
        if one["status"] == "ok" {
            let x = numbers(&one["contact"]["x_m"]);
            let off = shape.windows(2).map(|w| distance(&x, &w[0], &w[1])).fold(f64::INFINITY, f64::min);
            let sigma = one["contact"]["sigma_m"].as_f64().expect("a sigma");
            // The shape is that of the reading alone; friction and tip move the contact within its error bar.
            assert!(off < 3.0 * sigma, "{off} m off the whisker, {sigma}");
        }
    }
}

fn distance(x: &[f64], a: &[f64], b: &[f64]) -> f64 {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let share = (((x[0] - a[0]) * dx + (x[1] - a[1]) * dy) / (dx * dx + dy * dy)).clamp(0.0, 1.0);
    (x[0] - a[0] - share * dx).hypot(x[1] - a[1] - share * dy)
}

/// Contacts that `whisker solve` wrote give the same object, without shapes; one corner alone decides nothing, and says what would.
#[test]
fn contacts_alone_are_enough_and_one_corner_is_not() {
    let place = server(None);
    let read = |path: &str| {
        std::fs::read_to_string(format!("{}/../../{path}", env!("CARGO_MANIFEST_DIR"))).expect(path)
    };
    let whisker =
        resight_whisker::files::whisker::read(&read("testdata/whisker/whisker.json")).expect("a whisker");
    let hub = resight_whisker::files::read_hub(&read("testdata/whisker/hub.csv"), whisker.conventions)
        .expect("readings");
    let solved = resight_whisker::solve::solve(&whisker, &hub, None, &Default::default()).expect("contacts");
    let contacts = |rows: &[resight_whisker::files::ContactRow]| {
        let text = resight_whisker::files::contacts::write_csv(rows);
        post(place, "/api/whisker", &json!({ "files": [{ "name": "contacts.csv", "text": text }] })).json()
    };
    let all = contacts(&solved.rows);
    assert_eq!(all["found"]["identification"]["verdict"], "square");
    assert_eq!((&all["length_m"], &all["is_consistent"]), (&Value::Null, &Value::Null));
    let first: Vec<_> = solved.rows.iter().filter(|row| row.sweep == 0).take(60).cloned().collect();
    let few = contacts(&first);
    assert_eq!(few["found"]["is_named"], false);
    assert!(
        few["found"]["message"].as_str().expect("a message").starts_with("Not decided"),
        "{}",
        few["found"]["message"]
    );
    assert_ne!(few["found"]["identification"]["advice"], "");
}
