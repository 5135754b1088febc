//! The usual faults of points and intrinsics, where a network contradicts itself: tried on each photograph that shows enough control points to solve
//! for its pose alone.

use super::scene::{NamedScene, ScenePhoto};
use crate::core::locate::Config;
use crate::core::multiview::network::Constraint;
use crate::core::{Correspondence, Point};
use crate::locate::of_table;

/// Returns a sentence for each photograph whose control points agree once a fault is corrected.
pub(super) fn causes(scene: &NamedScene) -> Vec<String> {
    scene.photos.iter().enumerate().filter_map(|(i, photo)| of_photo(scene, i, photo)).collect()
}

fn of_photo(scene: &NamedScene, index: usize, photo: &ScenePhoto) -> Option<String> {
    let lens = scene.cameras.get(photo.camera)?;
    let seen = |constraint: &Constraint| match *constraint {
        Constraint::ImagePoint { photo, point, pixel, covariance_px2 } if photo == index => {
            let (x_in_target, sigma_m) = known(scene, point)?;
            let seen = Correspondence::new(&lens.camera, x_in_target, pixel, 1.0).ok()?;
            Some((point, Correspondence { sigma_m, ..seen.with_covariance(covariance_px2) }))
        }
        _ => None,
    };
    let (points, seen): (Vec<usize>, Vec<Correspondence>) = scene.constraints.iter().filter_map(seen).unzip();
    let config = Config { intrinsics_covariance: lens.intrinsics_covariance.as_deref(), ..Config::default() };
    let label = |i: usize| scene.points[points[i]].clone();
    let sentence = of_table(&seen, &lens.camera, &config, label)?;
    Some(format!("photo {}: {sentence}", photo.name))
}

/// Returns the stated coordinates of a point and their largest standard deviation.
fn known(scene: &NamedScene, wanted: usize) -> Option<(Point, f64)> {
    scene.constraints.iter().find_map(|constraint| match constraint {
        Constraint::Place { point, x_in_world, sigma_m } if *point == wanted => {
            Some((*x_in_world, sigma_m.max()))
        }
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::{measure, read_scene};
    use resight_core::camera::{BrownConrady, ImageSize};
    use resight_core::{Camera, CameraMatrix, Pose, Vector6};

    fn lens(f_px: f64, distortion: [f64; 4]) -> Camera {
        let matrix = CameraMatrix { fx_px: f_px, fy_px: f_px, cx_px: 640.0, cy_px: 470.0 };
        let size = ImageSize { width_px: 1280, height_px: 960 };
        Camera::new(BrownConrady::new(matrix, &distortion).expect("a lens"), Some(size)).expect("a camera")
    }

    /// Twelve control points in two photographs of a camera with this focal length and distortion, which the scene states as 900 px and none.
    fn message(name: &str, camera: &Camera) -> String {
        let folder = std::env::temp_dir().join(format!("resight-causes-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let stated = "model = \"pinhole\"\nwidth_px = 1280\nheight_px = 960\nfx_px = 900.0\nfy_px = 900.0\ncx_px = 640.0\ncy_px = 470.0\n";
        std::fs::write(folder.join("camera.toml"), stated).expect("written");
        let mut scene = String::from("image_points = \"points.csv\"\n");
        for photo in ["east", "west"] {
            scene += &format!("[[photo]]\nname = \"{photo}\"\ncamera = \"camera.toml\"\n");
        }
        let mut rows = String::from("photo,point,u_px,v_px,sigma_px\n");
        for i in 0..12u32 {
            let angle = 2.399 * f64::from(i);
            let x = Point::new(2.0 * angle.cos(), 1.5 * angle.sin(), (1.7 * angle).sin());
            scene += &format!(
                "[[control_point]]\nname = \"p{i}\"\nx_m = {:?}\ny_m = {:?}\nz_m = {:?}\nsigma_m = 0.0\n",
                x.x, x.y, x.z
            );
            for (photo, yaw) in [("east", 0.2), ("west", -0.25)] {
                let pose = Pose::exp(&Vector6::new(0.1, yaw, 0.05, 0.1, -0.1, 4.5));
                let pixel = camera.project(&(pose * x)).expect("in front");
                let (k, phase) = (f64::from(i), yaw);
                let (u, v) =
                    (pixel.x + 0.3 * (12.9 * k + phase).sin(), pixel.y + 0.3 * (78.2 * k + phase).cos());
                rows += &format!("{photo},p{i},{u:.4},{v:.4},0.3\n");
            }
        }
        scene += "[[query]]\nkind = \"distance\"\npoints = [\"p0\", \"p5\"]\n";
        std::fs::write(folder.join("points.csv"), rows).expect("written");
        std::fs::write(folder.join("scene.toml"), scene).expect("written");
        let scene = read_scene(folder.join("scene.toml")).expect("a scene");
        let answer = measure(&scene).expect("an answer").solved.expect("a solution");
        let _ = std::fs::remove_dir_all(&folder);
        answer.verdict.join("; ")
    }

    #[test]
    fn faults_of_the_camera_file_are_named_for_each_photograph() {
        assert_eq!(message("right", &lens(900.0, [0.0; 4])), "");
        for (name, camera, cause) in [
            ("distorted", lens(900.0, [-0.28, 0.09, 0.0, 0.0]), "with the distortion k1 = -0.2"),
            ("focal", lens(820.0, [0.0; 4]), "with a focal length of 8"),
        ] {
            let message = message(name, &camera);
            for photo in ["east", "west"] {
                let sentence = format!("photo {photo}: the points agree {cause}");
                assert!(message.contains(&sentence), "{name}: {message}");
            }
        }
    }
}
