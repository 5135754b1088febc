//! Times `solve_rig` in one process, for `benches/peers`: `bench_rig SCENE.csv ROUNDS [squared]`;
//! `squared` takes every point as it is.
//!
//! The file is that of `rig_scenes.py`: the noise, a row `c` a camera (size, matrix, Brown distortion), a row `s` a point (camera,
//! view, point in the target, pixel). Prints one JSON object: the fastest round, every camera's pose as rows of `[R | t]`, its largest
//! standard deviations.

use nalgebra::Vector2;
use resight_core::camera::{BrownConrady, CameraMatrix, ImageSize};
use resight_core::locate::loss::Loss;
use resight_core::multiview::rig::{Observation, RigConfig, RigProblem, RigSolution, solve_rig};
use resight_core::{Camera, Correspondence, Lens, Point};
use std::collections::BTreeMap;
use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

struct Scene {
    cameras: Vec<Camera>,
    n_views: usize,
    observations: Vec<Observation>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (path, rounds, loss) = match arguments.as_slice() {
        [path, rounds] => (path, rounds, RigConfig::default().loss),
        [path, rounds, word] if word == "squared" => (path, rounds, Loss::Squared),
        _ => return Err("usage: bench_rig SCENE.csv ROUNDS [squared]".into()),
    };
    let config = RigConfig { loss, ..RigConfig::default() };
    let scene = read(&std::fs::read_to_string(path)?)?;
    let problem = RigProblem {
        cameras: &scene.cameras,
        body_of_target: &[0],
        n_views: scene.n_views,
        observations: &scene.observations,
    };
    let (mut best_s, mut answer) = (f64::INFINITY, None);
    for _ in 0..rounds.parse::<usize>()?.max(1) {
        let start = Instant::now();
        let solution = solve_rig(black_box(&problem), &config)?;
        best_s = start.elapsed().as_secs_f64().min(best_s);
        answer = Some(solution);
    }
    let answer = answer.ok_or("no round")?;
    println!("{}", as_json(best_s, &answer));
    Ok(())
}

fn as_json(seconds: f64, answer: &RigSolution) -> String {
    let pose = |c: &resight_core::multiview::rig::CameraInRig| format!("{:?}", &c.cam_from_rig.matrix()[..3]);
    let poses: Vec<String> = answer.cameras.iter().map(pose).collect();
    format!(
        "{{\"seconds\": {seconds}, \"n_seen\": {}, \"n_used\": {}, \"steps\": {}, \"rms_px\": {}, \"cam_from_rig\": [{}]}}",
        answer.n_seen,
        answer.n_used,
        answer.steps,
        answer.rms_px,
        poses.join(", ")
    )
}

fn read(text: &str) -> Result<Scene, Box<dyn Error>> {
    let (mut sigma_px, mut cameras, mut n_views) = (1.0, Vec::new(), 0);
    let mut seen: BTreeMap<(usize, usize), Vec<Correspondence>> = BTreeMap::new();
    for line in text.lines() {
        let (kind, rest) = line.split_once(',').ok_or("an empty row")?;
        let numbers = rest.split(',').map(str::parse).collect::<Result<Vec<f64>, _>>()?;
        match (kind, numbers.as_slice()) {
            ("sigma_px", &[sigma]) => sigma_px = sigma,
            ("c", &[width, height, fx_px, fy_px, cx_px, cy_px, ref distortion @ ..]) => {
                let matrix = CameraMatrix { fx_px, fy_px, cx_px, cy_px };
                let size = ImageSize { width_px: width as u32, height_px: height as u32 };
                let lens = Lens::BrownConrady(BrownConrady::new(matrix, distortion)?);
                cameras.push(Camera { lens, size: Some(size) });
            }
            ("s", &[camera, view, x, y, z, u, v]) => {
                let (camera, view) = (camera as usize, view as usize);
                let lens = cameras.get(camera).ok_or("cameras come before points")?;
                let c = Correspondence::new(lens, Point::new(x, y, z), Vector2::new(u, v), sigma_px)?;
                seen.entry((view, camera)).or_default().push(c);
                n_views = n_views.max(view + 1);
            }
            _ => return Err(format!("not understood: {line}").into()),
        }
    }
    let observations = seen
        .into_iter()
        .map(|((view, camera), seen)| Observation { camera, view, target: 0, seen })
        .collect();
    Ok(Scene { cameras, n_views, observations })
}
