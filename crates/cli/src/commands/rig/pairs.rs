//! `rig --pairs`: the cameras of a rig from the relative poses of pairs of them.

use super::placed::PlacedObject;
use super::solving::Unsolved;
use super::{RigOutputArgs, named, unanswered};
use crate::args::positive;
use crate::output::{Outcome, print};
use crate::text::line;
use anyhow::{Result, bail};
use clap::Args;
use resight::core::pose_graph::{
    Chain, PairResult, PairSigma, PoseGraph, PoseGraphConfig, PoseGraphSolution, chain, groups,
    solve_pose_graph,
};
use resight::core::{Matrix6, Pose};
use resight::formats::{NamedCamera, Placement, own_file, write_atomically};
use resight::report::words::{degrees, length};
use resight::rig::RIG_FRAME;
use resight::rig::pairs::{PairFile, read_pairs};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A rig from pairs.
#[derive(Debug, Args)]
pub struct PairsArgs {
    /// Relative poses of pairs of cameras instead of points: columns a,b,qw,qx,qy,qz,x_m,y_m,z_m (x_in_b = b_from_a · x_in_a) and
    /// sigma_deg,sigma_mm, or rmse, or neither; or Caliscope's stereograph JSON. With -o and no --camera the file holds places only.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["images", "detections", "targets", "reference"])]
    pub pairs: Option<PathBuf>,
    /// The camera whose frame is the rig's [default: the first by name]
    #[arg(long, value_name = "NAME", requires = "pairs")]
    anchor: Option<String>,
    /// Every camera by the chain of pairs whose errors add up to least, instead of all pairs weighed together.
    #[arg(long, requires = "pairs")]
    chain: bool,
    /// Standard deviation of the turn of a pair of median rmse [default: from how well the pairs agree]
    #[arg(long, value_name = "DEG", requires = "pairs", requires = "pair_sigma_mm", value_parser = positive)]
    pair_sigma_deg: Option<f64>,
    /// Standard deviation of the shift of a pair of median rmse.
    #[arg(long, value_name = "MM", requires = "pairs", requires = "pair_sigma_deg", value_parser = positive)]
    pair_sigma_mm: Option<f64>,
}

#[derive(Serialize)]
struct GraphObject {
    status: &'static str,
    method: &'static str,
    reference: String,
    cameras: BTreeMap<String, PlaceObject>,
    pairs: Vec<PairObject>,
    /// Pairs that contradict the others, as `a-b`.
    suspicious: Vec<String>,
    chi2: Option<f64>,
    dof: Option<usize>,
    noise_scale: Option<f64>,
    median_sigma_rad: Option<f64>,
    median_sigma_m: Option<f64>,
    message: String,
}

#[derive(Serialize)]
struct PlaceObject {
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

/// See `PairsArgs`; `cameras` are the lenses that go into the written file, by name.
pub fn run(
    args: &PairsArgs,
    path: &Path,
    cameras: &[NamedCamera],
    output: &RigOutputArgs,
) -> Result<Outcome> {
    crate::files::must_exist(path)?;
    let file = read_pairs(path)?;
    let anchor = match &args.anchor {
        None => 0,
        Some(name) => match file.cameras.iter().position(|camera| camera == name) {
            Some(found) => found,
            None => bail!("--anchor {name}: {}", named::not_among(name, "camera", &file.cameras)),
        },
    };
    let graph = PoseGraph { n_cameras: file.cameras.len(), pairs: &file.pairs };
    if let Some(reason) = falls_apart(&graph, &file) {
        return unanswered(output, &reason);
    }
    let placed = match placed(args, &graph, anchor) {
        Ok(placed) => placed,
        Err(reason) => {
            let message = reason.to_string();
            return unanswered(output, &Unsolved { status: "error", message, groups: Vec::new() });
        }
    };
    if let Some(out) = &output.output {
        write_atomically(out, written(&file, &placed, cameras)?.as_bytes())?;
    }
    let object = object(&file, anchor, &placed);
    match output.json {
        true => print(&format!("{}\n", serde_json::to_string(&object)?))?,
        false => print(&words(&file, &placed, &object))?,
    }
    Ok(Outcome::Answered)
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

fn placed(args: &PairsArgs, graph: &PoseGraph, anchor: usize) -> Result<Placed, resight::core::Error> {
    if args.chain {
        let Chain { cameras, .. } = chain(graph, anchor)?;
        let cam_from_rig = cameras.iter().map(|c| (c.cam_from_rig, c.covariance)).collect();
        let paths = cameras.into_iter().map(|c| c.path).collect();
        return Ok(Placed { cam_from_rig, paths: Some(paths), solution: None });
    }
    let sigma = args.pair_sigma_deg.zip(args.pair_sigma_mm);
    let median_sigma = sigma.map(|(deg, mm)| PairSigma { sigma_rad: deg.to_radians(), sigma_m: 1e-3 * mm });
    let solution = solve_pose_graph(graph, &PoseGraphConfig { anchor, median_sigma })?;
    let cam_from_rig = solution.cameras.iter().map(|c| (c.cam_from_rig, Some(c.covariance))).collect();
    Ok(Placed { cam_from_rig, paths: None, solution: Some(solution) })
}

fn object(file: &PairFile, anchor: usize, placed: &Placed) -> GraphObject {
    let name = |i: usize| file.cameras[i].clone();
    let place = |(i, (cam_from_rig, covariance)): (usize, &(Pose, Option<Matrix6>))| {
        let path = placed.paths.as_ref().map(|paths| paths[i].iter().map(|i| name(*i)).collect());
        let cam_from_rig = PlacedObject::of(cam_from_rig, covariance.as_ref());
        (name(i), PlaceObject { cam_from_rig, path })
    };
    let pairs = pairs(file, placed);
    let suspicious: Vec<String> =
        pairs.iter().filter(|p| p.is_suspicious).map(|p| format!("{}-{}", p.a, p.b)).collect();
    let s = placed.solution.as_ref();
    let sigma = s.and_then(|s| s.median_sigma);
    GraphObject {
        status: "ok",
        method: if s.is_some() { "joint" } else { "chain" },
        reference: name(anchor),
        cameras: placed.cam_from_rig.iter().enumerate().map(place).collect(),
        message: message(file, placed, &suspicious),
        pairs,
        suspicious,
        chi2: s.map(|s| s.chi2),
        dof: s.map(|s| s.degrees_of_freedom),
        noise_scale: s.map(|s| s.noise_scale),
        median_sigma_rad: sigma.map(|s| s.sigma_rad),
        median_sigma_m: sigma.map(|s| s.sigma_m),
    }
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
    let mut out = format!("RIG   {}\n\n", object.message);
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
        return Ok(toml::to_string(&PlacesOnly { relation: places })?);
    }
    let placed = |(i, name): (usize, &String)| match cameras.iter().find(|camera| &camera.name == name) {
        Some(camera) => Ok(NamedCamera { placement: Some(placement(i)), ..camera.clone() }),
        None => {
            let names: Vec<String> = cameras.iter().map(|camera| camera.name.clone()).collect();
            bail!("--camera: {}", named::not_among(name, "camera", &names))
        }
    };
    let all: Vec<NamedCamera> = file.cameras.iter().enumerate().map(placed).collect::<Result<_>>()?;
    Ok(own_file(&all)?)
}

/// `[[relation]]` tables of our own file: no lens is known. `convert` joins them with files that have lenses.
#[derive(Serialize)]
struct PlacesOnly {
    relation: Vec<PlaceOnly>,
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
            covariance: placement.covariance.as_ref().map(crate::answer::rows),
        }
    }
}
