//! Cameras with realistic parameters, several of each model, wide-angle ones included.

use resight_core::camera::*;

fn matrix(fx_px: f64, fy_px: f64, cx_px: f64, cy_px: f64) -> CameraMatrix {
    CameraMatrix { fx_px, fy_px, cx_px, cy_px }
}

fn photogrammetric(f: f64, k: [f64; 3], p: [f64; 2], a: [f64; 2], at: [f64; 2]) -> Lens {
    let parameters = PhotogrammetricParameters { f, xp: at[0], yp: at[1], k, p, a };
    Photogrammetric::new(parameters).unwrap().into()
}

/// Name and camera; 4 to 9 of each model.
pub fn cameras() -> Vec<(String, Camera)> {
    let mut lenses: Vec<Lens> = Vec::new();
    let vga = matrix(535.4, 535.9, 341.8, 234.2);
    lenses.push(Pinhole::new(vga).unwrap().into());
    lenses.push(Pinhole::new(matrix(1.0, 1.0, 0.0, 0.0)).unwrap().into());
    for coefficients in brown_conrady() {
        lenses.push(BrownConrady::new(vga, coefficients).unwrap().into());
    }
    lenses.push(BrownConrady::new(matrix(1.0, 1.0, 0.0, 0.0), &[-0.3, 0.1, 1e-3, -2e-3]).unwrap().into());
    lenses.push(
        BrownConrady::new(matrix(9000.0, 9010.0, 2000.0, 1500.0), &[0.4, -30.0, 1e-3, 0.0, 400.0])
            .unwrap()
            .into(),
    );
    let fisheye = matrix(190.978, 190.973, 254.932, 256.897);
    for k in [
        [0.00348238940, 0.000715034845, -0.00205323614, 0.000202936736],
        [0.0, 0.0, 0.0, 0.0],
        [-0.05, 0.01, -0.02, 0.001],
        [0.1, -0.2, 0.1, -0.02],
        [-0.3, 0.0, 0.0, 0.0],
    ] {
        lenses.push(KannalaBrandt::new(fisheye, &k).unwrap().into());
    }
    for w in [0.0, 1e-7, 1e-3, 0.933, 1.9, 3.0] {
        lenses.push(Fov::new(fisheye, w).unwrap().into());
    }
    for (xi, distortion) in [
        (0.0, &[][..]),
        (0.8, &[-0.1, 0.02, 1e-3, -5e-4][..]),
        (1.0, &[][..]),
        (1.67, &[-0.31, 0.12, 2e-3, 1e-3][..]),
        (2.9, &[0.05, -0.4, 0.0, 0.0][..]),
        (-0.2, &[][..]),
    ] {
        lenses.push(Omni::new(matrix(820.0, 822.0, 376.0, 240.0), xi, distortion).unwrap().into());
    }
    for (alpha, beta) in [(0.0, 1.0), (0.3, 1.4), (0.5, 1.0), (0.5903, 1.1275), (0.72, 0.9), (1.0, 1.2)] {
        lenses.push(Eucm::new(matrix(460.76, 459.41, 365.89, 249.33), alpha, beta).unwrap().into());
    }
    for (xi, alpha) in
        [(-0.2, 0.59), (0.0, 0.5), (0.4, 0.3), (-0.6, 0.75), (0.99, 0.5), (1.0, 1.0), (1.3, 0.55)]
    {
        lenses.push(DoubleSphere::new(matrix(350.0, 351.0, 365.0, 249.0), xi, alpha).unwrap().into());
    }
    lenses.push(photogrammetric(3.54144878, [0.0; 3], [0.0; 2], [0.0; 2], [0.0; 2]));
    lenses.push(photogrammetric(28.4, [8e-5, -1.4e-7, 2e-11], [2e-6, -5e-6], [1e-4, -3e-4], [0.02, -0.11]));
    lenses.push(photogrammetric(3.5, [-9e-3, 2e-4, 1e-6], [1e-3, -2e-3], [0.02, -0.03], [0.1, 0.2]));
    lenses.push(photogrammetric(2800.0, [2.2e-8, -3e-15, 0.0], [3e-7, 1e-7], [1e-4, 2e-4], [1990.0, 1510.0]));
    lenses.push(photogrammetric(1.0, [0.3, 0.2, 0.0], [0.0; 2], [0.0; 2], [0.0; 2]));
    lenses
        .into_iter()
        .enumerate()
        .map(|(i, lens)| (format!("{} #{i}", lens.model_name()), Camera { lens, size: None }))
        .collect()
}

fn brown_conrady() -> [&'static [f64]; 10] {
    [
        &[0.0, 0.0, 0.0, 0.0],
        &[-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05],
        &[-0.26637, -0.03858588, 0.0017831, -0.00028122, 0.23839],
        // A wide lens whose polynomial folds at tan θ ≈ 0.8.
        &[-0.6, 0.2, 1e-3, -2e-3, 0.0],
        &[0.3, -1.2, 0.0, 0.0, 0.4],
        // Rational, strong wide-angle.
        &[17.9, 11.4, 1e-4, -2e-4, 0.5, 18.3, 17.6, 3.3],
        // Rational with a pole at 1/(1 − 0.5 r²).
        &[0.1, 0.0, 0.0, 0.0, 0.0, -0.5, 0.0, 0.0],
        &[-0.3, 0.12, 1e-3, -2e-3, -0.02, 0.02, 0.01, -0.002, 1e-3, -4e-4, -2e-3, 3e-4],
        &[-0.3, 0.12, 1e-3, -2e-3, -0.02, 0.02, 0.01, -0.002, 1e-3, -4e-4, -2e-3, 3e-4, 0.05, -0.08],
        // Scheimpflug.
        &[-0.1, 0.02, 5e-4, -3e-4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.35, 0.2],
    ]
}
