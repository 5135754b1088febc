//! Counts the pixels that a search visits, in tests: a budget that does not depend on the load of a machine.

use std::cell::Cell;

thread_local! {
    static PIXELS: Cell<u64> = const { Cell::new(0) };
}

/// Counts pixels that a search of this thread visits.
pub(super) fn count(pixels: usize) {
    PIXELS.set(PIXELS.get() + pixels as u64);
}

/// Returns the number of pixels counted so far.
fn so_far() -> u64 {
    PIXELS.get()
}

/// Returns the number of pixels that a job visits.
pub(super) fn of(job: impl FnOnce()) -> u64 {
    PIXELS.set(0);
    job();
    PIXELS.get()
}

mod tests {
    use super::*;
    use crate::GrayImage;
    use crate::detect::every_tag::EveryTagFinder;
    use crate::detect::{Detector, absent, stop};
    use crate::render::clutter;
    use crate::render::{Finish, Placed, Scene, Style, render};
    use resight_core::camera::{ImageSize, Pinhole};
    use resight_core::target::{AprilGrid, Charuco, Chessboard, CircleGrid, Tag};
    use resight_core::{Camera, CameraMatrix, Lens, Point, Pose, Target};
    use std::rc::Rc;

    const SIZE: [u32; 2] = [1280, 960];

    fn camera() -> Camera {
        let matrix = CameraMatrix { fx_px: 1000.0, fy_px: 1000.0, cx_px: 639.5, cy_px: 479.5 };
        let size = Some(ImageSize { width_px: SIZE[0], height_px: SIZE[1] });
        Camera { lens: Lens::Pinhole(Pinhole { matrix }), size }
    }

    fn targets() -> Vec<Target> {
        let (family, dictionary) = ("tag36h11".to_owned(), "DICT_4X4_50".to_owned());
        vec![
            Target::Tag(Tag { family: family.clone(), id: 7, size_m: 0.1 }),
            Target::AprilGrid(AprilGrid {
                rows: 4,
                columns: 4,
                tag_size_m: 0.06,
                tag_spacing_ratio: 0.3,
                first_id: 0,
                family,
            }),
            Target::Charuco(Charuco {
                rows: 5,
                columns: 7,
                square_m: 0.04,
                marker_m: 0.03,
                dictionary,
                legacy_pattern: false,
            }),
            Target::Chessboard(Chessboard { rows: 6, columns: 9, square_m: 0.04 }),
            Target::CircleGrid(CircleGrid {
                rows: 11,
                columns: 4,
                spacing_m: 0.03,
                diameter_m: None,
                asymmetric: true,
            }),
        ]
    }

    /// A wall, bare or with spots and text, with the target or without.
    fn image(target: Option<&Target>, has_clutter: bool) -> GrayImage {
        let placed = target.map(|target| {
            let points: Vec<Point> =
                target.features().iter().filter_map(|f| target.point(*f)).map(|p| p.position).collect();
            let middle = points.iter().sum::<Point>() / points.len() as f64;
            let flip = if matches!(target, Target::AprilGrid(_)) { -1.0 } else { 1.0 };
            let facing = nalgebra::Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, flip, flip));
            let rotation = Pose::exp(&[0.2, -0.2, 0.1, 0.0, 0.0, 0.0].into()).rotation * facing;
            let cam_from_target = Pose::new(rotation, Point::new(0.0, 0.0, 0.8) - rotation * middle);
            Placed { target: target.clone(), cam_from_target, style: Style::default() }
        });
        let mut scene =
            Scene { placed: placed.into_iter().collect(), background: 120.0, clutter: Vec::new() };
        if has_clutter {
            scene.clutter.extend(clutter::dots(150, SIZE, [4.0, 30.0], 60.0, 1));
            scene.clutter.extend(clutter::words(120, SIZE, 14.0, 30.0, 2));
        }
        render(&scene, &camera(), &Finish::default()).unwrap()
    }

    /// Returns the largest allowed ratio of the costs without and with the target: 1.5 in general. Where an image has clutter and no tag or
    /// marker, outlines of the smallest and of shadowed ones are searched for at full size too, while an existing one is found at half, in a
    /// quarter of the pixels.
    fn most_times(target: &Target, has_clutter: bool) -> f64 {
        match target {
            Target::Tag(_) if has_clutter => 2.1,
            Target::Charuco(_) if has_clutter => 1.9,
            _ => 1.5,
        }
    }

    /// An image without its target costs a stated number of its pixels whatever it shows, and hardly more than one with the target.
    #[test]
    fn nothing_there_costs_no_more_than_something() {
        let mut too_much = Vec::new();
        for (target, most) in targets().iter().zip([0.7, 2.0, 0.7, 1.4, 1.0]) {
            let mut detector = Detector::new(target).unwrap();
            for has_clutter in [false, true] {
                let mut pixels = |target: Option<&Target>| {
                    let image = image(target, has_clutter);
                    of(|| {
                        let found = detector.detect(&image).unwrap();
                        assert_eq!(found.is_empty(), target.is_none());
                    }) as f64
                };
                let (found, nothing) = (pixels(Some(target)), pixels(None));
                let share = nothing / f64::from(SIZE[0] * SIZE[1]);
                let name = format!("{}, clutter {has_clutter}", target.kind());
                println!("{name}: {nothing} / {found} = {:.2}; {share:.2} of the image", nothing / found);
                if most_times(target, has_clutter) * found < nothing || most < share {
                    too_much.push(name);
                }
            }
        }
        assert!(too_much.is_empty(), "{too_much:?}");
    }

    /// Whenever a search is ended, no further pixel is visited, and nothing is answered; a search that is not ended is as it was.
    #[test]
    fn ended_searches_visit_no_further_pixel() {
        let image = image(None, true);
        let all = targets().into_iter().map(Some).chain([None]);
        for target in all {
            let name = target.as_ref().map_or("every tag", |target| target.kind());
            let search = || match &target {
                Some(target) => drop(absent::not_found(target, &image)),
                None => drop(EveryTagFinder::new("any").unwrap().find(&image)),
            };
            let (asked, visited) = (Rc::new(Cell::new(0)), Rc::new(Cell::new(0)));
            // Ends at the question of this number; returns the pixels that are visited later, and whether there is an answer.
            let ended_at = |last: usize| {
                asked.set(0);
                let (asked, at_end) = (Rc::clone(&asked), Rc::clone(&visited));
                let is_unwanted = move || {
                    asked.set(asked.get() + 1);
                    at_end.set(so_far());
                    last <= asked.get()
                };
                let mut is_answered = false;
                let all = of(|| is_answered = stop::unless(is_unwanted, search).is_some());
                (all - visited.get(), is_answered)
            };
            let whole = of(search);
            assert!(ended_at(usize::MAX).1, "{name}");
            assert_eq!(of(search), whole, "{name}");
            let n_asked = asked.get();
            assert!(3 < n_asked, "{name}: asked {n_asked} times");
            for last in [1, 2, 3, n_asked / 2, n_asked - 1] {
                assert_eq!(ended_at(last), (0, false), "{name}: ended at {last} of {n_asked}");
            }
        }
    }

    /// This holds for a covered lens or a black film, even where the image is as large as a file may be.
    #[test]
    fn a_blank_image_is_not_searched_whatever_its_size() {
        let blank = GrayImage::filled(65_535, 900, 128);
        let mut shaded = blank.clone();
        shaded.data.iter_mut().step_by(7).for_each(|gray| *gray += 3);
        for target in targets() {
            let mut detector = Detector::new(&target).unwrap();
            for image in [&blank, &shaded] {
                assert_eq!(of(|| assert!(detector.detect(image).unwrap().is_empty())), 0);
                assert_eq!(
                    of(|| assert!(absent::not_found(&target, image).contains("check that all of it"))),
                    0
                );
            }
        }
        // For an image with structure this does not hold.
        let image = image(None, true);
        assert_ne!(
            of(|| assert!(Detector::new(&targets()[0]).unwrap().detect(&image).unwrap().is_empty())),
            0
        );
    }
}
