//! What holds at each sample of a run of contacts: sliding either way, sticking, at the tip. The cheapest path through the
//! samples, changes of role costing.

use super::node::{Instrument, Role};
use crate::HubContact;
use crate::contact::ByLoad;

/// What a change of role costs, in χ²: a role that lasts one sample must explain it by more than 3.5 standard deviations.
const CHANGE: f64 = 12.0;
/// What not to use friction costs per sample, in χ²: the mean of 1 of a friction angle that holds, plus what a free angle
/// is bound to gain over three samples in a row being off by two standard deviations.
const STICK: f64 = 5.0;
/// The roles in question.
pub const ROLES: [Role; 4] = [Role::Slides(1.0), Role::Slides(-1.0), Role::Sticks, Role::Tip];
/// The place of `Role::Tip` in `ROLES`.
const TIP: usize = 3;

/// Costs of the roles before a first contact: a run seldom begins at the tip, and its first contacts are too light to tell.
pub const FIRST: Costs = [0.0, 0.0, 0.0, CHANGE];

/// χ² of each of the roles for one sample.
pub type Costs = [f64; 4];

/// From the contact of the load as read, the friction angle known to `shared_variance`; a load without one says nothing, so all cost the same.
pub fn costs(
    with: &Instrument,
    raw: &Option<(HubContact, ByLoad)>,
    shared_rad: f64,
    shared_variance: f64,
) -> Costs {
    let Some((at, by_load)) = raw else { return [0.0, 0.0, 0.0, 0.0] };
    let (friction, place) = (by_load.row(4).norm_squared(), by_load.row(3).norm_squared());
    let chi2 = |sign: f64| (at.friction_angle_rad - sign * shared_rad).powi(2) / (friction + shared_variance);
    let beyond = at.s_m - with.rod.length_m;
    // Between clamp and tip also means not beyond the tip.
    let inside = beyond.max(0.0).powi(2) / place;
    [chi2(1.0) + inside, chi2(-1.0) + inside, STICK + inside, beyond * beyond / place]
}

/// The best role of every sample and the probability that tip or not is right, from the best paths either way.
pub fn decide(costs: &[Costs], friction: bool) -> Vec<(Role, f64)> {
    let forward = accumulate(costs.iter());
    let mut backward = accumulate(costs.iter().rev());
    backward.reverse();
    (0..costs.len())
        .map(|i| {
            let through: Costs = std::array::from_fn(|r| forward[i][r] + backward[i][r] - costs[i][r]);
            let mid = through[..TIP].iter().copied().fold(f64::INFINITY, f64::min);
            let margin = (mid - through[TIP]).abs();
            (cheapest(&through, friction), 1.0 / (1.0 + (-0.5 * margin).exp()))
        })
        .collect()
}

/// Cost of the cheapest path up to and including each sample, by its last role.
fn accumulate<'a>(costs: impl Iterator<Item = &'a Costs>) -> Vec<Costs> {
    let mut path: Costs = [0.0; 4];
    costs
        .map(|own| {
            path = extend(&path, own);
            path
        })
        .collect()
}

/// Costs of the cheapest paths, one sample longer.
pub fn extend(path: &Costs, own: &Costs) -> Costs {
    let cheapest = path.iter().copied().fold(f64::INFINITY, f64::min);
    // Only differences count: the sum does not grow with the record.
    std::array::from_fn(|r| own[r] + (path[r] - cheapest).min(CHANGE))
}

/// The cheapest role; without friction both directions of sliding are one, the first.
pub fn cheapest(costs: &Costs, friction: bool) -> Role {
    let best = (0..ROLES.len())
        .filter(|&r| friction || r != 1)
        .fold(0, |a, b| if costs[b] < costs[a] { b } else { a });
    ROLES[best]
}
