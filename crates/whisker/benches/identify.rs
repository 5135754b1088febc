//! Identification of some 300 contacts, three sweeps: every class, and the worst case (a polygon, which tries chains of corners).

#[allow(dead_code)] // The tests use the rest.
#[path = "../tests/identify_support/mod.rs"]
mod identify_support;

use criterion::{Criterion, criterion_group, criterion_main};
use identify_support::{Chance, How, felt, object, readings};
use resight_core::statistics::SplitMix64;
use resight_whisker::friction::Mu;
use resight_whisker::identify::{Class, Config, identify};

fn classes(c: &mut Criterion) {
    let mut chance = Chance(SplitMix64::new(3));
    for class in [Class::Circle, Class::Ellipse, Class::Square, Class::Rectangle, Class::Polygon] {
        let samples = readings(&object(class, &mut chance), 0.3).expect("sweeps").concat();
        let touches = felt(&samples, How::Constrained(Mu::Auto), 1);
        let config = Config::default();
        let used = identify(&touches, &config).expect("an answer").coverage.used;
        c.bench_function(&format!("identify {class:?}, {used} contacts used"), |b| {
            b.iter(|| identify(&touches, &config));
        });
    }
}

criterion_group!(benches, classes);
criterion_main!(benches);
