//! States merge exactly: any order, any grouping, the same bits.

use crate::support::{day, solver};
use proptest::prelude::*;
use resight_fleet::batch::SolvedRows;
use resight_fleet::solve::{Numbers, ViewColumns};
use resight_fleet::{FleetState, Solver};
use std::sync::OnceLock;

/// Rows of four cameras, solved; some of them poison, some without a time.
fn rows() -> &'static SolvedRows {
    static ROWS: OnceLock<SolvedRows> = OnceLock::new();
    ROWS.get_or_init(|| {
        let fleet = day(4, 6.0, 40.0, 7);
        let solver: Solver = solver(&fleet);
        let (mut camera, mut time_s, mut values) = (Vec::new(), Vec::new(), Vec::new());
        for tick in 0..fleet.simulation.ticks() {
            for (number, one) in fleet.cameras.iter().enumerate() {
                let Some((t_s, pixels)) = one.row(&fleet.simulation, tick) else { continue };
                camera.push(number as u32);
                time_s.push(if tick % 97 == 5 { f64::NAN } else { t_s });
                values.extend(pixels.iter().flat_map(|p| [p.x, p.y]));
                if tick % 89 == 3 {
                    values.pop();
                    values.push(f64::INFINITY);
                }
            }
        }
        let pixels = Numbers::Rows { values: &values, width: 8 };
        let answers = solver.solve(&ViewColumns { camera: &camera, pixels, points_m: None, sigma_px: None });
        SolvedRows { names: solver.cameras.names().to_vec(), camera, time_s, view: None, answers }
    })
}

/// Those rows whose number is in a part.
fn part(of: &[usize], number: usize) -> SolvedRows {
    let all = rows();
    let kept: Vec<usize> = (0..all.camera.len()).filter(|row| of[row % of.len()] == number).collect();
    let mut answers = resight_fleet::answers::Answers::new(kept.len());
    for (to, from) in kept.iter().enumerate() {
        answers.status[to] = all.answers.status[*from];
        for (mine, theirs) in answers.numbers.iter_mut().zip(&all.answers.numbers) {
            mine[to] = theirs[*from];
        }
    }
    SolvedRows {
        names: all.names.clone(),
        camera: kept.iter().map(|row| all.camera[*row]).collect(),
        time_s: kept.iter().map(|row| all.time_s[*row]).collect(),
        view: None,
        answers,
    }
}

fn state(rows: &SolvedRows) -> FleetState {
    let state = FleetState::new(900.0);
    state.add(rows);
    state
}

fn merged(a: FleetState, b: FleetState) -> FleetState {
    a.merge(b).expect("states of one period")
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    /// (A ∪ B) ∪ C, A ∪ (B ∪ C), C ∪ (B ∪ A) and all rows at once are one state.
    #[test]
    fn merge_is_associative_and_commutative(of in prop::collection::vec(0_usize..3, 5..200)) {
        let [a, b, c] = [0, 1, 2].map(|number| part(&of, number));
        let left = merged(merged(state(&a), state(&b)), state(&c)).into_cameras();
        let right = merged(state(&a), merged(state(&b), state(&c))).into_cameras();
        let reversed = merged(state(&c), merged(state(&b), state(&a))).into_cameras();
        let whole = state(rows()).into_cameras();
        prop_assert!(left == right && left == reversed && left == whole);
    }
}

#[test]
fn states_of_other_periods_do_not_mix() {
    assert!(FleetState::new(900.0).merge(FleetState::new(60.0)).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    /// Bytes hold a state whole, whatever the order of its rows; parts of single cameras are the state again.
    #[test]
    fn states_travel_as_bytes(of in prop::collection::vec(0_usize..2, 5..60)) {
        let [a, b] = [0, 1].map(|number| part(&of, number));
        let (ab, ba) = (merged(state(&a), state(&b)), merged(state(&b), state(&a)));
        let bytes = ab.to_bytes();
        prop_assert_eq!(&bytes, &ba.to_bytes());
        let again = FleetState::from_bytes(&bytes).expect("a state");
        let parts = FleetState::new(900.0);
        for (_, part) in ab.split() {
            parts.absorb(FleetState::from_bytes(&part).expect("a part")).expect("one period");
        }
        let cameras = ab.into_cameras();
        prop_assert!(again.into_cameras() == cameras && parts.into_cameras() == cameras);
    }
}

/// Bytes cut anywhere, or turned over, are refused or are another state; never a panic, never memory for what is not there.
#[test]
fn damaged_bytes_are_refused() {
    let bytes = state(rows()).to_bytes();
    for cut in (0..bytes.len()).step_by(7) {
        assert!(FleetState::from_bytes(&bytes[..cut]).is_err(), "cut at {cut}");
    }
    for at in (0..bytes.len()).step_by(11) {
        let mut other = bytes.clone();
        other[at] ^= 0x80;
        let _ = FleetState::from_bytes(&other);
    }
}
