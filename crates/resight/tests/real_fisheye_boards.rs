//! Chessboards through real fisheye lenses: how many are found, against what OpenCV finds. Needs the folder named by RESIGHT_DATA.

use crate::real_support::{Row, pixel_of, table};
use crate::recorded::recorded;
use resight::GrayImage;
use resight::core::camera::{ImageSize, KannalaBrandt};
use resight::core::correspondence::Detection;
use resight::core::multiview::intrinsics::{
    CHOICES, IntrinsicsConfig, IntrinsicsOutcome, Models, solve_intrinsics,
};
use resight::core::target::Chessboard;
use resight::core::{Camera, CameraMatrix, Correspondence, Pixel, Point, Target};
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
    let mut corners: [Set; 2] = Default::default();
    for (name, opencv) in &by_image {
        let (rows, columns) = if opencv.len() == 48 { (6, 8) } else { (4, 6) };
        let image = GrayImage::read(folder.join(name)).unwrap();
        let target = Target::Chessboard(Chessboard { rows, columns, square_m: 1.0 });
        let found = Detector::new(&target).unwrap().detect(&image).unwrap();
        println!("{name}: {} of {}", found.len(), opencv.len());
        whole += usize::from(found.len() == opencv.len());
        part += usize::from(!found.is_empty() && found.len() < opencv.len());
        if !found.is_empty() {
            let theirs = numbered(&found, opencv, rows, columns);
            distances.extend(found.iter().zip(&theirs).map(|(d, own)| (d.pixel - own).norm()));
            let at = |d: &Detection| target.point(d.feature).unwrap().position;
            let [own, other] = &mut corners[usize::from(rows == 4)].views;
            own.push(found.iter().map(|d| (at(d), d.pixel)).collect());
            other.push(found.iter().zip(theirs).map(|(d, pixel)| (at(d), pixel)).collect());
            let (width_px, height_px) = (image.width_px, image.height_px);
            corners[usize::from(rows == 4)].size = Some(ImageSize { width_px, height_px });
        }
    }
    for set in &corners {
        let [own, opencv] = set.views.each_ref().map(|views| rms_px(views, set.size.unwrap()));
        println!("rms from one lens: {own:.3} px, OpenCV's corners {opencv:.3} px");
        assert!(own <= opencv, "{own} {opencv}");
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

/// A point of the target and where it is seen.
type Corner = (Point, Pixel);

/// The photographs of one camera: their corners as found, and as OpenCV finds them.
#[derive(Default)]
struct Set {
    size: Option<ImageSize>,
    views: [Vec<Vec<Corner>>; 2],
}

/// Returns the root mean square distance from one fisheye lens for all views, along one axis; no corner is left out of it.
fn rms_px(views: &[Vec<Corner>], size: ImageSize) -> f64 {
    let lens = CHOICES.iter().find(|choice| choice.label() == "kannala_brandt k1 k2 k3 k4").unwrap();
    let matrix = CameraMatrix { fx_px: 300.0, fy_px: 300.0, cx_px: 300.0, cy_px: 300.0 };
    let any = Camera { lens: KannalaBrandt::new(matrix, &[0.0; 4]).unwrap().into(), size: Some(size) };
    let seen = |(x, pixel): &Corner| Correspondence::new(&any, *x, *pixel, 0.2).unwrap();
    let seen: Vec<Vec<_>> = views.iter().map(|view| view.iter().map(seen).collect()).collect();
    let config = IntrinsicsConfig { models: Models::Only(*lens), ..IntrinsicsConfig::default() };
    let IntrinsicsOutcome::Solved(solved) = solve_intrinsics(&seen, size, &config).unwrap() else {
        panic!("no lens")
    };
    let (mut sum, mut n) = (0.0, 0);
    for view in &solved.views {
        for (x, pixel) in &views[view.view] {
            sum += (solved.camera.project(&(view.cam_from_target * *x)).unwrap() - pixel).norm_squared();
            n += 2;
        }
    }
    let rejected: usize = views.iter().map(Vec::len).sum::<usize>() - n / 2;
    assert_eq!(rejected, 0, "views left out");
    (sum / f64::from(n as u32)).sqrt()
}

/// Returns OpenCV's position of each corner, numbered the way that fits best of the eight that turn or mirror a board.
fn numbered(found: &[Detection], opencv: &[Pixel], rows: u32, columns: u32) -> Vec<Pixel> {
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
    let pixels = |number: &&dyn Fn(u32) -> u32| -> Vec<Pixel> {
        found.iter().map(|d| opencv[number(d.feature.id) as usize]).collect()
    };
    let sum =
        |theirs: &Vec<Pixel>| found.iter().zip(theirs).map(|(d, own)| (d.pixel - own).norm()).sum::<f64>();
    numberings.iter().map(pixels).min_by(|a, b| sum(a).total_cmp(&sum(b))).unwrap()
}
