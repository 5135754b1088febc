//! The sentry of a rig on four real webcams and a hand-held board: quiet while nothing moves, and a turned camera is named.

mod real_support;

use nalgebra::{DMatrix, Vector3};
use real_support::{number, pixel_of, point_of, real_data, table};
use resight::core::correspondence::Correspondence;
use resight::core::locate::{Config, PoseEstimate, locate};
use resight::core::monitor::learn::LearnConfig;
use resight::core::monitor::rig::{
    Glance, RigMoment, RigMonitor, RigReference, learn_rig, learn_sight_noise,
};
use resight::core::monitor::{MonitorConfig, Watch};
use resight::core::{Camera, Matrix6, Pose, Vector6};
use resight::rig::places::placed;
use std::collections::BTreeMap;
use std::path::Path;

/// Stated for corners of a webcam's board.
const SIGMA_PX: f64 = 0.5;

/// What one camera saw of the board.
#[derive(Clone)]
struct Seen {
    camera: usize,
    points: Vec<Correspondence>,
}

struct Recording {
    lenses: Vec<Camera>,
    cam_from_rig: Vec<Pose>,
    /// By sync index: mean capture time, and what was seen.
    moments: Vec<(f64, Vec<Seen>)>,
}

fn recording(folder: &Path) -> Recording {
    let file = resight::formats::read_cameras(&folder.join("camera_array.toml")).unwrap();
    let lenses: Vec<Camera> = file.cameras.iter().map(|camera| camera.camera.clone()).collect();
    let cam_from_rig = placed(&file.cameras).unwrap().iter().map(|camera| camera.cam_from_rig).collect();
    let mut times: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
    for row in table(&folder.join("timestamps.csv")) {
        times.entry(number(&row, "sync_index") as usize).or_default().push(number(&row, "frame_time"));
    }
    let mut seen: BTreeMap<(usize, usize), Vec<Correspondence>> = BTreeMap::new();
    for row in table(&folder.join("detections.csv")) {
        let camera = number(&row, "cam") as usize;
        let key = (number(&row, "sync_index") as usize, camera);
        let c = Correspondence::new(&lenses[camera], point_of(&row), pixel_of(&row), SIGMA_PX).unwrap();
        seen.entry(key).or_default().push(c);
    }
    let moment = |(index, times): (&usize, &Vec<f64>)| {
        let of = seen.range((*index, 0)..(*index + 1, 0));
        let seen = of.map(|((_, camera), points)| Seen { camera: *camera, points: points.clone() }).collect();
        (times.iter().sum::<f64>() / times.len() as f64, seen)
    };
    let moments = times.iter().map(moment).collect();
    Recording { lenses, cam_from_rig, moments }
}

/// A camera turned about its own centre: where it now sees what it saw.
fn turned(points: &[Correspondence], lens: &Camera, old_from_new: &Pose) -> Vec<Correspondence> {
    let turn = |c: &Correspondence| {
        let bearing = old_from_new.rotation.transpose() * c.bearing.into_inner();
        let pixel = lens.project(&bearing)?;
        Correspondence::new(lens, c.x_in_target, pixel, SIGMA_PX).ok()
    };
    points.iter().filter_map(turn).collect()
}

impl Recording {
    fn located(&self, turn: Option<(usize, usize, Pose)>) -> Vec<(f64, Vec<(Seen, PoseEstimate)>)> {
        let of = |(i, (t_s, seen)): (usize, &(f64, Vec<Seen>))| {
            let seen = seen.iter().filter_map(|seen| {
                let lens = &self.lenses[seen.camera];
                let points = match &turn {
                    Some((camera, from, pose)) if *camera == seen.camera && *from <= i => {
                        turned(&seen.points, lens, pose)
                    }
                    _ => seen.points.clone(),
                };
                let estimate = locate(&points, lens, &Config::default()).ok()?;
                Some((Seen { camera: seen.camera, points }, estimate))
            });
            (*t_s, seen.collect())
        };
        self.moments.iter().enumerate().map(of).collect()
    }
}

fn moments<'a>(lenses: &'a [Camera], located: &'a [(f64, Vec<(Seen, PoseEstimate)>)]) -> Vec<RigMoment<'a>> {
    let of = |(t_s, seen): &'a (f64, Vec<(Seen, PoseEstimate)>)| RigMoment {
        t_s: *t_s,
        glances: seen
            .iter()
            .map(|(seen, estimate)| Glance {
                camera: seen.camera,
                target: 0,
                lens: &lenses[seen.camera],
                seen: &seen.points,
                estimate,
            })
            .collect(),
    };
    located.iter().map(of).collect()
}

fn lasting() -> LearnConfig {
    LearnConfig { bias: Matrix6::zeros(), bias_time_s: 1.0, daily: Matrix6::zeros() }
}

#[test]
fn explore() {
    let Some(folder) = real_data("caliscope_4cam_charuco") else { return };
    let recording = recording(&folder);
    let located = recording.located(None);
    let all = moments(&recording.lenses, &located);
    let noise = learn_sight_noise(&recording.cam_from_rig, &all, &lasting());
    for n in &noise {
        println!("file, all: white {:.2} lasting {:.2} time {:.2}", n.white, n.lasting, n.lasting_time_s);
    }
    for m in &all {
        for g in &m.glances {
            if !matches!(g.estimate.consistency, resight::core::consistency::Consistency::Consistent) {
                println!("inconsistent {} {:.2}", g.camera, g.estimate.rms_px);
            }
        }
    }
    let learned = learn_rig(&recording.lenses, &all[..20], &lasting()).unwrap();
    for (n, p) in learned.noise.iter().zip(&learned.cam_from_rig) {
        println!("learned 20: white {:.2} lasting {:.2} time {:.2}", n.white, n.lasting, n.lasting_time_s);
        let base = learned.cam_from_rig[0];
        let _ = (p, base);
    }
    for i in 0..4 {
        println!(
            "sigma {:?}",
            (0..6)
                .map(|k| learned.covariance[(6 * i + k, 6 * i + k)].sqrt())
                .map(|s| format!("{s:.5}"))
                .collect::<Vec<_>>()
        );
        let mine = learned.cam_from_rig[i];
        let file = recording.cam_from_rig[i] * recording.cam_from_rig[0].inverse();
        println!(
            "file vs learned {:.3}° {:.2} mm",
            mine.angle_to_rad(&file).to_degrees(),
            (mine.translation - file.translation).norm() * 1e3
        );
    }
    for (name, reference) in [
        ("learned", learned.clone()),
        (
            "file",
            RigReference {
                cam_from_rig: recording.cam_from_rig.clone(),
                covariance: DMatrix::identity(24, 24) * 1e-6,
                noise: noise.clone(),
            },
        ),
    ] {
        let start = if name == "file" { 0 } else { 20 };
        let mut sentry = RigMonitor::new(&reference, &MonitorConfig::default(), all[start].t_s).unwrap();
        for m in &all[start..] {
            sentry.push(m);
            println!(
                "{name} {:.2} cams {:?} {}",
                m.t_s,
                m.glances.iter().map(|g| g.camera).collect::<Vec<_>>(),
                sentry.debug()
            );
        }
        for camera in 0..4 {
            for axis in 0..3 {
                for at in [start + 3, start + 8, start + 15, start + 20] {
                    for sign in [5.0f64, -5.0] {
                        let mut w = Vector6::zeros();
                        w[axis] = sign.to_radians();
                        let located = recording.located(Some((camera, at, Pose::exp(&w))));
                        let all = moments(&recording.lenses, &located);
                        let mut sentry =
                            RigMonitor::new(&reference, &MonitorConfig::default(), all[start].t_s).unwrap();
                        let mut found = None;
                        let mut wrong = vec![];
                        for (i, m) in all.iter().enumerate().skip(start) {
                            sentry.push(m);
                            let moved = sentry.moved();
                            if found.is_none()
                                && moved.rivals.is_empty()
                                && moved.moved.len() == 1
                                && moved.moved[0].node == camera
                            {
                                found = Some(i + 1 - at);
                            }
                            if !moved.moved.is_empty()
                                && (moved.moved.len() != 1 || moved.moved[0].node != camera)
                            {
                                wrong.push((
                                    i + 1 - at,
                                    moved.moved.iter().map(|m| m.node).collect::<Vec<_>>(),
                                    moved.rivals.clone(),
                                ));
                            }
                        }
                        let last = sentry.moved();
                        println!(
                            "{name} cam {camera} axis {axis} {sign} at {at}: found {found:?} wrong {wrong:?} end {:?}",
                            last.moved
                                .iter()
                                .map(|m| (
                                    m.node,
                                    (m.old_from_new[axis].to_degrees() * 100.0).round() / 100.0
                                ))
                                .collect::<Vec<_>>()
                        );
                    }
                }
            }
        }
    }
    let _ = Vector3::<f64>::zeros();
    let _ = Watch::Steady;
}
