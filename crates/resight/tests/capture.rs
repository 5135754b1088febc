//! A camera that is calibrated while its target is moved: rendered views with a known camera, and every way in which a capture comes to nothing.

use crate::recorded::recorded;
use resight::answer::CaptureAnswer;
use resight::capture::{Capture, CaptureConfig, FrameUse, LEAST_GAIN, LEAST_VIEWS, Look};
use resight::core::camera::{BrownConrady, ImageSize};
use resight::core::correspondence::correspond;
use resight::core::multiview::intrinsics::{
    CHOICES, IntrinsicsConfig, IntrinsicsOutcome, Models, Placement, solve_intrinsics,
};
use resight::core::target::{Chessboard, Feature, Tag};
use resight::core::{Camera, CameraMatrix, Correspondence, Pixel, Point, Target};
use resight::detect::Detector;
use resight::intrinsics::{IntrinsicsRequest, IntrinsicsSource, Noise};
use resight::render::{Finish, Placed, Scene, Style, render, true_pixels};
use resight::rig::{CameraImage, ImageOptions};
use resight::{GrayImage, IntrinsicsAnswer, Status};

const SIZE: ImageSize = ImageSize { width_px: 640, height_px: 480 };
const BOARD: Chessboard = Chessboard { rows: 5, columns: 8, square_m: 0.03 };

fn board() -> Target {
    Target::Chessboard(BOARD)
}

fn camera() -> Camera {
    let matrix = CameraMatrix { fx_px: 610.0, fy_px: 612.0, cx_px: 322.0, cy_px: 236.0 };
    let lens = BrownConrady::new(matrix, &[-0.2, 0.1, 0.0, 0.0, 0.0]).expect("a lens");
    Camera { lens: lens.into(), size: Some(SIZE) }
}

/// The board at a place of the image, tilted.
fn placement(u: f64, v: f64, tilt_rad: f64, axis_rad: f64, part: f64) -> Placement {
    let centre = Pixel::new(u * f64::from(SIZE.width_px), v * f64::from(SIZE.height_px));
    Placement { centre, tilt_rad, axis_rad, part }
}

/// Nine places, each with several tilts: what a patient person shows.
fn patient(i: usize) -> Placement {
    let at = |k: usize| [0.5, 0.25, 0.75][k % 3];
    let (tilt, part) = ([0.6, 0.45, 0.7][i / 9 % 3], [0.45, 0.55][i % 2]);
    placement(at(i), at(i / 3), tilt, 2.4 * i as f64, part)
}

fn image(placement: &Placement, seed: u64) -> GrayImage {
    let high = Point::new(0.03 * 7.0, 0.03 * 4.0, 0.0);
    let camera = camera();
    let cam_from_target = placement.cam_from_target(&camera, SIZE, [Point::zeros(), high]).expect("a pose");
    let finish = Finish { seed, ..Finish::default() };
    render(&Scene::of(board(), cam_from_target, Style::default()), &camera, &finish).expect("an image")
}

fn photographs() -> CaptureConfig {
    CaptureConfig { are_photographs: true, ..CaptureConfig::default() }
}

/// A capture that was given images, with those that it kept.
struct Run {
    job: Capture,
    kept: Vec<GrayImage>,
    looks: Vec<Look>,
}

fn run(target: Target, config: CaptureConfig, images: impl IntoIterator<Item = GrayImage>) -> Run {
    let mut run =
        Run { job: Capture::new(target, config).expect("a capture"), kept: Vec::new(), looks: Vec::new() };
    for (i, image) in images.into_iter().enumerate() {
        if run.job.is_over() {
            break;
        }
        let look = run.job.push(&format!("frame {i}"), &image).expect("a look");
        if matches!(look.outcome, FrameUse::Kept { .. }) {
            run.kept.push(image);
        }
        run.looks.push(look);
    }
    run
}

/// `resight intrinsics` for the kept images, by the names under which they are written.
fn intrinsics(kept: &[GrayImage], noise: Noise) -> IntrinsicsAnswer {
    let images = kept.iter().enumerate();
    let images = images
        .map(|(i, image)| CameraImage::in_memory("camera", format!("view-{:03}", i + 1), image.clone()));
    let source = IntrinsicsSource::Images { images: images.collect(), options: ImageOptions::default() };
    let targets = vec![("chessboard".to_string(), board())];
    let request = IntrinsicsRequest {
        targets,
        noise,
        cameras: vec!["camera".to_string()],
        ..IntrinsicsRequest::new(source)
    };
    resight::intrinsics(&request).expect("an answer")
}

fn json(answer: &impl serde::Serialize) -> serde_json::Value {
    serde_json::to_value(answer).expect("json")
}

fn refused(answer: &CaptureAnswer, reason: &str) -> usize {
    answer.refused.iter().find(|one| one.reason == reason).map_or(0, |one| one.n)
}

/// It ends by itself once the projection is known well enough; the truth is within its ±; the answer is that of `intrinsics` for the kept
/// images in every digit, and the same at every run.
#[test]
fn it_ends_when_it_is_enough_with_the_answer_of_intrinsics() {
    let once = || run(board(), photographs(), (0..27).map(|i| image(&patient(i), i as u64)));
    let first = once();
    let answer = first.job.answer();
    println!("{}", answer.message);
    assert!(answer.status == Status::Ok && answer.message.starts_with("enough: "), "{}", answer.message);
    assert!((LEAST_VIEWS..27).contains(&first.kept.len()), "{} kept", first.kept.len());
    let finished = first.job.finish();
    assert_eq!(json(&finished), json(&intrinsics(&first.kept, Noise::Estimated)));
    assert_eq!(json(&answer), json(&once().job.answer()));
    let found = answer.camera.intrinsics.as_ref().expect("intrinsics");
    for (p, (name, truth)) in found.parameters.iter().zip(camera().parameters()).take(4) {
        println!("{name} {:.2} ± {:.2}, true {truth}", p.value, p.sigma);
        assert!((p.value - truth).abs() < 4.0 * p.sigma && p.sigma < 3.0, "{name} {} ± {}", p.value, p.sigma);
    }
    let worst = answer.progress.worst_px.expect("a figure");
    assert!(0.0 < worst && worst <= answer.progress.needed_px);
}

/// Every suggestion before the first camera and after it can be drawn, and what is predicted of the next view comes true when it is taken: the
/// uncertainty falls to what the sentence promised, within the scatter of the estimated noise.
#[test]
fn the_next_view_keeps_its_promise() {
    let mut job = Capture::new(board(), photographs()).expect("a capture");
    for i in 0..6 {
        job.push("frame", &image(&patient(i), i as u64)).expect("a look");
        let next = job.next_view().expect("a suggestion");
        assert!(
            next.message.starts_with("put the target ") && 16 < next.outline_px.len(),
            "{}",
            next.message
        );
    }
    let mean = |job: &Capture| job.camera().and_then(|c| c.intrinsics.as_ref()?.next_view.clone());
    let before = mean(&job).expect("a next view");
    let at = Placement {
        centre: Pixel::new(before.centre_px[0], before.centre_px[1]),
        tilt_rad: before.tilt_rad,
        axis_rad: before.axis_rad,
        part: 0.03 * 7.0 * 610.0 / (before.distance_m * f64::from(SIZE.height_px)),
    };
    let look = job.push("suggested", &image(&at, 99)).expect("a look");
    assert!(matches!(look.outcome, FrameUse::Kept { gain: Some(gain), .. } if LEAST_GAIN < gain), "{look:?}");
    let after = mean(&job).expect("a next view");
    println!("{:.3} px, promised {:.3} px, came to {:.3} px", before.now_px, before.then_px, after.now_px);
    assert!(after.now_px < 0.5 * (before.now_px + before.then_px) + 0.2 * before.now_px);
}

/// What is predicted of a further view is what the estimation finds with it, under one model and the noise as stated, where nothing else changes.
#[test]
fn a_further_view_is_predicted() {
    let lens = CHOICES.iter().find(|choice| choice.label() == "brown_conrady k1 k2").expect("a choice");
    let config =
        IntrinsicsConfig { models: Models::Only(*lens), noise: Noise::Stated, ..IntrinsicsConfig::default() };
    let high = Point::new(0.03 * 7.0, 0.03 * 4.0, 0.0);
    let view = |i: usize| -> Vec<Correspondence> {
        let pose = patient(i).cam_from_target(&camera(), SIZE, [Point::zeros(), high]).expect("a pose");
        let placed = Placed { target: board(), cam_from_target: pose, style: Style::default() };
        let point = |(feature, pixel): (Feature, Pixel)| {
            let known = board().point(feature).expect("a point");
            Correspondence::new(&camera(), known.position, pixel, 0.1).expect("a correspondence")
        };
        true_pixels(&placed, &camera()).into_iter().map(point).collect()
    };
    let forecast = |n: usize| match solve_intrinsics(&(0..n).map(view).collect::<Vec<_>>(), SIZE, &config) {
        Ok(IntrinsicsOutcome::Solved(solved)) => solved.forecast.expect("a forecast"),
        other => panic!("{other:?}"),
    };
    for n in [6, 12] {
        let before = forecast(n);
        let (predicted, found) = (before.with_view_px(&view(n)).expect("a figure"), forecast(n + 1).now_px());
        println!("{n} views: {:.4} px, predicted {predicted:.4}, found {found:.4}", before.now_px());
        assert!(predicted < 0.99 * before.now_px() && (predicted / found - 1.0).abs() < 0.01);
    }
}

/// A view that was refused because it adds too little adds too little: with the noise as stated, so that only its information counts, the
/// uncertainty falls by less than the limit.
#[test]
fn what_is_refused_adds_little() {
    let config = CaptureConfig { enough_px: 1e-3, ..photographs() };
    let shown = run(board(), config, (0..36).map(|i| image(&patient(i), i as u64)));
    let little = shown.looks.iter().rposition(|look| matches!(look.outcome, FrameUse::LittleNew { .. }));
    let little = little.expect("a view that adds little");
    let n_before =
        shown.looks[..little].iter().filter(|look| matches!(look.outcome, FrameUse::Kept { .. })).count();
    let rms = |images: &[GrayImage]| {
        let answer = intrinsics(images, Noise::Stated);
        let found = answer.cameras[0].intrinsics.as_ref().expect("intrinsics");
        found.next_view.as_ref().expect("a next view").now_px
    };
    let mut with = shown.kept[..n_before].to_vec();
    let without = rms(&with);
    with.push(image(&patient(little), little as u64));
    let gain = 1.0 - rms(&with) / without;
    println!("view {little}, after {n_before}: {:.2} %", 100.0 * gain);
    assert!(0.0 < gain && gain < LEAST_GAIN, "{gain}");
    assert_eq!(shown.job.answer().status, Status::Undecided);
}

/// Of a target that moves between places and rests at each, only images at rest are kept, one of each place.
#[test]
fn a_moving_target_is_not_kept() {
    let between = |a: &Placement, b: &Placement, t: f64| Placement {
        centre: a.centre + (b.centre - a.centre) * t,
        tilt_rad: a.tilt_rad + (b.tilt_rad - a.tilt_rad) * t,
        axis_rad: a.axis_rad + (b.axis_rad - a.axis_rad) * t,
        part: a.part + (b.part - a.part) * t,
    };
    let frames = (0..5usize).flat_map(|i| {
        let way = (0..4).map(move |k| (i, f64::from(k) / 4.0));
        way.chain([(i, 1.0), (i, 1.0), (i, 1.0)])
    });
    let frames: Vec<(usize, f64)> = frames.collect();
    let images = frames
        .iter()
        .enumerate()
        .map(|(n, (i, t))| image(&between(&patient(*i), &patient(i + 1), *t), n as u64));
    let shown = run(board(), CaptureConfig::default(), images);
    for (look, (i, t)) in shown.looks.iter().zip(&frames) {
        println!("{i} {t}: {}", look.outcome.message());
        if matches!(look.outcome, FrameUse::Kept { .. }) {
            assert_eq!(*t, 1.0, "kept on the way");
        }
    }
    assert_eq!(shown.kept.len(), 5);
    assert!(5 < refused(&shown.job.answer(), "moving"));
}

/// Where the target never rests, the message says to hold it still.
#[test]
fn a_target_that_never_rests_gives_no_view() {
    let shown = run(board(), CaptureConfig::default(), (0..5).map(|i| image(&patient(i), i as u64)));
    let answer = shown.job.answer();
    assert_eq!((shown.kept.len(), answer.status), (0, Status::NotFound));
    assert!(
        answer.message.contains("4 frames not kept") && answer.message.contains("hold it still"),
        "{}",
        answer.message
    );
}

/// A camera and a target that both stand still give one view, and the message says to move the target.
#[test]
fn a_still_target_gives_one_view() {
    let shown = run(board(), CaptureConfig::default(), (0..12).map(|seed| image(&patient(0), seed)));
    let answer = shown.job.answer();
    assert_eq!((shown.kept.len(), answer.status), (1, Status::Degenerate), "{}", answer.message);
    assert_eq!(refused(&answer, "alike"), 10);
    assert!(
        answer.message.contains("move and tilt the target") && answer.message.contains("10 frames not kept"),
        "{}",
        answer.message
    );
}

/// Three views: what is missing is a number, and the next view is suggested.
#[test]
fn three_views_say_how_many_are_missing() {
    let shown = run(board(), photographs(), (0..3).map(|i| image(&patient(i), i as u64)));
    let answer = shown.job.answer();
    println!("{:?} {}", answer.status, answer.message);
    assert!(shown.kept.len() == 3 && answer.status != Status::Ok);
    assert!(
        answer.message.contains("of 10 needed: take 7 more")
            || answer.message.contains("of 10 needed: take 10 more"),
        "{}",
        answer.message
    );
    assert!(answer.next_view.is_some());
}

/// Frontal views determine no camera however many: ten are kept, the others refused for their tilt, and the message asks for it.
#[test]
fn frontal_views_are_not_enough() {
    let frontal = |i: usize| {
        let at = |k: usize| [0.5, 0.3, 0.7][k % 3];
        image(&placement(at(i), at(i / 3), 0.0, 0.0, 0.35 + 0.01 * i as f64), i as u64)
    };
    let shown = run(board(), photographs(), (0..18).map(frontal));
    let answer = shown.job.answer();
    println!("{}", answer.message);
    assert_eq!(answer.status, Status::Degenerate, "{}", answer.message);
    assert!(answer.message.contains("tilt") && shown.kept.len() <= LEAST_VIEWS, "{}", answer.message);
}

/// Without a target in any image, and with the file of another board, the first image is explained in the words of all commands.
#[test]
fn without_its_target_the_message_says_what_is_there() {
    let shown = run(board(), photographs(), (0..3).map(|_| GrayImage::filled(640, 480, 90)));
    let answer = shown.job.answer();
    assert_eq!(answer.status, Status::NotFound);
    assert!(answer.message.starts_with("no target was found in any of 3 images"), "{}", answer.message);
    let other = Target::Chessboard(Chessboard { rows: 4, ..BOARD });
    let shown = run(other, photographs(), (0..2).map(|i| image(&patient(i), i as u64)));
    let answer = shown.job.answer();
    println!("{}", answer.message);
    assert_eq!(answer.status, Status::NotFound);
    assert!(answer.message.contains("a grid of 5 × 8 inner corners is there"), "{}", answer.message);
    assert_eq!(json(&shown.job.finish().cameras[0].message), json(&answer.camera.message));
    let answer = Capture::new(board(), photographs()).expect("a capture").answer();
    assert!(
        answer.status == Status::NotFound && answer.message.contains("no image came"),
        "{}",
        answer.message
    );
}

/// A view that is taken back leaves the camera of the others in every digit, and is not kept again; another one takes its name.
#[test]
fn a_view_that_is_taken_back_was_never_there() {
    let mut shown = run(board(), photographs(), (0..8).map(|i| image(&patient(i), i as u64)));
    let n = shown.kept.len();
    let before = shown.job.state();
    let taken = shown.job.take_back().expect("an estimate").expect("a view");
    assert_eq!(taken.view, format!("view-{n:03}"));
    let state = shown.job.state();
    assert_eq!((state.views.len(), before.views.len()), (n - 1, n));
    assert_eq!(json(&shown.job.finish()), json(&intrinsics(&shown.kept[..n - 1], Noise::Estimated)));
    let of_state = json(&state.coverage.expect("cells").counts);
    let found = shown.job.answer().camera.intrinsics.as_ref().expect("intrinsics").coverage.counts.clone();
    assert_eq!(of_state, json(&found));
    let again = shown.job.push("again", &shown.kept[n - 1]).expect("a look");
    assert!(matches!(again.outcome, FrameUse::TakenBack { .. }), "{:?}", again.outcome);
    let state = shown.job.state();
    let last = state.last.expect("a frame");
    assert!(
        last.reason == Some("taken_back") && last.message.contains("move or tilt it") && last.n_points == 40
    );
    let other = shown.job.push("other", &image(&patient(11), 11)).expect("a look");
    assert!(
        matches!(&other.outcome, FrameUse::Kept { view, .. } if *view == taken.view),
        "{:?}",
        other.outcome
    );
    for _ in 0..n {
        assert!(shown.job.take_back().expect("an estimate").is_some());
    }
    let state = shown.job.state();
    assert!(shown.job.take_back().expect("nothing").is_none() && state.parameters.is_none());
    assert_eq!((state.status, state.is_usable, state.missing.len()), (Status::NotFound, false, 0));
}

/// What a page shows is what the answer says.
#[test]
fn the_state_is_that_of_the_answer() {
    let shown = run(board(), photographs(), (0..7).map(|i| image(&patient(i), i as u64)));
    let (state, answer) = (shown.job.state(), shown.job.answer());
    let found = answer.camera.intrinsics.as_ref().expect("intrinsics");
    assert_eq!(json(&state.parameters), json(&found.parameters));
    assert_eq!((state.status, json(&state.progress)), (answer.status, json(&answer.progress)));
    assert_eq!(json(&state.next_view), json(&answer.next_view));
    assert_eq!(json(&state.coverage.expect("cells").counts), json(&found.coverage.counts));
    let whole = format!("{}; {}", state.message, state.missing.join("; "));
    assert!(answer.message.starts_with(&whole), "{whole}\n{}", answer.message);
    let steps: Vec<&str> = state.views.iter().map(|step| step.view.as_str()).collect();
    assert!(steps.iter().eq(shown.job.kept().iter().map(|kept| &kept.view)));
    let last = state.views.last().and_then(|step| step.parameters.as_ref()).expect("parameters");
    assert_eq!(json(last), json(&found.parameters[..4].to_vec()));
}

/// Images that EXIF asks viewers to rotate are counted in a remark.
#[test]
fn an_orientation_is_a_remark() {
    let mut job = Capture::new(board(), photographs()).expect("a capture");
    for (i, how) in [None, Some("rotated by 180°"), Some("rotated by 180°")].into_iter().enumerate() {
        job.count_orientation(how);
        job.push("frame", &image(&patient(i), i as u64)).expect("a look");
    }
    let remarks = job.answer().remarks;
    assert!(
        remarks[0].contains("EXIF asks viewers to show 2 images of camera camera rotated by 180°"),
        "{remarks:?}"
    );
    assert_eq!((remarks.len(), &job.state().remarks, &job.finish().remarks), (1, &remarks, &remarks));
}

/// Images of another size than the first take no part, and are counted.
#[test]
fn images_of_two_sizes_are_not_mixed() {
    let images = (0..4).map(|i| match i {
        0 | 2 => image(&patient(i), i as u64),
        _ => GrayImage::filled(320, 240, 90),
    });
    let shown = run(board(), photographs(), images);
    assert_eq!((shown.kept.len(), refused(&shown.job.answer(), "other_size")), (2, 2));
    let message = shown.looks[1].outcome.message();
    assert!(message.contains("320 × 240 px, the first one 640 × 480 px"), "{message}");
}

/// A target with too few points, and settings out of range, are refused at once.
#[test]
fn what_cannot_succeed_is_refused() {
    let tag = Target::Tag(Tag { family: "tag36h11".into(), id: 3, size_m: 0.1 });
    let reason = Capture::new(tag, photographs()).err().expect("refused").to_string();
    assert!(
        reason.contains("4 points at most, 6 are needed") && reason.contains("resight print"),
        "{reason}"
    );
    for (config, needed) in [
        (CaptureConfig { enough_px: 0.0, ..photographs() }, "positive"),
        (CaptureConfig { enough_px: f64::NAN, ..photographs() }, "positive"),
        (CaptureConfig { most_views: 4, ..photographs() }, "10 or more"),
    ] {
        let reason = Capture::new(board(), config).err().expect("refused").to_string();
        assert!(reason.contains(needed), "{reason}");
    }
}

/// The recorded photographs of one camera of the pair, as `intrinsics` sees them.
fn photographed(side: &str) -> Vec<Vec<Correspondence>> {
    let target = Target::Chessboard(Chessboard { rows: 6, columns: 9, square_m: 0.025 });
    let folder = recorded("opencv_stereo_chessboard");
    let mut files: Vec<_> =
        std::fs::read_dir(folder).expect("photographs").map(|e| e.expect("a file").path()).collect();
    files.retain(|file| file.file_name().is_some_and(|name| name.to_string_lossy().starts_with(side)));
    files.sort();
    let unused = Camera { size: Some(SIZE), ..Camera::normalized() };
    let mut detector = Detector::new(&target).expect("a detector");
    let of_file = |file: std::path::PathBuf| {
        let image = GrayImage::read(&file).expect("an image");
        let detections = detector.detect(&image).expect("a board");
        correspond(&detections, &target, &unused).0.into_iter().map(|(_, c)| c).collect()
    };
    files.into_iter().map(of_file).collect()
}

/// On photographs too what is predicted of the next view is what is found with it, although which coefficients the lens needs is open: within a
/// factor of 2.5 in each case, because the scatter between views is estimated anew, and without a tendency. What is said of now is what the
/// answer says. (Under the chosen lens alone 1.02 px were said where the answer said 4.28 px.)
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn the_next_photograph_is_predicted() {
    let solved =
        |views: &[Vec<Correspondence>]| match solve_intrinsics(views, SIZE, &IntrinsicsConfig::default()) {
            Ok(IntrinsicsOutcome::Solved(solved)) => solved,
            other => panic!("{other:?}"),
        };
    let mut logarithms = Vec::new();
    for side in ["left", "right"] {
        let views = photographed(side);
        assert_eq!(views.len(), 13);
        for n in 5..13 {
            let (before, after) = (solved(&views[..n]), solved(&views[..n + 1]));
            let forecast = before.forecast.as_ref().expect("a forecast");
            let said = forecast.now_px();
            assert_eq!(Some(said), before.projection.rms_px());
            let predicted = forecast.with_view_px(&views[n]).expect("a figure");
            let found = after.projection.rms_px().expect("a figure");
            println!("{side}, {n} views: {said:.3} px, predicted {predicted:.3}, found {found:.3}");
            logarithms.push((found / predicted).ln());
        }
    }
    let mean = logarithms.iter().sum::<f64>() / logarithms.len() as f64;
    let largest = logarithms.iter().map(|x| x.abs()).fold(0.0, f64::max);
    println!("found over predicted: {:.2} in the mean, {:.2} at most", mean.exp(), largest.exp());
    assert!(mean.abs() < 1.25f64.ln() && largest < 2.5f64.ln());
}
