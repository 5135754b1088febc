// Where a bent whisker touches, from force and torque at its hub: `cargo run -p resight-whisker --example touch`.
use resight_whisker::contact::Method;
use resight_whisker::{Cell, HubLoad, Rod, Sample, estimate::estimate};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let rod = Rod::uniform(0.2, 0.0098)?; // 200 mm of steel wire of 1 mm; its stiffness in N·m².
    let cell = Cell { force_sigma_n: 5e-4, torque_sigma_n_m: 1e-5, ..Cell::default() };
    let load = HubLoad { fx_n: 0.0, fy_n: 0.05, mz_n_m: 0.005 };
    let found = estimate(&rod, &cell, &Sample { load, ..Sample::default() }, Method::Auto);
    let contact = found.contact.ok_or("no contact")?;
    let sigma_m = contact.covariance.diagonal().map(f64::sqrt);
    println!(
        "{:?}: x {:.4} m ± {:.4} m, y {:.4} m ± {:.4} m",
        found.status, contact.x_in_world.x, sigma_m.x, contact.x_in_world.y, sigma_m.y
    );
    Ok(())
}
