//! Contacts of a file of loads, with their cost: `bench_contact LENGTH_M EI_BASE_N_M2 TAPER closed|integrate < loads.csv`.
//!
//! Reads lines `fx,fy,mz` (N, N, N·m, hub frame; a header is skipped). Prints `x,y,s,theta` of each contact (m, m, m, rad; empty
//! fields where there is none), then `# ns_per_contact,VALUE` and `# ns_with_derivatives,VALUE`: the fastest of some rounds over
//! all loads, of one thread.

use resight_whisker::contact::{Method, contact_in_hub, contact_with_derivatives, integrate};
use resight_whisker::rod::{IntrinsicCurvature, Stiffness};
use resight_whisker::{HubLoad, Rod};
use std::error::Error;
use std::hint::black_box;
use std::io::BufRead;
use std::time::Instant;

const ROUNDS: usize = 20;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [length, ei, taper, method] = arguments.as_slice() else {
        return Err("usage: bench_contact LENGTH_M EI_BASE_N_M2 TAPER closed|integrate < loads.csv".into());
    };
    let rod = rod(length.parse()?, ei.parse()?, taper.parse()?)?;
    let loads = loads()?;
    let integrated = method == "integrate";
    for load in &loads {
        let at = if integrated {
            integrate::contact(&rod, load)
        } else {
            contact_in_hub(&rod, load, Method::Auto)
        };
        match at {
            Ok(at) => {
                println!("{:e},{:e},{:e},{:e}", at.x_in_hub.x, at.x_in_hub.y, at.s_m, at.theta_rad)
            }
            Err(_) => println!(",,,"),
        }
    }
    let (plain, full) = if integrated {
        (
            fastest_ns(&loads, |load| integrate::contact(&rod, load).is_ok()),
            fastest_ns(&loads, |load| integrate::contact_with_derivatives(&rod, load).is_ok()),
        )
    } else {
        (
            fastest_ns(&loads, |load| contact_in_hub(&rod, load, Method::Auto).is_ok()),
            fastest_ns(&loads, |load| contact_with_derivatives(&rod, load, Method::Auto).is_ok()),
        )
    };
    println!("# ns_per_contact,{plain:.1}\n# ns_with_derivatives,{full:.1}");
    Ok(())
}

fn rod(length_m: f64, ei_n_m2: f64, taper: f64) -> Result<Rod, Box<dyn Error>> {
    let stiffness = if taper == 0.0 {
        Stiffness::Uniform { ei_n_m2 }
    } else {
        Stiffness::Taper { ei_base_n_m2: ei_n_m2, taper }
    };
    let rod = Rod {
        length_m,
        stiffness,
        intrinsic_curvature: IntrinsicCurvature::Constant { per_m: 0.0 },
        diameters_m: [0.0, 0.0],
    };
    rod.check()?;
    Ok(rod)
}

fn loads() -> Result<Vec<HubLoad>, Box<dyn Error>> {
    let mut loads = Vec::new();
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let numbers: Result<Vec<f64>, _> = line.split(',').map(|field| field.trim().parse()).collect();
        match numbers.as_deref() {
            Ok(&[fx_n, fy_n, mz_n_m]) => loads.push(HubLoad { fx_n, fy_n, mz_n_m }),
            _ if loads.is_empty() => {}
            _ => return Err(format!("not three numbers: {line}").into()),
        }
    }
    Ok(loads)
}

fn fastest_ns(loads: &[HubLoad], contact: impl Fn(&HubLoad) -> bool) -> f64 {
    let round = || {
        let start = Instant::now();
        for load in loads {
            black_box(contact(black_box(load)));
        }
        start.elapsed().as_nanos() as f64 / loads.len() as f64
    };
    (0..ROUNDS).map(|_| round()).fold(f64::INFINITY, f64::min)
}
