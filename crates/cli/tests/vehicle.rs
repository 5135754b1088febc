//! `vehicle`: the commands of its page on a rendered street, as images and as a film, and what it refuses.

use crate::book_support::root;
use crate::film_support::{H264, has_ffmpeg};
use crate::support::{folder, json_lines, resight, same};
use crate::vehicle_support::{FRAME_S, MOUNTED, SPEED_M_S, drive};
use std::fmt::Write;
use std::process::Command;

const CAMERA: &str = "model = \"pinhole\"\nwidth_px = 480\nheight_px = 320\nfx_px = 320.0\nfy_px = 320.0\ncx_px = 239.5\ncy_px = 159.5\nintrinsics_sigma = { fx_px = 0.5, fy_px = 0.5, cx_px = 0.4, cy_px = 0.4 }\n";

#[test]
fn vehicle_page_shows_what_the_program_says() {
    let folder = folder("vehicle");
    std::fs::create_dir(folder.join("drive")).unwrap();
    let mut speeds = "t_s,speed_m_s\n".to_string();
    for (i, image) in drive(41).into_iter().enumerate() {
        let t_s = i as f64 * FRAME_S;
        std::fs::write(folder.join(format!("drive/{i:03}.png")), image.png().unwrap()).unwrap();
        writeln!(speeds, "{t_s:.1},{SPEED_M_S}").unwrap();
    }
    let file = |name: &str| folder.join(name).display().to_string();
    std::fs::write(file("speed.csv"), speeds).unwrap();
    std::fs::write(file("camera.toml"), CAMERA).unwrap();
    let (images, camera, speed) = (file("drive/*.png"), file("camera.toml"), file("speed.csv"));
    let page = std::fs::read_to_string(root().join("docs/vehicle.md")).unwrap();
    let command = "resight vehicle 'drive/*.png' --interval-s 0.3 --camera camera.toml --speed speed.csv";
    assert!(page.contains(command), "the page has another command than this test runs");
    let words = ["vehicle", &images, "--interval-s", "0.3", "--camera", &camera, "--speed", &speed];
    let run = resight(&words);
    assert_eq!(run.code, 0, "{}{}", run.stdout, run.stderr);
    let said = run.stdout.replace(&format!("{}/", folder.display()), "");
    let shown = page.split("```text\n").nth(1).unwrap().split("```").next().unwrap();
    assert!(same(&said, shown), "said\n{said}\nshown\n{shown}");

    if has_ffmpeg() {
        let film = file("drive.mp4");
        let made = Command::new("ffmpeg")
            .args(["-v", "error", "-framerate", "10/3", "-i", &file("drive/%03d.png")])
            .args(H264)
            .arg(&film)
            .status();
        assert!(made.unwrap().success());
        let run = resight(&["vehicle", &film, "--camera", &camera, "--speed", &speed, "--json"]);
        let answer = &json_lines(&run)[0];
        assert_eq!(answer["status"], "ok", "{answer}");
        let yaw_rad = answer["yaw_rad"].as_f64().unwrap();
        assert!((yaw_rad - MOUNTED[0]).abs() < 1e-3, "{yaw_rad}");
    }

    // Without the time between images, with a few images only, and with a camera of another image size.
    let refused = resight(&["vehicle", &images, "--camera", &camera]);
    assert!(refused.code == 2 && refused.stderr.contains("--interval-s"), "{}", refused.stderr);
    let few = resight(&["vehicle", &file("drive/00[0-4].png"), "--interval-s", "0.3", "--camera", &camera]);
    assert!(few.code == 1 && few.stdout.contains("UNDECIDED"), "{}{}", few.stdout, few.stderr);
    std::fs::write(file("other.toml"), CAMERA.replace("width_px = 480", "width_px = 500")).unwrap();
    let other = resight(&["vehicle", &images, "--interval-s", "0.3", "--camera", &file("other.toml")]);
    assert!(other.code == 2 && other.stderr.contains("500×320"), "{}{}", other.stdout, other.stderr);
}
