//! The rig's page: whole, alone, harmless whatever the names, and saying what the run says. Where node is at hand its script is run too.

use crate::report_support::page::{Parsed, parse};
use crate::report_support::simulated;
use resight::core::multiview::rig::{RigConfig, solve_rig};
use resight::report::rig_page;
use resight::rig::RigRun;
use std::path::PathBuf;
use std::process::Command;

fn parsed(run: &RigRun) -> Parsed {
    parse(&rig_page(run)).unwrap_or_else(|e| panic!("{e}"))
}

/// Written below target/, to be looked at.
fn kept(name: &str, html: &str) -> PathBuf {
    kept_bytes(name, html.as_bytes())
}

fn kept_bytes(name: &str, bytes: &[u8]) -> PathBuf {
    let file = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::write(&file, bytes).unwrap();
    file
}

#[test]
fn the_page_is_well_formed_and_asks_nothing_of_the_network() {
    let html = rig_page(&simulated(4, 40, 1));
    kept("rig4.html", &html);
    let page = parse(&html).unwrap();
    for (name, attributes) in &page.elements {
        assert!(!["link", "iframe", "img", "object", "embed", "base"].contains(&name.as_str()), "{name}");
        assert!(
            !attributes.iter().any(|(key, _)| ["src", "href", "srcset", "action"].contains(&key.as_str()))
        );
    }
    let asks = [
        "http",
        "//cdn",
        "url(",
        "@import",
        "import(",
        "fetch(",
        "XMLHttpRequest",
        "WebSocket",
        "sendBeacon",
        "EventSource",
    ];
    assert_eq!(asks.iter().find(|a| html.contains(**a)), None);
    let mut ids: Vec<&String> =
        page.elements.iter().flat_map(|(_, a)| a).filter(|(key, _)| key == "id").map(|(_, id)| id).collect();
    let n_ids = ids.len();
    ids.sort();
    ids.dedup();
    assert_eq!(ids.len(), n_ids, "an id twice");
}

/// Names that try to be markup, attributes, script ends, comments: on the page they are text, in the data they are themselves.
#[test]
fn names_stay_names() {
    let mut run = simulated(3, 5, 2);
    let plain = parsed(&run);
    let hostile = "</script><script>alert(1)</script>";
    run.rig.views[0] = hostile.into();
    run.rig.views[1] = "\" onmouseover=\"alert(1)".into();
    run.rig.cameras[1].name = "<img src=x onerror=alert(1)>".into();
    run.rig.cameras[2].name = "<!-- ' & &amp; \u{2028}".into();
    run.rig.targets[0].name = "--></style><b>".into();
    run.command = Some("resight rig --camera '<script>'".into());
    run.inputs[0].path = "a&b<c>.csv".into();
    let page = parsed(&run);
    let names = |p: &Parsed| p.elements.iter().map(|(n, _)| n.clone()).collect::<Vec<_>>();
    assert_eq!(names(&page), names(&plain), "a name became an element");
    let attributes =
        |p: &Parsed| p.elements.iter().flat_map(|(_, a)| a).map(|(k, _)| k.clone()).collect::<Vec<_>>();
    assert_eq!(attributes(&page), attributes(&plain), "a name became an attribute");
    assert_eq!(page.scripts.len(), 2);
    for text in
        [hostile, "<img src=x onerror=alert(1)>", "<!-- ' & &amp; \u{2028}", "a&b<c>.csv", "'<script>'"]
    {
        assert!(page.text.contains(text), "{text}");
    }
    let data: serde_json::Value = serde_json::from_str(&page.scripts[0].1).unwrap();
    assert_eq!(data["views"][0], hostile);
    assert_eq!(data["targets"][0]["name"], "--></style><b>");
}

/// Eight cameras, three hundred views: well under 3 MB, and the same bytes again.
#[test]
fn a_large_rig_is_a_small_page_and_always_the_same() {
    let run = simulated(8, 300, 3);
    let html = rig_page(&run);
    kept("rig8.html", &html);
    println!("8 cameras, 300 views, {} points: {} bytes", run.solution.n_seen, html.len());
    assert!(html.len() < 3_000_000, "{}", html.len());
    assert!(html == rig_page(&run.clone()));
    assert!(!html.contains("One in "));
    let larger = rig_page(&simulated(8, 330, 3));
    assert!(larger.contains("One in 2 of the points used and one in 1 of those left out are drawn"));
    assert!(larger.len() < html.len());
}

/// Every residual is in the page: place to half a step of the image over 32767, residual to half of 0.01 px, left out or not.
#[test]
fn stored_residuals_are_the_run_s() {
    let run = simulated(3, 20, 4);
    let data: serde_json::Value = serde_json::from_str(&parsed(&run).scripts[0].1).unwrap();
    let bytes = from_base64(data["residuals"].as_str().unwrap());
    let word = |i: usize| u16::from_le_bytes([bytes[2 * i], bytes[2 * i + 1]]);
    let (width, height) =
        (f64::from(crate::report_support::WIDTH_PX), f64::from(crate::report_support::HEIGHT_PX));
    let mut i = 0;
    for (observation, result) in run.rig.observations.iter().zip(&run.solution.observations) {
        let step = data["cameras"][observation.camera]["step"].as_f64().unwrap();
        assert!(step == 0.01);
        for (c, residual) in observation.seen.iter().zip(&result.residuals_px) {
            let (residual, is_used) = residual.unwrap();
            let (u, v) = (
                f64::from(word(i) & 0x7fff) / 32767.0 * width - 0.5,
                f64::from(word(i + 1)) / 32767.0 * height - 0.5,
            );
            let tolerance = 0.5 * width / 32767.0 + 1e-9;
            assert!((u - c.pixel.x.clamp(-0.5, width - 0.5)).abs() < tolerance);
            assert!((v - c.pixel.y.clamp(-0.5, height - 0.5)).abs() < tolerance);
            assert!((f64::from(word(i + 2) as i16) * step - residual.x).abs() < 0.5 * step + 1e-9);
            assert!((f64::from(word(i + 3) as i16) * step - residual.y).abs() < 0.5 * step + 1e-9);
            assert_eq!(word(i) >> 15 == 0, is_used);
            i += 4;
        }
    }
    assert_eq!(2 * i, bytes.len());
}

fn from_base64(text: &str) -> Vec<u8> {
    let value = |c: u8| match c {
        b'A'..=b'Z' => c - b'A',
        b'a'..=b'z' => c - b'a' + 26,
        b'0'..=b'9' => c - b'0' + 52,
        b'+' => 62,
        b'/' => 63,
        _ => panic!("{c}"),
    };
    let bytes = text.trim_end_matches('=').bytes().map(|c| u32::from(value(c))).collect::<Vec<_>>();
    let words = bytes.chunks(4).flat_map(|chunk| {
        let word = chunk.iter().enumerate().fold(0, |w, (i, v)| w | v << (18 - 6 * i));
        word.to_be_bytes()[1..chunk.len()].to_vec()
    });
    words.collect()
}

/// Tables and sentences hold the run's numbers, in words and in cells.
#[test]
fn the_page_says_what_the_run_says() {
    let run = simulated(4, 12, 6);
    let page = parsed(&run);
    let s = &run.solution;
    let plain = page.text.replace('\u{202f}', "");
    let has = |text: &str| assert!(plain.contains(text), "{text}");
    has(&format!("{} of {}", s.n_used, s.n_seen));
    has(
        "The rig hangs on rear – right: rear is known least, ± 800 µm and ± 0.011° in the worst direction, with 7 shared views.",
    );
    has("board: its stated size is 0.400 ± 0.050 % too small: 1.72 mm of 430 mm; every ± holds that.");
    has("it contradicts the other observations by 41.5 px rms");
    has(run.command.as_deref().expect("a command"));
    has(&run.inputs[0].sha256);
    has(env!("CARGO_PKG_VERSION"));
    has("Pixel (0, 0) is the centre of the top-left pixel");
    has("magnified");
    for (i, camera) in s.cameras.iter().enumerate().skip(1) {
        let origin = camera.cam_from_rig.origin();
        let r = camera.cam_from_rig.rotation;
        let of_place = r.transpose() * camera.covariance.fixed_view::<3, 3>(3, 3) * r;
        has(&resight::report::words::coordinate(origin.x, of_place[(0, 0)].sqrt()));
        has(&s.shared.counts[0][i].to_string());
    }
    let titles: Vec<&String> =
        page.elements.iter().flat_map(|(_, a)| a).filter(|(k, _)| k == "title").map(|(_, v)| v).collect();
    let cells: std::collections::BTreeSet<(usize, usize)> =
        run.rig.observations.iter().map(|s| (s.view, s.camera)).collect();
    assert_eq!(titles.len(), cells.len());
    let first = &run.rig.observations[0];
    let used = s.observations[0].residuals_px.iter().flatten().filter(|r| r.1).count();
    assert!(
        titles[0].starts_with(&format!("centre, 0000: {used} of {} points, rms 0.", first.seen.len())),
        "{}",
        titles[0]
    );
}

/// One camera, nothing placed, no image size, numbers that are none, nothing seen at all: a page, and no NaN on it.
#[test]
fn poor_runs_are_reported_too() {
    let mut run = simulated(1, 2, 3);
    run.solution.bodies.clear();
    run.rig.lenses[0].size = None;
    run.solution.cameras[0].covariance[(3, 3)] = f64::NAN;
    run.solution.rms_px = f64::NAN;
    run.solution.scales[0].sigma = f64::INFINITY;
    run.solution.joint_covariance = None;
    let no_numbers = |run: &RigRun| {
        let html = rig_page(run);
        parse(&html).unwrap_or_else(|e| panic!("{e}"));
        assert!(!html.contains("NaN") && !html.contains("inf "), "a number that is none");
    };
    no_numbers(&run);
    run.rig.views.clear();
    run.rig.observations.clear();
    run.solution.observations.clear();
    no_numbers(&run);
}

/// A rig that the solver solved, from the pixels on: page and scene say what it found, which is the truth within its error bars.
#[test]
fn a_solved_rig_is_reported() {
    let (rig, _) = crate::report_support::question(4, 25, 9);
    let config = RigConfig { joint_covariance: true, ..RigConfig::default() };
    let solution = solve_rig(&rig.problem(), &config).unwrap();
    for (i, camera) in solution.cameras.iter().enumerate().skip(1) {
        let truth = crate::report_support::cam_from_rig(i, 4);
        // Of places with an honest covariance one in 10⁶ is farther off than χ² = 40 with six degrees of freedom.
        let xi = (camera.cam_from_rig * truth.inverse()).log();
        assert!(xi.dot(&(camera.covariance.try_inverse().unwrap() * xi)) < 40.0);
    }
    let run = RigRun { rig, solution, ..simulated(4, 1, 9) };
    let html = rig_page(&run);
    kept("solved.html", &html);
    let page = parse(&html).unwrap_or_else(|e| panic!("{e}"));
    assert!(!page.text.contains("–%") && !html.contains("NaN"));
    let sentence = resight::report::rig::weakest_link_sentence(&run).unwrap();
    assert!(page.text.contains(&sentence), "{sentence}");
    assert!(page.text.contains("1 % in every distance"));
    let outliers = run.solution.n_seen - run.solution.n_used;
    // One point in forty was moved by 12 px times a normal; the gate lies at 1.3 px.
    assert!((run.solution.n_seen / 60..run.solution.n_seen / 30).contains(&outliers), "{outliers}");
    assert!(page.text.contains(&format!("{outliers} of ")), "{outliers}");
    kept_bytes("solved.mcap", &resight::scene::rig_scene(&run).unwrap());
}

fn node() -> bool {
    let found = Command::new("node").arg("--version").output().is_ok_and(|o| o.status.success());
    if !found {
        eprintln!("SKIPPED: node is not installed, the page's script was not run");
    }
    found
}

/// The script runs through, the image in space starts as the still one, and choosing, turning and dragging change what is drawn.
#[test]
fn the_script_draws_what_the_still_picture_shows() {
    if !node() {
        return;
    }
    let run = simulated(3, 20, 8);
    let html = rig_page(&run);
    let page = kept("rig3.html", &html);
    let program = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/report_support/run_page.js");
    let output = Command::new("node").arg(program).arg(page).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let answer: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(answer["scripted"], true);
    assert_eq!(answer["views"].as_array().unwrap().len(), 21);
    // Twenty targets fit the still image's limit, so it shows all of them; both are drawn to the same scale.
    let strokes = |moment: &str| answer[moment]["space"].as_array().unwrap().clone();
    let drawn: Vec<[f64; 2]> = strokes("start").iter().flat_map(|s| points_of(&s["line"])).collect();
    let still = still_points(&html);
    assert!(200 < still.len());
    for p in &still {
        // The still image is rounded to 0.1, the script's poses to 1e-5, which moves a corner by hundredths.
        assert!(drawn.iter().any(|q| (p[0] - q[0]).abs() < 0.1 && (p[1] - q[1]).abs() < 0.1), "{p:?}");
    }
    let targets = |moment: &str| {
        strokes(moment).iter().filter(|s| s["color"] == "--faint" || s["color"] == "--ink").count()
    };
    assert_eq!((targets("start"), targets("first_view")), (20, 1));
    assert_eq!(answer["first_view"]["said"], "1 of 20");
    assert_ne!(strokes("turned"), strokes("first_view"));
    assert_eq!(strokes("back"), strokes("first_view"));
    assert_ne!(strokes("dragged"), strokes("back"));
    let used = |view: Option<usize>, camera: usize| {
        let all = run.rig.observations.iter().zip(&run.solution.observations);
        let own = all.filter(|(s, _)| s.camera == camera && view.is_none_or(|v| v == s.view));
        own.flat_map(|(_, r)| r.residuals_px.iter().flatten()).count()
    };
    for camera in 0..3 {
        assert_eq!(answer["start"]["fields"][camera]["n"], used(None, camera));
        assert_eq!(answer["first_view"]["fields"][camera]["n"], used(Some(0), camera));
    }
}

fn points_of(line: &serde_json::Value) -> Vec<[f64; 2]> {
    line.as_array().unwrap().iter().map(|p| [p[0].as_f64().unwrap(), p[1].as_f64().unwrap()]).collect()
}

/// Corners of all paths of the still image in space.
fn still_points(html: &str) -> Vec<[f64; 2]> {
    let start = html.find("id=\"space-still\"").unwrap();
    let svg = &html[start..start + html[start..].find("</svg>").unwrap()];
    let paths = svg.split(" d=\"").skip(1).map(|p| &p[..p.find('"').unwrap()]);
    let pairs = paths.flat_map(|p| p.split(['M', 'L', 'Z']).filter(|t| !t.is_empty()));
    pairs
        .map(|pair| {
            let (x, y) = pair.split_once(' ').unwrap();
            [x.parse().unwrap(), y.parse().unwrap()]
        })
        .collect()
}

/// A rig that no command line asked for has a page and a scene without one.
#[test]
fn without_a_command_line_none_is_shown() {
    let asked = simulated(3, 5, 2);
    let command = asked.command.clone().expect("a command");
    let silent = RigRun { command: None, ..asked.clone() };
    assert!(rig_page(&asked).contains("<pre>") && !rig_page(&silent).contains("<pre>"));
    let has_command = |run: &RigRun| {
        let scene = resight::scene::rig_scene(run).expect("a scene");
        scene.windows(command.len()).any(|bytes| bytes == command.as_bytes())
    };
    assert!(has_command(&asked) && !has_command(&silent));
}
