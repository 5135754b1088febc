//! The paper's Table II as shipped: `auto` finds the printed poses, the printed procedure says not to trust it.

use crate::support::{json_lines, resight, table_two};

/// R = R_Z(φ) R_Y(ϕ) R_X(ω), the paper's.
fn printed([yaw, pitch, roll]: [f64; 3]) -> [[f64; 3]; 3] {
    let [(sa, ca), (sb, cb), (sc, cc)] = [yaw, pitch, roll].map(|deg| deg.to_radians().sin_cos());
    [
        [cb * cc, sa * sb * cc - ca * sc, ca * sb * cc + sa * sc],
        [cb * sc, sa * sb * sc + ca * cc, ca * sb * sc - sa * cc],
        [-sb, sa * cb, ca * cb],
    ]
}

/// Within 0.08° and 0.12° of the printed poses, from four decimals.
#[test]
fn auto_finds_the_printed_poses() {
    let cases = [
        (1, [45.0, 30.0, 60.0], [0.20, 0.10, 3.00], 0.08),
        (2, [53.0, 37.0, 81.0], [0.25, 0.15, 2.50], 0.12),
    ];
    for (n, angles_deg, position_m, limit_deg) in cases {
        let (points, camera) = (table_two(&format!("points{n}.csv")), table_two(&format!("camera{n}.toml")));
        let run = resight(&["solve", &points, "--camera", &camera, "--json"]);
        let answer = &json_lines(&run)[0];
        assert_eq!((run.code, &answer["status"]), (0, &"ok".into()), "{answer}");
        let matrix: [[f64; 4]; 4] =
            serde_json::from_value(answer["cam_from_target"]["matrix"].clone()).unwrap();
        let r = printed(angles_deg);
        let trace: f64 = (0..9).map(|i| r[i / 3][i % 3] * matrix[i / 3][i % 3]).sum();
        let angle_deg = ((trace - 1.0) / 2.0).clamp(-1.0, 1.0).acos().to_degrees();
        assert!(angle_deg <= limit_deg, "camera {n}: {angle_deg}°");
        for (i, x) in position_m.iter().enumerate() {
            assert!((matrix[i][3] - x).abs() < 0.02, "camera {n}: {answer}");
        }
    }
}

#[test]
fn the_printed_procedure_is_not_trusted() {
    for n in [1, 2] {
        let (points, camera) = (table_two(&format!("points{n}.csv")), table_two(&format!("camera{n}.toml")));
        let run = resight(&["solve", &points, "--camera", &camera, "--method", "wang2004", "--json"]);
        assert_eq!(json_lines(&run)[0]["status"], "inconsistent");
    }
}
