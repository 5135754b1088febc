//! What a contact by elliptic integrals costs: cargo bench -p resight-whisker --bench contact
//!
//! Every iteration takes 64 loads of the whole working range in turn (frictionless bends of 3° to 85°, friction, tips), so that no branch
//! is learnt by heart; times are those of 64 contacts, throughput is per contact.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use resight_whisker::contact::{Method, closed_form, contact_in_hub, contact_with_derivatives, curved};
use resight_whisker::estimate::estimate;
use resight_whisker::{Cell, HubLoad, PlanarPose, Rod, Sample};
use std::hint::black_box;

const LENGTH_M: f64 = 0.25;
const EI_N_M2: f64 = 0.009817477042468105;

/// Loads whose first zero lies between 0.4 L and the tip: a force of up to 1.4 N, friction angles up to 25°.
fn loads() -> Vec<HubLoad> {
    let mut found = Vec::new();
    for k in 0_u32.. {
        // A low-discrepancy walk through force, direction and moment.
        let share = |step: f64| (f64::from(k) * step).fract();
        if found.len() == 64 {
            break;
        }
        let force = 0.05 + 1.35 * share(0.754877666);
        let angle = 1.6 + 1.4 * share(0.569840291);
        let (fx_n, fy_n) = (force * angle.cos(), force * angle.sin());
        let load = HubLoad { fx_n, fy_n, mz_n_m: 0.2 * share(0.333333333 + 0.0049) * force.sqrt() };
        if let Ok(at) = closed_form::straight(EI_N_M2, &load)
            && (0.4 * LENGTH_M..LENGTH_M).contains(&at.s_m)
            && at.friction_angle_rad.abs() < 0.44
        {
            found.push(load);
        }
    }
    found
}

fn bench(c: &mut Criterion) {
    let rod = Rod::uniform(LENGTH_M, EI_N_M2).expect("a rod");
    let loads = loads();
    let cell = Cell {
        force_sigma_n: 0.003125,
        torque_sigma_n_m: 1.5625e-5,
        hub_xy_sigma_m: 1e-5,
        hub_angle_step_rad: 3.8e-4,
        ..Cell::default()
    };
    let world_from_hub = PlanarPose { x_m: 0.1, y_m: -0.2, angle_rad: 1.1 };
    let samples: Vec<Sample> =
        loads.iter().map(|load| Sample { load: *load, world_from_hub, ..Sample::default() }).collect();
    let mut group = c.benchmark_group("contact");
    group.throughput(Throughput::Elements(loads.len() as u64));
    group.bench_function("straight", |b| {
        b.iter(|| each(&loads, |load| contact_in_hub(&rod, load, Method::Auto)))
    });
    group.bench_function("straight, with derivatives", |b| {
        b.iter(|| each(&loads, |load| contact_with_derivatives(&rod, load, Method::Auto)))
    });
    group.bench_function("straight, estimate with covariance", |b| {
        b.iter(|| each(&samples, |sample| estimate(&rod, &cell, sample, Method::Auto)))
    });
    group.bench_function("curved", |b| b.iter(|| each(&loads, |load| curved::contact(EI_N_M2, 0.5, load))));
    group.bench_function("curved, with derivatives", |b| {
        b.iter(|| each(&loads, |load| curved::contact_with_derivatives(EI_N_M2, 0.5, load)))
    });
    group.finish();
}

/// Every answer is made and none is looked at.
fn each<T, Answer>(inputs: &[T], answer: impl Fn(&T) -> Answer) {
    for input in inputs {
        black_box(answer(black_box(input)));
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
