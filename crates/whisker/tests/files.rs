//! Text and rows: what is written is read back, what is foreign becomes ours.

use crate::recorded::recorded;
use nalgebra::{Matrix3, Vector2};
use resight_whisker::calibrate::{Calibration, Covariance, Gravity, Parameter, Values};
use resight_whisker::estimate::{Mode, Status};
use resight_whisker::events::{Change, Label};
use resight_whisker::files::contacts::{self, ContactObject, ContactRow, Figures, RowStatus, Side, Spatial};
use resight_whisker::files::hub::{Conventions, read_hub, write_hub};
use resight_whisker::files::node::Node;
use resight_whisker::files::object::OutlineObject;
use resight_whisker::files::{calibration, object, whisker};
use resight_whisker::rod::{IntrinsicCurvature, Stiffness};
use resight_whisker::{HubLoad, PlanarPose, Rod, Sample, Shape};

/// The published sets' own files are whisker files: the same rod and instruments as read by hand.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn published_whisker_files_are_understood() {
    let sets = crate::real_support::sets();
    let root = recorded("whisker");
    for set in sets {
        let text = std::fs::read_to_string(root.join(set.name).join("meta.json")).expect("meta.json");
        let file = whisker::read(&text).expect(set.name);
        assert_eq!((&file.rod, &file.cell), (&set.rod, &set.cell), "{}", set.name);
        assert!(file.warnings.is_empty(), "{:?}", file.warnings);
        let rows = std::fs::read_to_string(root.join(set.name).join("measured_noisy.csv")).expect("readings");
        let read: Vec<Sample> = read_hub(&rows, file.conventions)
            .expect("rows")
            .into_iter()
            .map(|r| r.reading.expect("whole"))
            .collect();
        assert_eq!(read, set.noisy, "{}", set.name);
    }
}

#[test]
fn readings_are_written_and_read_back_whole() {
    let sample = |i: u32| Sample {
        sweep: i / 3,
        sample: i % 3,
        t_s: Some(0.1 * f64::from(i)),
        world_from_hub: PlanarPose { x_m: 1e-7 / 3.0, y_m: -1e9 / 7.0, angle_rad: 0.1 + f64::from(i) },
        load: HubLoad { fx_n: 1.0 / 3.0, fy_n: -2e-300, mz_n_m: 5e-324 },
    };
    let samples: Vec<Sample> = (0..7).map(sample).collect();
    let rows = read_hub(&write_hub(&samples), Conventions::default()).expect("rows");
    assert_eq!(rows.into_iter().map(|r| r.reading.expect("whole")).collect::<Vec<_>>(), samples);
}

#[test]
fn samples_are_counted_where_the_file_does_not() {
    let text = "hub_angle,hub_x,hub_y,fx,fy,mz,sweep\n0,0,0,1,1,1,4\n0,0,0,1,1,,4\n0,0,0,1,1,1,5\n";
    let rows = read_hub(text, Conventions::default()).expect("rows");
    let numbers: Vec<_> = rows.iter().map(|r| (r.line, r.sweep, r.sample, r.reading.is_ok())).collect();
    assert_eq!(numbers, [(2, 4, 0, true), (3, 4, 1, false), (4, 5, 0, true)]);
}

fn contact(theta_is_known: bool) -> ContactRow {
    let unknown = if theta_is_known { 1e-4 / 3.0 } else { f64::NAN };
    let figures = Figures {
        x_in_world: Vector2::new(1.0 / 3.0, -1e-17),
        s_m: 0.1,
        s_sigma_m: Some(1e-3),
        theta_rad: 2.0 / 7.0,
        f_normal_n: 0.2,
        f_tangent_n: -1e-20,
        friction_angle_rad: 0.3,
        friction_angle_sigma_rad: Some(0.01),
        k2: 0.5,
        covariance: Matrix3::new(1e-6, 1e-8, unknown, 1e-8, 2e-6, unknown, unknown, unknown, unknown),
        radius_m: 4e-4,
    };
    ContactRow {
        mode: Mode::Tip,
        mode_probability: 0.999,
        figures: Some(figures),
        side: Some(Side::Left),
        branch: 1,
        other_s_m: vec![0.11, 0.125],
        feature: Some(Label::Corner),
        event: Change::SlipOff,
        steps_to_slip_off: Some([7.25, 1.0 / 3.0]),
        spatial: Some(Spatial {
            z_m: Some(-0.01 / 3.0),
            covariance_z: Some([1e-8, -2e-8, 1e-6 / 7.0]),
            roll_rad: -1.0 / 3.0,
            roll_sigma_rad: 0.01,
            plane_p: 0.3,
        }),
        note: "a \"note\", with a comma".to_string(),
        ..ContactRow::blank(2, 9, None, RowStatus::Read(Status::BeyondTip))
    }
}

fn json(object: &impl serde::Serialize) -> String {
    serde_json::to_string(object).expect("JSON")
}

#[test]
fn contacts_are_written_and_read_back_whole() {
    let rows = [contact(true), ContactRow::missing(0, 1, Some(0.5), &["mz".to_string()])];
    let lines: String = rows.iter().map(|row| json(&ContactObject::from(row)) + "\n").collect();
    for text in [contacts::write_csv(&rows), lines] {
        assert!(contacts::is_contacts(&text));
        assert_eq!(contacts::read(&text).expect("rows"), rows, "{text}");
    }
}

/// Files that say nothing of θ's covariance have one that is no number, not one of zero.
#[test]
fn an_unknown_covariance_of_the_direction_stays_unknown() {
    let text = contacts::write_csv(&[contact(false)]);
    let figures = contacts::read(&text).expect("rows")[0].figures.expect("figures");
    assert!(figures.covariance[(2, 2)].is_nan() && figures.covariance[(0, 0)] == 1e-6);
}

#[test]
fn objects_are_written_and_read_back() {
    let at = Vector2::new(0.01, 0.16);
    let shapes = [
        Shape::Circle { centre_m: at, radius_m: 0.025 },
        Shape::Ellipse { centre_m: at, semi_axes_m: [0.05, 0.02], angle_rad: 0.25 },
        Shape::square(at, 0.06, 0.5),
        Shape::Rectangle { centre_m: at, sides_m: [0.06, 0.03], angle_rad: -0.5 },
        Shape::Polygon { corners_m: vec![at, at + Vector2::x(), at + Vector2::y()] },
    ];
    for shape in shapes {
        let read = object::read(&json(&OutlineObject::from(&shape))).expect("an object").shape;
        for direction in [0.0_f64, 1.0, 2.5, 4.0] {
            let n = Vector2::new(direction.cos(), direction.sin());
            // Degrees and back cost an ulp.
            assert!((read.support_m(n) - shape.support_m(n)).abs() < 1e-15, "{shape:?} {read:?}");
        }
    }
    let clockwise = r#"{"type": "polygon", "corners": [[0, 0], [0, 1], [1, 0]]}"#;
    object::read(clockwise).expect("an object").shape.check().expect("counter-clockwise");
}

#[test]
fn a_calibration_is_written_and_read_back_whole() {
    let rod = Rod::uniform(0.25, 0.01).expect("a rod");
    let mut calibration = Calibration {
        nominal_rod: rod.clone(),
        values: Values::from_fn(|i, _| 0.01 / (3.0 + i as f64)),
        covariance: Covariance::from_fn(|i, j| 1e-6 / (1.0 + i as f64 + j as f64)),
        gravity: Some(Gravity { direction_rad: -1.5, lever_m: 0.125 }),
    };
    let held = [Parameter::ForceGain, Parameter::Curvature];
    for parameter in held {
        calibration.covariance.row_mut(parameter.index()).fill(0.0);
        calibration.covariance.column_mut(parameter.index()).fill(0.0);
    }
    let text = json(&calibration::section(&calibration, &held));
    let value: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(calibration::read(&Node::root(&value), &rod).expect("a calibration"), calibration);
}

#[test]
fn profiles_and_tapers_are_understood() {
    let read = |inside: &str| whisker::read(&format!("{{\"whisker\": {{\"length_m\": 0.2, {inside}}}}}"));
    let taper = read(r#""youngs_modulus_Pa": 2e11, "diameter_base_m": 0.001, "diameter_tip_m": 0.0005"#)
        .expect("a taper");
    let ei = 2e11 * std::f64::consts::PI * 1e-12 / 64.0;
    let Stiffness::Taper { ei_base_n_m2, taper: tau } = taper.rod.stiffness else { panic!("{taper:?}") };
    assert!((ei_base_n_m2 / ei - 1.0).abs() < 1e-14 && tau == 0.5);
    assert_eq!(taper.rod.diameters_m, [0.001, 0.0005]);
    assert_eq!(taper.warnings.len(), 1, "noise was assumed, which is said: {:?}", taper.warnings);

    let table = read(
        r#""EI_profile": {"s_m": [0, 0.1, 0.2], "EI_Nm2": [3, 2, 1]}, "intrinsic_curvature_1_per_m": 0.5"#,
    )
    .expect("a table");
    assert_eq!(
        table.rod.stiffness,
        Stiffness::Profile { s_m: vec![0.0, 0.1, 0.2], ei_n_m2: vec![3.0, 2.0, 1.0] }
    );
    assert_eq!(table.rod.intrinsic_curvature, IntrinsicCurvature::Constant { per_m: 0.5 });
    let differs = read(r#""EI_Nm2": 0.01, "youngs_modulus_Pa": 2e11, "diameter_m": 0.002"#).expect("a rod");
    assert!(differs.warnings.iter().any(|w| w.contains("the stated EI is used")), "{:?}", differs.warnings);
}
