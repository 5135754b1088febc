//! The six data sets, where RESIGHT_DATA names the folder that holds `whisker/`.

use crate::recorded::recorded;
use resight_whisker::rod::{IntrinsicCurvature, Stiffness};
use resight_whisker::{Cell, HubLoad, PlanarPose, Rod, Sample};
use std::path::Path;

/// The names of the sets.
pub const SETS: [&str; 6] = [
    "f1_square_00",
    "f2_square_30",
    "f3_circle_r25",
    "f4_circle_r25_mu03",
    "f5_taper_ellipse",
    "f6_slipoff_peg",
];

/// A row of `truth.csv`.
#[derive(Debug, Clone)]
pub struct Truth {
    pub contact: bool,
    pub x_m: f64,
    pub y_m: f64,
    pub s_m: f64,
    pub theta_rad: f64,
    pub force_world_n: [f64; 2],
    pub friction_angle_rad: f64,
    pub mode: String,
}

/// One set: the whisker, the instruments, the readings without and with noise, the truth row by row.
pub struct Set {
    pub name: &'static str,
    pub rod: Rod,
    pub cell: Cell,
    pub clean: Vec<Sample>,
    pub noisy: Vec<Sample>,
    pub truth: Vec<Truth>,
}

/// All six, in that order.
pub fn sets() -> Vec<Set> {
    let root = recorded("whisker");
    SETS.iter().map(|name| read(name, &root.join(name))).collect()
}

fn read(name: &'static str, folder: &Path) -> Set {
    let meta: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(folder.join("meta.json")).expect("meta.json"))
            .expect("JSON");
    let number = |value: &serde_json::Value| value.as_f64().expect("a number");
    let (whisker, noise) = (&meta["whisker"], &meta["sensor"]["noise"]);
    let [base, tip] = ["diameter_base_m", "diameter_tip_m"].map(|key| number(&whisker[key]));
    let ei = number(&whisker["EI_base_Nm2"]);
    let stiffness = if base == tip {
        Stiffness::Uniform { ei_n_m2: ei }
    } else {
        Stiffness::Taper { ei_base_n_m2: ei, taper: 1.0 - tip / base }
    };
    let rod = Rod {
        length_m: number(&whisker["length_m"]),
        stiffness,
        intrinsic_curvature: IntrinsicCurvature::Constant {
            per_m: number(&whisker["intrinsic_curvature_1_per_m"]),
        },
        diameters_m: [0.0, 0.0],
    };
    let steps = &noise["quantised_to_LSB"];
    let cell = Cell {
        force_sigma_n: number(&noise["force_sigma_N"]),
        torque_sigma_n_m: number(&noise["torque_sigma_Nm"]),
        hub_angle_sigma_rad: 0.0,
        hub_xy_sigma_m: number(&noise["hub_xy_sigma_m"]),
        force_step_n: number(&steps["force_N"]),
        torque_step_n_m: number(&steps["torque_Nm"]),
        hub_angle_step_rad: number(&steps["hub_angle_rad"]),
    };
    let samples = |file: &str| rows(&folder.join(file)).iter().map(sample).collect::<Vec<_>>();
    let truth = rows(&folder.join("truth.csv")).iter().map(truth_row).collect();
    Set { name, rod, cell, clean: samples("measured_clean.csv"), noisy: samples("measured_noisy.csv"), truth }
}

fn rows(path: &Path) -> Vec<csv::StringRecord> {
    let mut reader = csv::Reader::from_path(path).expect("a CSV file");
    reader.records().map(|row| row.expect("a row")).collect()
}

fn sample(row: &csv::StringRecord) -> Sample {
    let v = |i: usize| row[i].parse::<f64>().expect("a number");
    Sample {
        sweep: v(0) as u32,
        sample: v(1) as u32,
        t_s: Some(v(2)),
        world_from_hub: PlanarPose { angle_rad: v(3), x_m: v(4), y_m: v(5) },
        load: HubLoad { fx_n: v(6), fy_n: v(7), mz_n_m: v(8) },
    }
}

fn truth_row(row: &csv::StringRecord) -> Truth {
    let v = |i: usize| row[i].parse::<f64>().expect("a number");
    Truth {
        contact: &row[2] == "1",
        x_m: v(3),
        y_m: v(4),
        s_m: v(5),
        theta_rad: v(6),
        force_world_n: [v(7), v(8)],
        friction_angle_rad: v(9),
        mode: row[10].to_string(),
    }
}
