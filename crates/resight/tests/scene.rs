//! Scene files: the container walked record by record, the same bytes every time. That other people's readers understand messages and
//! schemas, scripts/judges/mcap_scene.py says of the golden file.

use crate::report_support::{camera_name, simulated};
use resight::scene::rig_scene;
use std::path::PathBuf;

fn golden() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../testdata/rig/scene.mcap")
}

/// Where a record starts, its opcode and content.
fn records(bytes: &[u8], from: usize, to: usize) -> Vec<(usize, u8, &[u8])> {
    let (mut found, mut at) = (Vec::new(), from);
    while at < to {
        let length = number(&bytes[at + 1..], 8) as usize;
        found.push((at, bytes[at], &bytes[at + 9..at + 9 + length]));
        at += 9 + length;
    }
    assert_eq!(at, to, "records end where the section does");
    found
}

fn number(bytes: &[u8], length: usize) -> u64 {
    bytes[..length].iter().rev().fold(0, |n, b| n << 8 | u64::from(*b))
}

/// A file of the size that rigs have: several chunks, every index entry at the message it names, every message indexed once.
#[test]
fn indexes_point_at_what_they_name() {
    let run = simulated(4, 300, 11);
    let file = rig_scene(&run).unwrap();
    let all = records(&file, 8, file.len() - 8);
    let of = |opcode: u8| all.iter().filter(move |r| r.1 == opcode);
    assert!(1 < of(0x06).count(), "several chunks");
    let (mut messages, mut indexed) = (0, 0);
    for (_, _, index) in of(0x08) {
        let (chunk_at, chunk_length) = (number(&index[16..], 8) as usize, number(&index[24..], 8) as usize);
        assert_eq!(file[chunk_at], 0x06);
        let chunk = &file[chunk_at + 9..chunk_at + chunk_length];
        let content = &chunk[40..];
        messages += records(content, 0, content.len()).iter().filter(|r| r.1 == 0x05).count();
        let map_length = number(&index[32..], 4) as usize;
        for pair in index[36..36 + map_length].chunks(10) {
            let at = number(&pair[2..], 8) as usize;
            assert_eq!(file[at], 0x07);
            assert_eq!(pair[..2], file[at + 9..at + 11]);
            let entries = number(&file[at + 11..], 4) as usize;
            for entry in file[at + 15..at + 15 + entries].chunks(16) {
                let message = &content[number(&entry[8..], 8) as usize..];
                assert_eq!((message[0], &message[9..11], &message[15..23]), (0x05, &pair[..2], &entry[..8]));
                indexed += 1;
            }
        }
    }
    assert_eq!(indexed, messages);
    // Three a view, one calibration and one drawing a camera, one for where the cameras stand.
    assert_eq!(messages, 3 * 300 + 2 * 4 + 1);
    let statistics = of(0x0b).next().unwrap().2;
    assert_eq!(number(statistics, 8), messages as u64);
}

#[test]
fn same_run_same_bytes_and_those_of_the_golden_file() {
    let run = simulated(2, 3, 5);
    let file = rig_scene(&run).unwrap();
    assert!(file == rig_scene(&run.clone()).unwrap());
    if std::env::var_os("RESIGHT_WRITE_GOLDEN").is_some() {
        std::fs::create_dir_all(golden().parent().unwrap()).unwrap();
        std::fs::write(golden(), &file).unwrap();
    }
    let expected = std::fs::read(golden()).unwrap();
    assert!(
        file == expected,
        "scene differs from testdata/rig/scene.mcap; RESIGHT_WRITE_GOLDEN=1 writes it anew"
    );
}

/// Nothing placed, no image size, one camera, numbers that are none: a file, not a panic.
#[test]
fn poor_runs_give_files_too() {
    let mut run = simulated(1, 2, 3);
    run.solution.bodies.clear();
    run.rig.lenses[0].size = None;
    run.solution.cameras[0].covariance[(3, 3)] = f64::NAN;
    run.solution.weakest_link = None;
    run.solution.joint_covariance = None;
    let file = rig_scene(&run).unwrap();
    assert!(records(&file, 8, file.len() - 8).iter().any(|r| r.1 == 0x06));
    run.rig.views.clear();
    run.rig.observations.clear();
    run.solution.observations.clear();
    rig_scene(&run).unwrap();
}

#[test]
fn names_are_frames_and_topics() {
    let file = rig_scene(&simulated(2, 3, 5)).unwrap();
    for name in [0, 1].map(camera_name) {
        for text in [format!("camera/{name}"), format!("/camera/{name}/calibration")] {
            assert!(file.windows(text.len()).any(|w| w == text.as_bytes()), "{text}");
        }
    }
}
