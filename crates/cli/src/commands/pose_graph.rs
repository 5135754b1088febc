//! `pose-graph`: the cameras of a rig from the relative poses of pairs of them.

use super::rig::object::JointObject;
use super::rig::placed::PlacedObject;
use super::rig::solving::Unsolved;
use super::rig::{AnswerArgs, named, outcome, stated, unanswered};
use crate::args::positive;
use crate::output::{Outcome, print};
use crate::text::line;
use anyhow::{Result, bail};
use clap::Args;
use resight::core::pose_graph::{
    Chain, GraphFault, PairResult, PairSigma, PoseGraph, PoseGraphConfig, PoseGraphSolution, chain, groups,
    solve_pose_graph,
};
use resight::core::{Matrix6, Pose};
use resight::formats::{JointCovariance, NamedCamera, Placement, own_rig_file, write_atomically};
use resight::report::verdict::Status;
use resight::report::words::{degrees, length};
use resight::rig::RIG_FRAME;
use resight::rig::pairs::{PairFile, read_pairs};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// The poses of several cameras in one frame, from the relative poses of pairs of them.
///
/// All pairs are weighed together; pairs that contradict the others are named. Without stated sigmas the noise of a pair is estimated
/// from how well loops of pairs close.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  resight pose-graph pairs.csv --reference cam1 -o rig.toml
  resight pose-graph stereograph.json --reference 8 --chain --json")]
pub struct PoseGraphArgs {
    /// Relative poses of pairs of cameras: columns a,b,qw,qx,qy,qz,x_m,y_m,z_m (x_in_b = b_from_a · x_in_a) and
    /// sigma_deg,sigma_mm, or rmse, or neither; or Caliscope's stereograph JSON.
    #[arg(value_name = "PAIRS")]
    pairs: PathBuf,
    /// Camera files whose intrinsics go into the file of -o, which holds poses only without them. Without NAME= every camera of the
    /// file under its own name.
    #[arg(long = "camera", value_name = "[NAME=]FILE", num_args = 1..)]
    cameras: Vec<String>,
    /// The camera whose frame is the rig's [default: the first by name]
    #[arg(long, value_name = "NAME")]
    reference: Option<String>,
    /// Every camera by the chain of pairs whose errors add up to least, instead of all pairs weighed together.
    #[arg(long)]
    chain: bool,
    /// Standard deviation of the rotation of a pair of median rmse [default: from how well the pairs agree]
    #[arg(long, value_name = "DEG", requires = "pair_sigma_mm", value_parser = positive)]
    pair_sigma_deg: Option<f64>,
    /// Standard deviation of the translation of a pair of median rmse.
    #[arg(long, value_name = "MM", requires = "pair_sigma_deg", value_parser = positive)]
    pair_sigma_mm: Option<f64>,
    /// Adds the covariance of all cameras together to the JSON, as `compare` uses it (the file of -o always holds it).
    #[arg(long)]
    joint_covariance: bool,
    #[command(flatten)]
    output: AnswerArgs,
}

#[derive(Serialize)]
struct GraphObject {
    status: &'static str,
    /// What contradicts, and the likely cause; null where nothing does.
    contradiction: Option<String>,
    method: &'static str,
    reference: String,
    cameras: BTreeMap<String, PlaceObject>,
    pairs: Vec<PairObject>,
    /// Pairs that contradict the others, as `a-b`.
    suspicious: Vec<String>,
    chi2: Option<f64>,
    degrees_of_freedom: Option<usize>,
    noise_scale: Option<f64>,
    median_sigma_rad: Option<f64>,
    median_sigma_m: Option<f64>,
    /// Of each of the two, where they were estimated; null where they were given.
    noise_degrees_of_freedom: Option<usize>,
    /// With --joint-covariance; a chain has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    joint_covariance: Option<JointObject>,
    message: String,
}

#[derive(Serialize)]
struct PlaceObject {
    status: &'static str,
    #[serde(flatten)]
    cam_from_rig: PlacedObject,
    /// The cameras on the way from the reference, for a chain.
    #[serde(skip_serializing_if = "Option::is_none")]
    path: Option<Vec<String>>,
}

#[derive(Serialize)]
struct PairObject {
    a: String,
    b: String,
    residual_rad: f64,
    residual_m: f64,
    redundancy: Option<f64>,
    disagreement_sigma: Option<f64>,
    is_used: bool,
    is_suspicious: bool,
}

/// What either way of solving says.
struct Placed {
    cam_from_rig: Vec<(Pose, Option<Matrix6>)>,
    paths: Option<Vec<Vec<usize>>>,
    solution: Option<PoseGraphSolution>,
}

/// See `PoseGraphArgs`.
pub fn run(args: &PoseGraphArgs) -> Result<Outcome> {
    if let Some(path) = &args.output.output {
        crate::files::must_be_writable(path)?;
    }
    crate::files::must_exist(&args.pairs)?;
    let (cameras, remarks) = named::cameras_alone(&args.cameras)?;
    if !args.output.quiet {
        remarks.iter().for_each(|text| eprintln!("{text}"));
    }
    let file = read_pairs(&args.pairs)?;
    let reference = match &args.reference {
        None => 0,
        Some(name) => match file.cameras.iter().position(|camera| camera == name) {
            Some(found) => found,
            None => bail!("--reference {name}: {}", named::not_among(name, "camera", &file.cameras)),
        },
    };
    let graph = PoseGraph { n_cameras: file.cameras.len(), pairs: &file.pairs };
    if let Some(reason) = falls_apart(&graph, &file) {
        return unanswered(&args.output, &reason);
    }
    let placed = match placed(args, &graph, reference) {
        Ok(placed) => placed,
        Err(reason) => {
            let message = reason.to_string();
            return unanswered(&args.output, &Unsolved { status: "error", message, groups: Vec::new() });
        }
    };
    let contradiction = contradiction(&file, &placed);
    if let Some(out) = &args.output.output {
        let text = stated(&written(&file, &placed, &cameras)?, contradiction.clone());
        write_atomically(out, text.as_bytes())?;
    }
    let is_inconsistent = contradiction.is_some();
    let mut object = object(&file, reference, &placed, contradiction);
    if args.joint_covariance {
        let joint = sure(&placed).map(|s| &s.joint_covariance);
        object.joint_covariance = joint.map(|matrix| JointObject::of(file.cameras.clone(), matrix));
    }
    match args.output.json {
        true => print(&format!("{}\n", serde_json::to_string(&object)?))?,
        false => print(&words(&file, &placed, &object))?,
    }
    Ok(outcome(is_inconsistent))
}

/// Groups of cameras that no chain of pairs joins, by name.
fn falls_apart(graph: &PoseGraph, file: &PairFile) -> Option<Unsolved> {
    let groups = groups(graph);
    if groups.len() < 2 {
        return None;
    }
    let name = |i: &usize| file.cameras[*i].clone();
    let groups: Vec<Vec<String>> = groups.iter().map(|group| group.iter().map(name).collect()).collect();
    let said: Vec<String> = groups.iter().map(|group| format!("[{}]", group.join(", "))).collect();
    let message = format!(
        "no chain of pairs joins the cameras {}; add a pair between a camera of one group and a camera of another",
        said.join(" and ")
    );
    Some(Unsolved { status: "not_connected", message, groups })
}

fn placed(args: &PoseGraphArgs, graph: &PoseGraph, anchor: usize) -> Result<Placed, resight::core::Error> {
    if args.chain {
        let Chain { cameras, .. } = chain(graph, anchor)?;
        let cam_from_rig = cameras.iter().map(|c| (c.cam_from_rig, c.covariance)).collect();
        let paths = cameras.into_iter().map(|c| c.path).collect();
        return Ok(Placed { cam_from_rig, paths: Some(paths), solution: None });
    }
    let sigma = args.pair_sigma_deg.zip(args.pair_sigma_mm);
    let median_sigma = sigma.map(|(deg, mm)| PairSigma { sigma_rad: deg.to_radians(), sigma_m: 1e-3 * mm });
    let solution = solve_pose_graph(graph, &PoseGraphConfig { anchor, median_sigma })?;
    // Without a loop nothing says how sure the pairs are.
    let is_sure = solution.noise_degrees_of_freedom != Some(0);
    let cam_from_rig =
        solution.cameras.iter().map(|c| (c.cam_from_rig, is_sure.then_some(c.covariance))).collect();
    Ok(Placed { cam_from_rig, paths: None, solution: Some(solution) })
}

/// The joint answer, where loops or stated sigmas say how sure it is.
fn sure(placed: &Placed) -> Option<&PoseGraphSolution> {
    placed.solution.as_ref().filter(|s| s.noise_degrees_of_freedom != Some(0))
}

fn object(file: &PairFile, reference: usize, placed: &Placed, contradiction: Option<String>) -> GraphObject {
    let name = |i: usize| file.cameras[i].clone();
    let verdict = placed.solution.as_ref().map(|s| &s.verdict);
    let place = |(i, (cam_from_rig, covariance)): (usize, &(Pose, Option<Matrix6>))| {
        let path = placed.paths.as_ref().map(|paths| paths[i].iter().map(|i| name(*i)).collect());
        let cam_from_rig = PlacedObject::of(cam_from_rig, covariance.as_ref());
        let is_contradicted =
            verdict.is_some_and(|v| v.is_contradicted[i] || (v.fault.is_some() && v.worst_camera == Some(i)));
        let status = if is_contradicted { Status::Inconsistent } else { Status::Ok }.name();
        (name(i), PlaceObject { status, cam_from_rig, path })
    };
    let pairs = pairs(file, placed);
    let suspicious: Vec<String> =
        pairs.iter().filter(|p| p.is_suspicious).map(|p| format!("{}-{}", p.a, p.b)).collect();
    let s = placed.solution.as_ref();
    let sigma = s.and_then(|s| s.median_sigma);
    GraphObject {
        status: if contradiction.is_some() { Status::Inconsistent } else { Status::Ok }.name(),
        contradiction,
        method: if s.is_some() { "joint" } else { "chain" },
        reference: name(reference),
        cameras: placed.cam_from_rig.iter().enumerate().map(place).collect(),
        message: message(file, placed, &suspicious),
        pairs,
        suspicious,
        chi2: s.map(|s| s.chi2),
        degrees_of_freedom: s.map(|s| s.degrees_of_freedom),
        noise_scale: s.map(|s| s.noise_scale),
        median_sigma_rad: sigma.map(|s| s.sigma_rad),
        median_sigma_m: sigma.map(|s| s.sigma_m),
        noise_degrees_of_freedom: s.and_then(|s| s.noise_degrees_of_freedom),
        joint_covariance: None,
    }
}

/// Why the pairs cannot all be right, the worst camera and pair named; a chain checks nothing.
fn contradiction(file: &PairFile, placed: &Placed) -> Option<String> {
    let s = placed.solution.as_ref()?;
    let fault = s.verdict.fault?;
    let n_suspicious = s.pairs.iter().filter(|pair| pair.is_suspicious).count();
    let what = match fault {
        GraphFault::Noise => format!(
            "the pairs differ by {:.1} times what their stated sigmas say",
            (s.chi2 / s.degrees_of_freedom.max(1) as f64).sqrt()
        ),
        GraphFault::Pairs => format!("{n_suspicious} of {} pairs contradict the others", s.pairs.len()),
        GraphFault::Camera => "most pairs of a camera contradict the others".to_string(),
        _ => {
            let sigma = s.median_sigma?;
            format!(
                "loops of pairs do not close: the pairs differ by about {} and {}",
                degrees(sigma.sigma_rad),
                length(sigma.sigma_m)
            )
        }
    };
    let camera = s
        .verdict
        .worst_camera
        .map_or(String::new(), |c| format!("; camera {} disagrees most", file.cameras[c]));
    let pair = s.verdict.worst_pair.map(|i| &file.pairs[i]);
    let pair =
        pair.map_or(String::new(), |p| format!(", in pair {}-{}", file.cameras[p.a], file.cameras[p.b]));
    Some(format!(
        "{what}{camera}{pair}; poses the wrong way round, cameras exchanged, a unit or a wrong lens file are the likely cause"
    ))
}

/// Every pair's residual, in the order of the file.
fn pairs(file: &PairFile, placed: &Placed) -> Vec<PairObject> {
    let object = |(i, pair): (usize, &resight::core::pose_graph::RelativePose)| {
        let predicted = placed.cam_from_rig[pair.b].0 * placed.cam_from_rig[pair.a].0.inverse();
        let residual = (pair.b_from_a * predicted.inverse()).log();
        let result: Option<&PairResult> = placed.solution.as_ref().map(|s| &s.pairs[i]);
        PairObject {
            a: file.cameras[pair.a].clone(),
            b: file.cameras[pair.b].clone(),
            residual_rad: residual.fixed_rows::<3>(0).norm(),
            residual_m: residual.fixed_rows::<3>(3).norm(),
            redundancy: result.map(|r| r.redundancy),
            disagreement_sigma: result.and_then(|r| r.disagreement_sigma),
            is_used: result.is_none_or(|r| r.is_used),
            is_suspicious: result.is_some_and(|r| r.is_suspicious),
        }
    };
    file.pairs.iter().enumerate().map(object).collect()
}

fn message(file: &PairFile, placed: &Placed, suspicious: &[String]) -> String {
    let (n, m) = (file.cameras.len(), file.pairs.len());
    let how = match &placed.solution {
        None => "each camera by its best chain of pairs".to_string(),
        Some(s) => format!("all pairs together, {} degrees of freedom", s.degrees_of_freedom),
    };
    let contradicting = match suspicious {
        [] => String::new(),
        several => format!("; pairs that contradict others: {}", several.join(", ")),
    };
    format!("{n} cameras from {m} pairs, {how}{contradicting}")
}

fn words(file: &PairFile, placed: &Placed, object: &GraphObject) -> String {
    let mut out = match &object.contradiction {
        Some(sentence) => format!("INCONSISTENT   {sentence}.\n\n"),
        None => "OK   ".to_string(),
    };
    out.push_str(&format!("RIG   {}\n\n", object.message));
    for (name, (cam_from_rig, covariance)) in file.cameras.iter().zip(&placed.cam_from_rig) {
        let place = cam_from_rig.origin() * 1e3;
        let sigma = covariance.as_ref().filter(|c| 0.0 < c.trace()).map_or(String::new(), |c| {
            let (turn, shift) = resight::report::words::sigmas(c);
            let largest = |s: [f64; 3]| s.into_iter().fold(0.0, f64::max);
            format!("   ± {} and {}", degrees(largest(turn)), length(largest(shift)))
        });
        line(
            &mut out,
            name,
            &format!("x {:+.1}   y {:+.1}   z {:+.1} mm in the rig{sigma}", place.x, place.y, place.z),
        );
    }
    if let (Some(turn), Some(shift)) = (object.median_sigma_rad, object.median_sigma_m) {
        line(
            &mut out,
            "noise",
            &format!("a pair of median error is known to {} and {}", degrees(turn), length(shift)),
        );
    }
    let by_size = |a: &&PairObject, b: &&PairObject| {
        let size = |p: &PairObject| p.disagreement_sigma.unwrap_or(p.residual_rad);
        size(b).total_cmp(&size(a))
    };
    let mut worst: Vec<&PairObject> = object.pairs.iter().collect();
    worst.sort_by(by_size);
    for pair in worst.into_iter().take(5) {
        let verdict = match (pair.is_suspicious, pair.is_used) {
            (false, _) => "",
            (true, false) => "   SUSPICIOUS, left out",
            (true, true) => "   SUSPICIOUS: it or another of its loop",
        };
        let text = format!("{} and {} off{verdict}", degrees(pair.residual_rad), length(pair.residual_m));
        line(&mut out, &format!("{}-{}", pair.a, pair.b), &text);
    }
    out
}

/// Our own camera file where the lenses are known, else the places alone.
fn written(file: &PairFile, placed: &Placed, cameras: &[NamedCamera]) -> Result<String> {
    let placement = |i: usize| Placement {
        b: file.cameras[i].clone(),
        a: RIG_FRAME.to_string(),
        b_from_a: placed.cam_from_rig[i].0,
        covariance: placed.cam_from_rig[i].1,
    };
    if cameras.is_empty() {
        let places = (0..file.cameras.len()).map(|i| PlaceOnly::of(&placement(i))).collect();
        let joint_covariance = joint(file, placed).map(JointOnly::of);
        return Ok(toml::to_string(&PlacesOnly { relation: places, joint_covariance })?);
    }
    let joint = joint(file, placed);
    let placed = |(i, name): (usize, &String)| match cameras.iter().find(|camera| &camera.name == name) {
        Some(camera) => Ok(NamedCamera { placement: Some(placement(i)), ..camera.clone() }),
        None => {
            let names: Vec<String> = cameras.iter().map(|camera| camera.name.clone()).collect();
            bail!("--camera: {}", named::not_among(name, "camera", &names))
        }
    };
    let all: Vec<NamedCamera> = file.cameras.iter().enumerate().map(placed).collect::<Result<_>>()?;
    Ok(own_rig_file(&all, joint)?)
}

/// Of all cameras, where it is known.
fn joint(file: &PairFile, placed: &Placed) -> Option<JointCovariance> {
    sure(placed).map(|s| JointCovariance {
        noise_degrees_of_freedom: s.noise_degrees_of_freedom.map(|degrees| degrees as f64),
        ..JointCovariance::of(&file.cameras, &s.joint_covariance)
    })
}

/// `[[relation]]` tables of our own file: no lens is known. `convert` joins them with files that have lenses.
#[derive(Serialize)]
struct PlacesOnly {
    relation: Vec<PlaceOnly>,
    #[serde(skip_serializing_if = "Option::is_none")]
    joint_covariance: Option<JointOnly>,
}

/// `[joint_covariance]` of our own file.
#[derive(Serialize)]
struct JointOnly {
    cameras: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    noise_degrees_of_freedom: Option<f64>,
    /// The lower triangle, row by row.
    lower: Vec<Vec<f64>>,
}

impl JointOnly {
    fn of(joint: JointCovariance) -> Self {
        let lower = joint.rows().into_iter().enumerate().map(|(i, row)| row[..=i].to_vec()).collect();
        let JointCovariance { cameras, noise_degrees_of_freedom, .. } = joint;
        JointOnly { cameras, noise_degrees_of_freedom, lower }
    }
}

/// The keys of `[camera.placement]`.
#[derive(Serialize)]
struct PlaceOnly {
    b: String,
    a: String,
    rotation_wxyz: [f64; 4],
    translation_m: [f64; 3],
    #[serde(skip_serializing_if = "Option::is_none")]
    covariance: Option<[[f64; 6]; 6]>,
}

impl PlaceOnly {
    fn of(placement: &Placement) -> Self {
        PlaceOnly {
            b: placement.b.clone(),
            a: placement.a.clone(),
            rotation_wxyz: placement.b_from_a.quaternion_wxyz(),
            translation_m: placement.b_from_a.translation.into(),
            covariance: placement.covariance.as_ref().map(resight::answer::pose::rows),
        }
    }
}
