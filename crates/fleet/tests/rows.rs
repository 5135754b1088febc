//! Rows: each answers as `locate` does, poison stays where it is.

use crate::support::{day, solver};
use resight::core::locate::{Config, locate};
use resight::core::{Correspondence, Pixel};
use resight::report::verdict::Status;
use resight_fleet::cameras::UNKNOWN;
use resight_fleet::solve::{Numbers, Solver, ViewColumns};

fn views(solver: &Solver, n: usize) -> (Vec<u32>, Vec<f64>) {
    let fleet = day(12, 24.0, 60.0, 4);
    assert_eq!(solver.cameras.len(), 12);
    let (mut camera, mut values) = (Vec::new(), Vec::new());
    for tick in 0..fleet.simulation.ticks() {
        for (number, one) in fleet.cameras.iter().enumerate() {
            if let Some((_, pixels)) = one.row(&fleet.simulation, tick).filter(|_| camera.len() < n) {
                camera.push(number as u32);
                values.extend(pixels.iter().flat_map(|p| [p.x, p.y]));
            }
        }
    }
    (camera, values)
}

#[test]
fn every_row_answers_as_locate_does() {
    let solver = solver(&day(12, 24.0, 60.0, 4));
    let (camera, values) = views(&solver, 1500);
    let pixels = Numbers::Rows { values: &values, width: 8 };
    let answers = solver.solve(&ViewColumns { camera: &camera, pixels, points_m: None, sigma_px: None });
    for row in 0..camera.len() {
        let (lens, points) =
            (&solver.cameras.cameras()[camera[row] as usize], solver.cameras.points(camera[row]));
        let one = |k: usize| {
            let pixel = Pixel::new(values[8 * row + 2 * k], values[8 * row + 2 * k + 1]);
            Correspondence::new(lens, points.expect("points")[k], pixel, solver.sigma_px).expect("a point")
        };
        let alone = locate(&(0..4).map(one).collect::<Vec<_>>(), lens, &Config::default()).expect("a pose");
        let (pose, covariance) = answers.pose(row).expect("a pose");
        let off = (alone.cam_from_target * pose.inverse()).log();
        let factor = covariance.cholesky().expect("a covariance");
        assert!(off.dot(&factor.solve(&off)) < 1e-10, "row {row} is off by {off}");
        assert!((alone.chi2 - answers.numbers[29][row]).abs() < 1e-6 * (1.0 + alone.chi2), "row {row}");
    }
}

/// A row whose four points come twice answers as the four points do, and one that holds a point twice as the three points do.
#[test]
fn equal_points_of_a_row_count_once() {
    let solver = solver(&day(12, 24.0, 60.0, 4));
    let (camera, values) = views(&solver, 12);
    let points: Vec<f64> = camera
        .iter()
        .flat_map(|c| solver.cameras.points(*c).expect("points"))
        .flat_map(|p| [p.x, p.y, p.z])
        .collect();
    let chosen = |columns: &[usize]| {
        let pick = |values: &[f64], width: usize| -> Vec<f64> {
            let rows = values.chunks(4 * width);
            rows.flat_map(|row| columns.iter().flat_map(|k| row[k * width..(k + 1) * width].to_vec()))
                .collect()
        };
        let (pixels, points) = (pick(&values, 2), pick(&points, 3));
        let of = |values, each| Numbers::Rows { values, width: each * columns.len() };
        let points_m = Some(of(&points[..], 3));
        solver.solve(&ViewColumns { camera: &camera, pixels: of(&pixels[..], 2), points_m, sigma_px: None })
    };
    for (once, repeated) in [(&[0, 1, 2, 3][..], &[0, 1, 2, 3, 0, 1, 2, 3][..]), (&[0, 1, 2], &[0, 1, 2, 1])]
    {
        let (a, b) = (chosen(once), chosen(repeated));
        for row in 0..camera.len() {
            assert_eq!(a.status[row], b.status[row], "row {row}");
            let (Some((pose, covariance)), Some((other, its))) = (a.pose(row), b.pose(row)) else { continue };
            let off = (pose * other.inverse()).log();
            assert!(off.norm() < 1e-6, "row {row} is off by {off}");
            assert!((covariance - its).amax() < 1e-3 * covariance.amax(), "row {row}");
        }
    }
}

/// Poison of every kind has its status and reason; all other rows keep every bit.
#[test]
fn poison_leaves_its_neighbours_alone() {
    let solver = solver(&day(12, 24.0, 60.0, 4));
    let (mut camera, mut values) = views(&solver, 900);
    let answers = |camera: &[u32], values: &[f64]| {
        let pixels = Numbers::Rows { values, width: 8 };
        solver.solve(&ViewColumns { camera, pixels, points_m: None, sigma_px: None })
    };
    let clean = answers(&camera, &values);
    let poison = [f64::NAN, f64::INFINITY, -1e300, 1e61];
    for (i, value) in poison.iter().enumerate() {
        values[8 * (7 + 100 * i) + i] = *value;
    }
    camera[555] = UNKNOWN;
    camera[666] = 12;
    let dirty = answers(&camera, &values);
    for row in 0..camera.len() {
        let is_poison = [7, 107, 207, 307, 555, 666].contains(&row);
        assert_eq!(
            dirty.reasons.contains_key(&(row as u32)),
            is_poison || clean.reasons.contains_key(&(row as u32))
        );
        if is_poison {
            assert_eq!(dirty.status[row], Status::Error, "row {row}");
            assert!(dirty.numbers.iter().all(|column| column[row] == 0.0));
        } else {
            let same = |k: usize| dirty.numbers[k][row].to_bits() == clean.numbers[k][row].to_bits();
            assert!(dirty.status[row] == clean.status[row] && (0..31).all(same), "row {row}");
        }
    }
}
