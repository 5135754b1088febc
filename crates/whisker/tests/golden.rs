//! Contacts beside a table to 50 digits (docs/math/check/whisker_contact_table.py).

use nalgebra::SVector;
use resight_whisker::contact::{ByLoad, NoZero, closed_form, curved};
use resight_whisker::{HubContact, HubLoad};

type Found = Result<(HubContact, ByLoad), NoZero>;

fn numbers(table: &str) -> Vec<Vec<f64>> {
    let row = |line: &str| line.split(',').map(|v| v.parse().expect("a number")).collect();
    table.lines().skip(1).map(row).collect()
}

fn straight() -> Vec<([f64; 2], HubLoad, SVector<f64, 5>)> {
    numbers(include_str!("contact_tables/straight.csv"))
        .iter()
        .map(|v| ([v[0], 0.0], HubLoad { fx_n: v[1], fy_n: v[2], mz_n_m: v[3] }, expected(&v[4..])))
        .collect()
}

fn bent() -> Vec<([f64; 2], HubLoad, SVector<f64, 5>)> {
    numbers(include_str!("contact_tables/curved.csv"))
        .iter()
        .map(|v| ([v[0], v[1]], HubLoad { fx_n: v[2], fy_n: v[3], mz_n_m: v[4] }, expected(&v[5..])))
        .collect()
}

/// The table's x, y, θ, s, friction angle.
fn expected(v: &[f64]) -> SVector<f64, 5> {
    SVector::from_column_slice(v)
}

/// Worst error as a multiple of what it may be: of rounding in the answer (lengths relative to the arc length, angles to 1 rad) and of
/// what a rounding of each input in its last digit moves it by, which no formula can avoid.
fn worst(rows: &[([f64; 2], HubLoad, SVector<f64, 5>)], solve: impl Fn([f64; 2], &HubLoad) -> Found) -> f64 {
    let mut worst = 0.0_f64;
    for (rod, load, expected) in rows {
        let (at, by_load) = solve(*rod, load).unwrap_or_else(|why| panic!("{rod:?} {load:?}: {why:?}"));
        let inputs = load.to_vector().abs() * f64::EPSILON;
        let moved = by_load.abs() * inputs;
        let size = [at.s_m, at.s_m, 1.0, at.s_m, 1.0];
        for i in 0..5 {
            let allowed = f64::EPSILON * size[i] + moved[i];
            let share = (at.to_vector()[i] - expected[i]).abs() / allowed;
            if worst < share {
                println!("row {i}: {share:.1} at {rod:?} {load:?}");
                worst = share;
            }
        }
    }
    worst
}

/// 2 roundings are seen; 8 leave room for other machines' libraries of functions.
#[test]
fn straight_contacts_match_a_50_digit_table() {
    let rows = straight();
    assert!(90 < rows.len());
    let worst = worst(&rows, |[ei, _], load| closed_form::straight_with_derivatives(ei, load));
    println!("straight: {worst:.1} roundings");
    assert!(worst < 8.0, "{worst}");
}

#[test]
fn curved_contacts_match_a_50_digit_table() {
    let rows = bent();
    assert!(400 < rows.len());
    let worst = worst(&rows, |[ei, kappa], load| curved::contact_with_derivatives(ei, kappa, load));
    println!("curved: {worst:.1} roundings");
    assert!(worst < 8.0, "{worst}");
}

/// The form for curved rods, given no curvature, is the straight one.
#[test]
fn no_curvature_joins_the_straight_form() {
    let rows = straight();
    let worst = worst(&rows, |[ei, _], load| curved::contact_with_derivatives(ei, 0.0, load));
    println!("curved form of straight rods: {worst:.1} roundings");
    assert!(worst < 8.0, "{worst}");
}
