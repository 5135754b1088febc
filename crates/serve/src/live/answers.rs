//! The state of watched cameras, as pages and programs receive it.

use resight::core::Vector6;
use resight::core::locate::PoseEstimate;
use resight::core::locate::choose::Ambiguity;
use resight::report::words::{position_sigma_m, sigmas, yaw_pitch_roll_rad};
use resight_watch::board::motion::Present;
use resight_watch::board::pair::{Learnt, PairBoard};
use resight_watch::board::statistics::Rolling;
use resight_watch::board::strip::{Stretch, StripBin};
use resight_watch::board::{Board, Instants};
use resight_watch::outputs::said::word;
use schemars::JsonSchema;
use serde::Serialize;

/// The message of the WebSocket that comes four times a second.
#[derive(Serialize, JsonSchema)]
pub struct LiveMessage {
    /// How everything is.
    pub live: LiveView,
}

/// How everything is.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct LiveView {
    /// The cameras, in the session's order.
    pub cameras: Vec<CameraView>,
    /// What they look at.
    pub targets: Vec<String>,
    /// Whether the session has ended.
    pub is_over: bool,
    /// Why it has, where something failed.
    pub failed: Option<String>,
    /// Why references cannot be set here.
    pub fixed: Option<String>,
    /// Whether a history file is there to be asked.
    pub has_history: bool,
    /// When this was so, seconds since 1970.
    pub unix_s: f64,
}

/// How a camera is; numbers of poses are against its gravest target.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct CameraView {
    name: String,
    target: Option<String>,
    /// `learning`, `steady`, `checking`, `drifted`, `stale`, `inconsistent` or `tracking`, of the gravest target; none before the first frame.
    state: Option<&'static str>,
    /// In a sentence.
    words: String,
    /// What puts a camera back that moved: it shrinks as the camera is put back.
    way_back: Option<WayBackView>,
    /// A motion that is not acknowledged.
    alarm: Option<AlarmView>,
    /// Whether the last frame is no longer ago than a few frames are apart, and the source is there. What is not fresh is not live.
    is_fresh: bool,
    /// Why the source gives nothing.
    lost: Option<String>,
    has_ended: bool,
    /// Seconds since the last frame.
    age_s: Option<f64>,
    /// Frames a second.
    fps: Option<f64>,
    /// Of the last 300 frames.
    stages: Vec<StageView>,
    dropped: u64,
    left_out: u64,
    /// Points in the last frame, and those that agree with its pose.
    n_points: usize,
    n_agree: Option<usize>,
    /// Why the last frame has no pose.
    no_pose: Option<String>,
    rms_px: Option<f64>,
    ambiguity: Option<AmbiguityView>,
    /// Where the camera was in the last frame, frame of the target.
    pose: Option<PoseView>,
    /// How far the poses of the last frames scatter, at most 300 since Reset.
    spread: SpreadView,
    /// Points found and points that agree in the last frames, oldest first; −1 where there is no pose.
    points: Vec<[i64; 2]>,
}

/// What puts a camera back: what does not stand out of its error is zero.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct WayBackView {
    /// About the camera's x right, y down, z forward.
    rotation_rad: [f64; 3],
    rotation_sigma_rad: [f64; 3],
    translation_m: [f64; 3],
    translation_sigma_m: [f64; 3],
    /// `rotate left 0.507° ± 0.010°`.
    words: String,
}

/// An alarm that waits.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct AlarmView {
    /// Seconds since 1970.
    unix_s: f64,
    words: String,
}

/// How long a stage takes.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct StageView {
    /// `waited`, `detect`, `solve`, `decide`, and `latency`: all of it.
    name: &'static str,
    median_us: Option<f64>,
    p99_us: Option<f64>,
}

/// Whether another pose fits as well.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct AmbiguityView {
    is_ambiguous: bool,
    /// Probability of the pose.
    probability: f64,
    /// Error of the second pose by that of this one; none where there is none.
    ratio: Option<f64>,
}

/// A pose.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct PoseView {
    /// Where the camera is, frame of the target, and its standard deviations.
    position_m: [f64; 3],
    sigma_m: [f64; 3],
    /// For display only.
    yaw_pitch_roll_rad: [f64; 3],
    /// Standard deviations of the rotation about the camera's x, y, z.
    rotation_sigma_rad: [f64; 3],
}

/// Standard deviations over frames.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct SpreadView {
    n: usize,
    /// About the camera's x, y, z.
    rotation_rad: Option<[f64; 3]>,
    translation_m: Option<[f64; 3]>,
}

/// The reference of a camera and a target, and what it is compared with.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct ReferenceView {
    target: String,
    /// None while it is learned for the first time.
    reference: Option<DatedPose>,
    /// What it was compared with before.
    earlier: Option<DatedPose>,
    /// Where the camera is now, from its readings of the last half second, against the reference.
    now: Option<MotionView>,
    /// How the reference differs from the one before.
    changed: Option<MotionView>,
}

/// A reference.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct DatedPose {
    pose: PoseView,
    /// When it was learned, seconds since 1970; none where a file gave it.
    unix_s: Option<f64>,
}

/// A motion, in the old frame of the camera.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct MotionView {
    rotation_rad: [f64; 3],
    rotation_sigma_rad: [f64; 3],
    translation_m: [f64; 3],
    translation_sigma_m: [f64; 3],
    words: String,
}

/// A stretch of time in few parts.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct StripView {
    /// Seconds of capture.
    from_s: f64,
    to_s: f64,
    /// Whether it comes from the history file, or from what this session remembers.
    is_from_history: bool,
    /// Equal parts of it, in order.
    bins: Vec<BinView>,
}

/// A part of a stretch.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct BinView {
    from_s: f64,
    /// The gravest state in it; none where nothing was watched.
    state: Option<&'static str>,
    /// How far the camera was rotated from its reference.
    rotation_rad: Option<f64>,
}

/// A line about what happened.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct LogLine {
    /// Seconds since 1970.
    unix_s: f64,
    /// None where it is about several.
    camera: Option<String>,
    text: String,
}

impl LiveView {
    pub(super) fn of(
        board: &Board,
        now: Instants,
        failed: Option<String>,
        fixed: Option<&str>,
        has_history: bool,
    ) -> Self {
        let cameras = 0..board.names.cameras.len();
        LiveView {
            cameras: cameras.filter_map(|camera| CameraView::of(board, camera, now)).collect(),
            targets: board.names.targets.clone(),
            is_over: board.is_over,
            failed,
            fixed: fixed.map(str::to_owned),
            has_history,
            unix_s: now.unix_s,
        }
    }
}

impl CameraView {
    fn of(board: &Board, camera: usize, now: Instants) -> Option<Self> {
        let (own, at) = (board.cameras.get(camera)?, board.gravest(camera)?);
        let pair = board.pairs.get(at)?;
        let last = pair.last.as_ref();
        let estimate = last.and_then(|last| last.estimate.as_ref());
        Some(CameraView {
            name: board.names.camera(camera).to_owned(),
            target: board.names.targets.get(board.names.of_pair(at).1).cloned(),
            state: pair.state.as_ref().map(word),
            words: pair.words(now),
            way_back: pair.way_back().map(|back| {
                let [rotation_rad, translation_m] = halves(&back.motion);
                let [rotation_sigma_rad, translation_sigma_m] = halves(&back.sigma);
                let words = back.words;
                WayBackView { rotation_rad, rotation_sigma_rad, translation_m, translation_sigma_m, words }
            }),
            alarm: own.alarm.as_ref().map(|a| AlarmView { unix_s: a.unix_s, words: a.words.clone() }),
            is_fresh: board.is_fresh(camera, now),
            lost: own.lost.clone(),
            has_ended: own.has_ended,
            age_s: pair.age_s(now),
            fps: pair.rate.per_s(now.up_s),
            stages: stages(pair),
            dropped: own.dropped,
            left_out: own.left_out,
            n_points: last.map_or(0, |last| last.n_points),
            n_agree: pair.points.back().and_then(|points| points.agree),
            no_pose: last.and_then(|last| last.reason.clone()),
            rms_px: estimate.map(|e| e.rms_px),
            ambiguity: estimate.map(ambiguity),
            pose: estimate.map(|e| pose(&e.cam_from_target, &e.covariance)),
            spread: spread(pair),
            points: pair.points.iter().map(|p| [count(p.found), p.agree.map_or(-1, count)]).collect(),
        })
    }
}

fn count(n: usize) -> i64 {
    i64::try_from(n).unwrap_or(i64::MAX)
}

fn halves(of: &Vector6) -> [[f64; 3]; 2] {
    [[of[0], of[1], of[2]], [of[3], of[4], of[5]]]
}

fn stages(pair: &PairBoard) -> Vec<StageView> {
    let stage = |(name, times): (&'static str, &Rolling)| StageView {
        name,
        median_us: times.quantile(0.5),
        p99_us: times.quantile(0.99),
    };
    let all = [
        ("waited", &pair.waited_us),
        ("detect", &pair.detect_us),
        ("solve", &pair.solve_us),
        ("decide", &pair.decide_us),
        ("latency", &pair.latency_us),
    ];
    all.into_iter().map(stage).collect()
}

fn ambiguity(estimate: &PoseEstimate) -> AmbiguityView {
    let (is_ambiguous, ratio) = match estimate.ambiguity {
        Ambiguity::Unique { ratio } => (false, ratio),
        Ambiguity::Ambiguous { ratio, .. } => (true, Some(ratio)),
    };
    AmbiguityView { is_ambiguous, probability: estimate.probability, ratio: ratio.filter(|r| r.is_finite()) }
}

fn pose(cam_from_target: &resight::core::Pose, covariance: &resight::core::Matrix6) -> PoseView {
    PoseView {
        position_m: cam_from_target.origin().into(),
        sigma_m: position_sigma_m(cam_from_target, covariance).into(),
        yaw_pitch_roll_rad: yaw_pitch_roll_rad(cam_from_target),
        rotation_sigma_rad: sigmas(covariance).0,
    }
}

fn spread(pair: &PairBoard) -> SpreadView {
    let sigma = pair.spread.sigma().map(|sigma| halves(&sigma));
    let (rotation_rad, translation_m) = sigma.map(|[r, t]| (r, t)).unzip();
    SpreadView { n: pair.spread.len(), rotation_rad, translation_m }
}

impl ReferenceView {
    pub(super) fn all(board: &Board, camera: usize) -> Vec<Self> {
        let one = |at: usize| {
            let pair = &board.pairs[at];
            let both = pair.earlier.zip(pair.reference);
            ReferenceView {
                target: board.names.target(board.names.of_pair(at).1).to_owned(),
                reference: pair.reference.as_ref().map(dated),
                earlier: pair.earlier.as_ref().map(dated),
                now: pair.present().map(|now| motion(&now)),
                changed: both.map(|(old, new)| motion(&Present::between(&old.reference, &new.reference))),
            }
        };
        board.pairs_of(camera).map(one).collect()
    }
}

fn dated(learnt: &Learnt) -> DatedPose {
    let reference = &learnt.reference;
    DatedPose { pose: pose(&reference.a_from_b, &reference.noise.reference), unix_s: learnt.unix_s }
}

fn motion(of: &Present) -> MotionView {
    let [rotation_rad, translation_m] = halves(&of.old_from_new);
    let [rotation_sigma_rad, translation_sigma_m] = halves(&of.sigma());
    MotionView { rotation_rad, rotation_sigma_rad, translation_m, translation_sigma_m, words: of.words() }
}

impl StripView {
    pub(super) fn new(stretch: &Stretch, bins: Vec<StripBin>, is_from_history: bool) -> Self {
        let bin = |b: StripBin| BinView { from_s: b.from_s, state: b.state, rotation_rad: b.rotation_rad };
        let bins = bins.into_iter().map(bin).collect();
        StripView { from_s: stretch.from_s, to_s: stretch.to_s, is_from_history, bins }
    }
}

impl LogLine {
    pub(super) fn all(board: &Board) -> Vec<Self> {
        let line = |reported: &resight_watch::board::Reported| LogLine {
            unix_s: reported.line.unix_s,
            camera: reported.camera.map(|camera| board.names.camera(camera).to_owned()),
            text: reported.line.text.clone(),
        };
        board.reported.iter().map(line).collect()
    }
}
