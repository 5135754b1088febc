//! What a contact by integration costs: cargo bench -p resight-whisker --bench integrate

use criterion::{Criterion, criterion_group, criterion_main};
use resight_whisker::contact::integrate;
use resight_whisker::rod::{IntrinsicCurvature, Stiffness};
use resight_whisker::{HubLoad, Rod};
use std::hint::black_box;

const LENGTH_M: f64 = 0.25;
const EI_N_M2: f64 = 0.0098;

fn rod(stiffness: Stiffness) -> Rod {
    Rod {
        length_m: LENGTH_M,
        stiffness,
        intrinsic_curvature: IntrinsicCurvature::Constant { per_m: 0.0 },
        diameters_m: [0.0, 0.0],
    }
}

/// Bends of some 5°, 40° and 80°, met at 0.5 to 0.9 L.
fn loads() -> [HubLoad; 3] {
    [[-0.003, 0.076, 0.0114], [-0.40, 0.47, 0.0885], [-1.28, 0.22, 0.1587]]
        .map(|[fx_n, fy_n, mz_n_m]| HubLoad { fx_n, fy_n, mz_n_m })
}

fn bench(c: &mut Criterion) {
    let uniform = rod(Stiffness::Uniform { ei_n_m2: EI_N_M2 });
    let cone = rod(Stiffness::Taper { ei_base_n_m2: 2.0 * EI_N_M2, taper: 2.0 / 3.0 });
    for (name, rod) in [("uniform", &uniform), ("taper", &cone)] {
        for (bend, load) in ["5deg", "40deg", "80deg"].iter().zip(loads()) {
            c.bench_function(&format!("{name}/{bend}/contact"), |b| {
                b.iter(|| integrate::contact(black_box(rod), black_box(&load)).expect("a contact"))
            });
            c.bench_function(&format!("{name}/{bend}/with_derivatives"), |b| {
                b.iter(|| {
                    integrate::contact_with_derivatives(black_box(rod), black_box(&load)).expect("a contact")
                })
            });
        }
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
