//! Photographs of chessboards before targets whose counts of corners are off by one or two: refused, and the true grid is named. The right count
//! keeps its recall, and what is partly hidden keeps its ids. Needs the folder named by RESIGHT_DATA.

use crate::recorded::recorded;
use resight::GrayImage;
use resight::core::Target;
use resight::core::correspondence::Detection;
use resight::core::target::Chessboard;
use resight::detect::Detector;
use resight::detect::absent::instead_of;
use std::path::{Path, PathBuf};

const ROWS: u32 = 6;
const COLUMNS: u32 = 9;

fn chessboard(rows: u32, columns: u32) -> Target {
    Target::Chessboard(Chessboard { rows, columns, square_m: 0.025 })
}

/// The 26 photographs of one board of 6 × 9.
fn photographs(folder: &Path) -> Vec<(String, GrayImage)> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().path()).collect();
    files.retain(|file| file.extension().is_some_and(|extension| extension == "jpg"));
    files.sort();
    assert_eq!(files.len(), 26);
    let name = |file: &Path| file.file_stem().unwrap().to_string_lossy().into_owned();
    files.iter().map(|file| (name(file), GrayImage::read(file).unwrap())).collect()
}

fn found(target: &Target, image: &GrayImage) -> Vec<Detection> {
    Detector::new(target).unwrap().detect(image).unwrap()
}

#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn a_wrong_count_is_refused_in_every_photograph() {
    let images = photographs(&recorded("opencv_stereo_chessboard"));
    for (rows, columns) in [(5, 9), (6, 8), (7, 9), (6, 10), (7, 10)] {
        let target = chessboard(rows, columns);
        let accepted: Vec<&str> = images
            .iter()
            .filter(|(_, image)| !found(&target, image).is_empty())
            .map(|(name, _)| name.as_str())
            .collect();
        println!(
            "asked for {rows} × {columns}: accepted in {} of {} {accepted:?}",
            accepted.len(),
            images.len()
        );
        assert!(accepted.is_empty(), "{rows} × {columns}: {accepted:?}");
        // The explanation searches several times: some of the images tell.
        for (name, image) in images.iter().step_by(9) {
            let reason = instead_of(&target, image).unwrap_or_default();
            assert!(
                reason.contains("a grid of 6 × 9 inner corners is there"),
                "{name}, {rows} × {columns}: {reason}"
            );
        }
    }
    let whole =
        images.iter().filter(|(_, image)| found(&chessboard(ROWS, COLUMNS), image).len() == 54).count();
    println!("asked for {ROWS} × {COLUMNS}: {whole} of {} whole", images.len());
    assert_eq!(whole, images.len());
}

/// A half-plane of grey, of black or of white over the board, from one side or another: each corner that is found is the one of its id.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn a_partly_hidden_board_keeps_its_ids() {
    let (mut placed, mut n) = (0, 0);
    for (k, (name, image)) in photographs(&recorded("opencv_stereo_chessboard")).into_iter().enumerate() {
        let target = chessboard(ROWS, COLUMNS);
        let whole = found(&target, &image);
        let middle = whole.iter().map(|d| d.pixel).sum::<resight::core::Pixel>() / whole.len() as f64;
        for (side, gray) in [95, 5, 250].into_iter().enumerate() {
            let (sin, cos) = (1.9 * (3 * k + side) as f64).sin_cos();
            let offset_px = 10.0 + 15.0 * ((k + side) % 5) as f64;
            let mut covered = image.clone();
            for (at, value) in covered.data.iter_mut().enumerate() {
                let (u, v) = ((at as u32 % image.width_px) as f64, (at as u32 / image.width_px) as f64);
                if offset_px < (u - middle.x) * cos + (v - middle.y) * sin {
                    *value = gray;
                }
            }
            let seen = found(&target, &covered);
            for d in &seen {
                let off_px = (d.pixel - whole[d.feature.id as usize].pixel).norm();
                assert!(off_px < 4.0, "{name}, cover {side}, corner {}: {off_px} px", d.feature.id);
            }
            placed += usize::from(!seen.is_empty());
            n += 1;
        }
    }
    println!("{placed} of {n} boards that a half-plane hides in part got ids, all of them right");
    // What is left of most shows no margin on enough sides.
    assert!(n <= 4 * placed, "{placed} of {n}");
}
