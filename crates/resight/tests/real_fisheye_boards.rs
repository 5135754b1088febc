//! Chessboards through real fisheye lenses: how many are found, against what OpenCV finds. Needs the folder named by RESIGHT_DATA.

use crate::real_support::{Row, pixel_of, table};
use crate::recorded::recorded;
use resight::GrayImage;
use resight::core::correspondence::Detection;
use resight::core::target::Chessboard;
use resight::core::{Pixel, Target};
use resight::detect::Detector;
use std::collections::BTreeMap;

/// The greatest distance of a corner from OpenCV's that is no other corner: two of their windows, smeared at the rim of the image.
const SAME_PX: f64 = 3.0;

/// OpenCV finds all of the 18 photographs, and so does this detector. A corner is right where it is the one of OpenCV's that its id says, in OpenCV's order or from one of the other ends.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn fisheye_boards_are_found() {
    let folder = recorded("fisheye_chessboards");
    let mut by_image: BTreeMap<String, Vec<Pixel>> = BTreeMap::new();
    let rows: Vec<Row> = table(&folder.join("corners_opencv.csv"));
    rows.iter().for_each(|row| by_image.entry(row["image"].clone()).or_default().push(pixel_of(row)));
    assert_eq!(by_image.len(), 18);
    let (mut whole, mut part, mut distances) = (0, 0, Vec::new());
    for (name, opencv) in &by_image {
        let (rows, columns) = if opencv.len() == 48 { (6, 8) } else { (4, 6) };
        let image = GrayImage::read(&folder.join(name)).unwrap();
        let target = Target::Chessboard(Chessboard { rows, columns, square_m: 1.0 });
        let found = Detector::new(&target).unwrap().detect(&image).unwrap();
        println!("{name}: {} of {}", found.len(), opencv.len());
        whole += usize::from(found.len() == opencv.len());
        part += usize::from(!found.is_empty() && found.len() < opencv.len());
        if !found.is_empty() {
            distances.extend(distances_px(&found, opencv, rows, columns));
        }
    }
    distances.sort_by(f64::total_cmp);
    let share = |q: f64| distances[(q * (distances.len() - 1) as f64) as usize];
    println!(
        "fisheye chessboards: {whole} whole, {part} in part, {} not, of 18; from OpenCV's corners median {:.2} px, 95 % {:.2} px",
        18 - whole - part,
        share(0.5),
        share(0.95)
    );
    assert_eq!(whole, 18, "{part} in part");
    // One corner of OpenCV's, in an overexposed part of Fisheye1_5, is 8 px off the position that a fisheye model of all photographs gives it.
    let others = distances.iter().filter(|px| SAME_PX <= **px).count();
    assert!(others <= 1, "{others} corners are not those of OpenCV with their ids");
    assert!(share(0.5) < 0.25 && share(0.95) < 1.0, "{} {}", share(0.5), share(0.95));
}

/// The distance of each corner from OpenCV's, numbered the way that fits best of the four that turn a board.
fn distances_px(found: &[Detection], opencv: &[Pixel], rows: u32, columns: u32) -> Vec<f64> {
    let n = rows * columns;
    // OpenCV takes either side for the rows where both are even: along rows, along columns, and each from the other end.
    let numberings: [&dyn Fn(u32) -> u32; 8] = [
        &|id| id,
        &|id| n - 1 - id,
        &|id| (id / columns) * columns + columns - 1 - id % columns,
        &|id| (rows - 1 - id / columns) * columns + id % columns,
        &|id| (id % columns) * rows + id / columns,
        &|id| n - 1 - (id % columns) * rows - id / columns,
        &|id| (id % columns) * rows + rows - 1 - id / columns,
        &|id| (columns - 1 - id % columns) * rows + id / columns,
    ];
    let distances = |number: &&dyn Fn(u32) -> u32| -> Vec<f64> {
        found.iter().map(|d| (d.pixel - opencv[number(d.feature.id) as usize]).norm()).collect()
    };
    let sum = |d: &Vec<f64>| d.iter().sum::<f64>();
    numberings.iter().map(distances).min_by(|a, b| sum(a).total_cmp(&sum(b))).unwrap()
}
