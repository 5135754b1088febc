//! Times the solver family in one process, for `benches/peers`: `bench_family JOB GIVEN ANSWERED N_POINTS [SIGMA_PX [THRESHOLD_PX]]`.
//!
//! GIVEN and ANSWERED are files of little-endian doubles, a record per problem. Minimal solvers take n origins, n bearings and n
//! points; `refine` and `locate` a pose to start from (rotation row by row, translation; `locate` ignores it) and n rows
//! x, y, z, u, v; the camera is that of `scenes.py`. A record of the answer is as many poses as the solver has at most, NaN where there are fewer.
//! Every problem is timed once a round, so that branches are as unpredictable as in use; of its rounds the fastest counts.
//! Prints one JSON object: median and mean over problems, the clock's own cost taken off, in nanoseconds.

use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Unit, Vector2, Vector3};
use resight_core::camera::{CameraMatrix, Pinhole};
use resight_core::locate::refine::refine;
use resight_core::locate::{Config, locate};
use resight_core::robust::{self, consensus};
use resight_core::solve::gp3p::{Ray, gp3p};
use resight_core::solve::p3p::p3p;
use resight_core::solve::upright_gp2p::upright_gp2p;
use resight_core::solve::upright_p2p::upright_p2p;
use resight_core::{Bearing, Camera, Correspondence, Lens, Point, Pose};
use std::error::Error;
use std::hint::black_box;
use std::time::Instant;

/// As many as `solvers.py` gives the others.
const ROUNDS: usize = 3;

type Failure = Box<dyn Error>;

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [job, given, answered, n_points, options @ ..] = arguments.as_slice() else {
        return Err("usage: bench_family JOB GIVEN ANSWERED N_POINTS [SIGMA_PX [THRESHOLD_PX]]".into());
    };
    let numbers: Vec<f64> = std::fs::read(given)?
        .chunks_exact(8)
        .map(|bytes| f64::from_le_bytes(bytes.try_into().expect("eight bytes")))
        .collect();
    let options = options.iter().map(|x| x.parse()).collect::<Result<Vec<f64>, _>>()?;
    let run = Run { numbers, n: n_points.parse()?, answered, options };
    match job.as_str() {
        "p3p" => run.minimal(4, |_, b, x: &[Point; 3]| p3p(b, x)),
        "upright_p2p" => {
            run.minimal(4, |_, b, x: &[Point; 2]| upright_p2p(b, x, &UP, &UP).unwrap_or_default())
        }
        "gp3p" => run.minimal(8, |o, b, x: &[Point; 3]| gp3p(&rays(o, b), x)),
        "upright_gp2p" => run.minimal(2, |o, b, x: &[Point; 2]| upright_gp2p(&rays(o, b), x, &UP, &UP)),
        "refine" => run.points(|start, seen, camera| Ok(refine(start, seen, camera)?.cam_from_target)),
        "locate" => {
            run.points(|_, seen, camera| Ok(locate(seen, camera, &Config::default())?.cam_from_target))
        }
        "robust" => {
            let threshold_px = *run.options.get(1).ok_or("threshold_px is missing")?;
            let config = robust::Config::with_threshold_px(threshold_px);
            run.points(|_, seen, camera| Ok(consensus(seen, camera, &config)?.estimate.cam_from_target))
        }
        other => Err(format!("no such job: {other}").into()),
    }
}

/// Up in both frames: `scenes.py` turns upright problems about the y axis.
const UP: Unit<Vector3<f64>> = Unit::new_unchecked(Vector3::new(0.0, 1.0, 0.0));

fn rays<const N: usize>(origins: &[Point; N], bearings: &[Bearing; N]) -> [Ray; N] {
    std::array::from_fn(|i| Ray { origin_in_rig: origins[i], bearing_in_rig: bearings[i] })
}

struct Run<'a> {
    numbers: Vec<f64>,
    n: usize,
    answered: &'a str,
    options: Vec<f64>,
}

impl Run<'_> {
    fn minimal<const N: usize, C: AsRef<[Pose]>>(
        &self,
        most: usize,
        solve: impl Fn(&[Point; N], &[Bearing; N], &[Point; N]) -> C,
    ) -> Result<(), Failure> {
        let vectors = |numbers: &[f64]| -> [Point; N] {
            std::array::from_fn(|i| Point::from_column_slice(&numbers[3 * i..3 * i + 3]))
        };
        let problem = |record: &[f64]| {
            let [origins, bearings, points] = [0, 1, 2].map(|k| vectors(&record[3 * N * k..]));
            (origins, bearings.map(Unit::new_normalize), points)
        };
        let problems: Vec<_> = self.numbers.chunks_exact(9 * N).map(problem).collect();
        self.timed(&problems, most, |(origins, bearings, points)| solve(origins, bearings, points))
    }

    fn points(
        &self,
        solve: impl Fn(&Pose, &[Correspondence], &Camera) -> Result<Pose, Failure>,
    ) -> Result<(), Failure> {
        let matrix = CameraMatrix { fx_px: 1000.0, fy_px: 1000.0, cx_px: 639.5, cy_px: 479.5 };
        let camera = Camera { lens: Lens::Pinhole(Pinhole::new(matrix)?), size: None };
        let sigma_px = *self.options.first().ok_or("sigma_px is missing")?;
        let mut problems = Vec::new();
        for record in self.numbers.chunks_exact(12 + 5 * self.n) {
            let start =
                Pose::new(Matrix3::from_row_slice(&record[..9]), Vector3::from_column_slice(&record[9..12]));
            let seen = record[12..]
                .chunks_exact(5)
                .map(|c| {
                    Correspondence::new(
                        &camera,
                        Point::new(c[0], c[1], c[2]),
                        Vector2::new(c[3], c[4]),
                        sigma_px,
                    )
                })
                .collect::<Result<Vec<_>, _>>()?;
            problems.push((start, seen));
        }
        self.timed(&problems, 1, |(start, seen)| {
            solve(start, seen, &camera).into_iter().collect::<ArrayVec<_, 1>>()
        })
    }

    /// Times `solve` on every problem, writes its poses and prints its figures.
    fn timed<P, C: AsRef<[Pose]>>(
        &self,
        problems: &[P],
        most: usize,
        solve: impl Fn(&P) -> C,
    ) -> Result<(), Failure> {
        let mut clock_ns = u128::MAX;
        let mut times_ns = vec![u128::MAX; problems.len()];
        let mut bytes = Vec::new();
        for round in 0..ROUNDS {
            for (problem, best) in problems.iter().zip(&mut times_ns) {
                let start = Instant::now();
                clock_ns = start.elapsed().as_nanos().min(clock_ns);
                let start = Instant::now();
                let poses = black_box(solve(black_box(problem)));
                *best = start.elapsed().as_nanos().min(*best);
                if round == 0 {
                    write(poses.as_ref(), most, &mut bytes);
                }
            }
        }
        std::fs::write(self.answered, bytes)?;
        times_ns.iter_mut().for_each(|t| *t = t.saturating_sub(clock_ns));
        times_ns.sort_unstable();
        let median_ns = times_ns[times_ns.len() / 2];
        let mean_ns = times_ns.iter().sum::<u128>() / times_ns.len() as u128;
        println!("{{\"median_ns\": {median_ns}, \"mean_ns\": {mean_ns}, \"clock_ns\": {clock_ns}}}");
        Ok(())
    }
}

fn write(poses: &[Pose], most: usize, bytes: &mut Vec<u8>) {
    for k in 0..most {
        let numbers: Vec<f64> = match poses.get(k) {
            Some(pose) => pose.rotation.transpose().iter().chain(pose.translation.iter()).copied().collect(),
            None => vec![f64::NAN; 12],
        };
        numbers.iter().for_each(|x| bytes.extend(x.to_le_bytes()));
    }
}
