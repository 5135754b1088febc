//! A whisker calibrates a camera: what it touches is a point in the hub frame, what the camera sees of the touch is a pixel.
//!
//! `touch_meets_sight FOLDER > points.csv` reads `whisker.json` and `touches.csv` there (six hub signals and a pixel a row) and prints
//! points for `resight solve`, every one with its own sigma; touches whose signals do not fit one plane of bending stay out, with the
//! reason. `resight solve points.csv --camera FOLDER/camera.toml` then answers cam_from_hub (as `cam_from_target`: the
//! target frame is the hub's).
//!
//! `touch_meets_sight --simulate FOLDER` makes the input that is shipped as `testdata/whisker/touch_meets_sight`.

use nalgebra::{Matrix3, Rotation3, Vector3, Vector6};
use resight_core::Pose;
use resight_core::statistics::SplitMix64;
use resight_whisker::rod::{IntrinsicCurvature, Stiffness};
use resight_whisker::spatial::{SpatialContact, SpatialLoad, Verdict, estimate, load_covariance};
use resight_whisker::{Cell, Rod};
use std::error::Error;
use std::fmt::Write as _;
use std::path::Path;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// A reading of the cell while the camera sees where the whisker touches.
pub struct Touch {
    /// What the cell read.
    pub load: SpatialLoad,
    /// Where the camera sees the whisker's centre line at the touch, px.
    pub pixel: [f64; 2],
}

#[allow(dead_code)] // The test of the program includes this file for the rest.
fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
        ["--simulate", folder] => write_folder(Path::new(folder)),
        [folder] => {
            let (rod, cell, touches) = read_folder(Path::new(folder))?;
            print!("{HEADER}{}", points_csv("touch", &rod, &cell, &touches)?);
            Ok(())
        }
        _ => Err("usage: touch_meets_sight FOLDER, or touch_meets_sight --simulate FOLDER".into()),
    }
}

// ---- from touches to points

/// The columns of `points_csv`.
pub const HEADER: &str = "view,id,x_m,y_m,z_m,sigma_m,u_px,v_px\n";

/// One line a touch: a point, or a comment that says why not.
pub fn points_csv(view: &str, rod: &Rod, cell: &Cell, touches: &[Touch]) -> Result<String> {
    let mut text = String::new();
    for (id, touch) in touches.iter().enumerate() {
        let seen = estimate(rod, &touch.load, &load_covariance(cell))?;
        match (seen.verdict, seen.contact) {
            (Verdict::Planar, Some(contact)) => {
                let ([x, y, z], [u, v]) = (contact.x_in_hub.into(), touch.pixel);
                let sigma = sigma_m(&contact);
                writeln!(text, "{view},{id},{x:.7},{y:.7},{z:.7},{sigma:.7},{u:.3},{v:.3}")?;
            }
            (verdict, _) => writeln!(text, "# {view}, touch {id} left out: {verdict:?}")?,
        }
    }
    Ok(text)
}

/// The file has one sigma for all axes: that of equal total variance.
fn sigma_m(contact: &SpatialContact) -> f64 {
    (contact.covariance.trace() / 3.0).sqrt()
}

// ---- files

#[allow(dead_code)]
/// The whisker, its cell and the touches of a folder.
pub fn read_folder(folder: &Path) -> Result<(Rod, Cell, Vec<Touch>)> {
    let meta: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(folder.join("whisker.json"))?)?;
    let number = |path: &str| {
        meta.pointer(path).and_then(|v| v.as_f64()).ok_or(format!("whisker.json: no number at {path}"))
    };
    let rod = Rod {
        length_m: number("/whisker/length_m")?,
        stiffness: Stiffness::Uniform { ei_n_m2: number("/whisker/EI_base_Nm2")? },
        intrinsic_curvature: IntrinsicCurvature::Constant { per_m: 0.0 },
        diameters_m: [0.0, 0.0],
    };
    rod.check()?;
    let cell = Cell {
        force_sigma_n: number("/sensor/noise/force_sigma_N")?,
        torque_sigma_n_m: number("/sensor/noise/torque_sigma_Nm")?,
        ..Cell::default()
    };
    let mut reader = csv::Reader::from_path(folder.join("touches.csv"))?;
    let rows: std::result::Result<Vec<[f64; 8]>, _> = reader.deserialize().collect();
    Ok((rod, cell, rows?.into_iter().map(touch).collect()))
}

fn touch([fx, fy, fz, mx, my, mz, u, v]: [f64; 8]) -> Touch {
    let load = SpatialLoad { force_n: Vector3::new(fx, fy, fz), moment_n_m: Vector3::new(mx, my, mz) };
    Touch { load, pixel: [u, v] }
}

#[allow(dead_code)]
fn write_folder(folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder)?;
    let mut text = String::from("fx_n,fy_n,fz_n,mx_n_m,my_n_m,mz_n_m,u_px,v_px\n");
    let mut chance = Chance(SplitMix64::new(20041));
    let mut touches = simulated(&mut chance);
    // One touch of two objects at once: half a newton more, across the rest. It must not be believed.
    touches[7].load.force_n += Vector3::new(0.0, 0.0, 0.5);
    touches[7].load.moment_n_m += Vector3::new(0.0, -0.04, 0.0);
    for touch in &touches {
        let load: Vec<String> = touch.load.to_vector().iter().map(|v| format!("{v:.7}")).collect();
        writeln!(text, "{},{:.3},{:.3}", load.join(","), touch.pixel[0], touch.pixel[1])?;
    }
    std::fs::write(folder.join("touches.csv"), text)?;
    std::fs::write(folder.join("camera.toml"), CAMERA)?;
    let whisker = serde_json::json!({
        "whisker": { "length_m": LENGTH_M, "diameter_base_m": 0.001, "diameter_tip_m": 0.001,
            "intrinsic_curvature_1_per_m": 0.0, "EI_base_Nm2": EI_N_M2 },
        "sensor": { "noise": { "force_sigma_N": FORCE_SIGMA_N, "torque_sigma_Nm": TORQUE_SIGMA_N_M } },
    });
    std::fs::write(folder.join("whisker.json"), serde_json::to_string_pretty(&whisker)? + "\n")?;
    let truth = serde_json::json!({ "cam_from_hub": { "matrix": cam_from_hub().matrix() } });
    Ok(std::fs::write(folder.join("truth.json"), serde_json::to_string_pretty(&truth)? + "\n")?)
}

// ---- simulation

const LENGTH_M: f64 = 0.25;
/// Steel wire of 1 mm.
const EI_N_M2: f64 = 0.009817477042468103;
const FORCE_SIGMA_N: f64 = 1.0 / 320.0;
const TORQUE_SIGMA_N_M: f64 = 1.0 / 64e3;
const PIXEL_SIGMA_PX: f64 = 0.3;
const FOCAL_PX: f64 = 1000.0;
const CENTRE_PX: [f64; 2] = [640.0, 480.0];
const TOUCHES: usize = 24;
const CAMERA: &str = "model = \"pinhole\"\nwidth_px = 1280\nheight_px = 960\nfx_px = 1000.0\nfy_px = 1000.0\ncx_px = 640.0\ncy_px = 480.0\n";

/// The camera stands half a metre beside the whisker and looks at its middle.
pub fn cam_from_hub() -> Pose {
    let looking_back = Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0);
    let tilt = Rotation3::from_euler_angles(0.25, -0.6, 0.1);
    Pose::new(tilt.matrix() * looking_back, Vector3::new(0.08, -0.02, 0.42))
}

/// The whisker and its cell.
pub fn wire() -> (Rod, Cell) {
    let rod = Rod::uniform(LENGTH_M, EI_N_M2).expect("a rod");
    let cell = Cell { force_sigma_n: FORCE_SIGMA_N, torque_sigma_n_m: TORQUE_SIGMA_N_M, ..Cell::default() };
    (rod, cell)
}

/// Touches all around the whisker, bent by 25° to 70°, with friction, noise on all signals and pixels.
pub fn simulated(chance: &mut Chance) -> Vec<Touch> {
    (0..TOUCHES).map(|_| simulated_touch(chance)).collect()
}

fn simulated_touch(chance: &mut Chance) -> Touch {
    let (rod, cell) = wire();
    let covariance = load_covariance(&cell);
    loop {
        let exact = exact_load(chance);
        let Ok(seen) = estimate(&rod, &exact, &covariance) else { continue };
        let Some(contact) = seen.contact else { continue };
        if !(0.4 * LENGTH_M < contact.in_plane.s_m && contact.in_plane.s_m < 0.95 * LENGTH_M) {
            continue;
        }
        let x = cam_from_hub() * contact.x_in_hub;
        let pixel = [0, 1].map(|i| FOCAL_PX * x[i] / x.z + CENTRE_PX[i] + PIXEL_SIGMA_PX * chance.normal());
        let noise = covariance.map(f64::sqrt) * Vector6::from_fn(|_, _| chance.normal());
        let signals = exact.to_vector() + noise;
        return touch([
            signals[0], signals[1], signals[2], signals[3], signals[4], signals[5], pixel[0], pixel[1],
        ]);
    }
}

/// Of a bend, a size and a friction, the load at the hub: F·t = M₀²/2EI + fx at the contact, so fx follows from the moment.
fn exact_load(chance: &mut Chance) -> SpatialLoad {
    let force = 0.4 + 0.8 * chance.uniform();
    let bend = (25.0 + 45.0 * chance.uniform()).to_radians();
    let friction = 0.2 * chance.uniform();
    // β₀ = 90° − bend + friction: the clamped whisker against the force reversed.
    let beta = std::f64::consts::FRAC_PI_2 - bend + friction;
    let moment = (2.0 * EI_N_M2 * force * (friction.sin() + beta.cos())).max(0.0).sqrt();
    let (sin, cos) = (std::f64::consts::TAU * chance.uniform()).sin_cos();
    let (fx, fy) = (-force * beta.cos(), force * beta.sin());
    SpatialLoad {
        force_n: Vector3::new(fx, fy * cos, fy * sin),
        moment_n_m: Vector3::new(0.0, -moment * sin, moment * cos),
    }
}

/// SplitMix64 (Steele, Lea and Flood 2014).
pub struct Chance(pub SplitMix64);

impl Chance {
    fn uniform(&mut self) -> f64 {
        self.0.uniform()
    }

    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}
