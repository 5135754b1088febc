//! The faults, and how each is corrected.

use super::Origin;
use crate::camera::{BrownConrady, CameraMatrix, ImageSize, Pinhole};
use crate::correspondence::PixelCovariance;
use crate::{Camera, Correspondence, Lens as LensModel, Pixel, Point};
use core::mem::discriminant;

/// A likely fault of points or intrinsics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fault {
    /// u and v are exchanged.
    PixelsExchanged,
    /// v is counted from the bottom of the image.
    RowsUpwards,
    /// u is counted from the right of the image.
    ColumnsLeftwards,
    /// Two axes of the points are exchanged.
    AxesExchanged,
    /// One axis of the points is reversed.
    AxisReversed,
    /// One axis of the points is in another unit than the others.
    AxisUnit {
        /// x, y or z: 0, 1 or 2.
        axis: usize,
        /// The number by which the coordinate is multiplied.
        factor: f64,
    },
    /// Each pixel is that of the row above (`rows` = 1) or below (−1).
    LabelsShifted {
        /// Number of rows.
        rows: isize,
    },
    /// The rows and columns of a grid are exchanged.
    GridExchanged {
        /// The points are numbered along the columns; else along the rows, of a grid with as many columns as this one has rows.
        along_columns: bool,
    },
    /// The pixels of two points are exchanged.
    LabelsExchanged {
        /// Index of the one.
        a: usize,
        /// Index of the other, which is larger.
        b: usize,
    },
    /// The intrinsics are those of images of another size than the pixels.
    OtherResolution {
        /// Size of the images of the pixels.
        size: ImageSize,
    },
    /// The coefficients of the lens are in the order p1, p2, k1, k2.
    CoefficientOrder,
    /// The pixels are undistorted already.
    UndistortedAlready,
    /// The focal length is another one.
    OtherFocalLength {
        /// The estimate.
        focal_px: f64,
    },
    /// The principal point is another one, as of a crop.
    OtherCrop {
        /// The estimate.
        principal_point_px: Pixel,
    },
    /// The lens has distortion, of which nothing is stated.
    Distorted {
        /// The estimate.
        k1: f64,
        /// The estimate.
        k2: f64,
    },
}

/// Image sizes over those of the intrinsics, as fractions, that are tried.
const RESOLUTIONS: [[u32; 2]; 10] =
    [[1, 4], [1, 3], [1, 2], [2, 3], [3, 4], [4, 3], [3, 2], [2, 1], [3, 1], [4, 1]];

const fn unit(axis: usize, factor: f64) -> Fault {
    Fault::AxisUnit { axis, factor }
}

impl Fault {
    /// The faults of points that concern all of them.
    pub(super) const POINTS: [Fault; 13] = [
        Fault::PixelsExchanged,
        Fault::RowsUpwards,
        Fault::ColumnsLeftwards,
        Fault::AxisReversed,
        Fault::AxesExchanged,
        unit(0, 1e3),
        unit(1, 1e3),
        unit(2, 1e3),
        unit(0, 1e-3),
        unit(1, 1e-3),
        unit(2, 1e-3),
        Fault::GridExchanged { along_columns: false },
        Fault::GridExchanged { along_columns: true },
    ];
    /// Returns whether points of that origin can have a fault that concerns all of them.
    pub(super) fn is_possible(&self, origin: Origin) -> bool {
        origin == Origin::Table || *self == Fault::ColumnsLeftwards
    }

    /// Rows that slipped.
    pub(super) const SHIFTS: [Fault; 2] =
        [Fault::LabelsShifted { rows: 1 }, Fault::LabelsShifted { rows: -1 }];

    /// Returns the faults of the intrinsics that a camera can have.
    pub(super) fn of_lens(camera: &Camera) -> Vec<Fault> {
        let mut faults = Vec::new();
        if let Some(size) = camera.size.filter(|_| camera.matrix().is_some()) {
            faults.extend(
                RESOLUTIONS
                    .iter()
                    .filter_map(|ratio| scaled(size, *ratio))
                    .map(|size| Fault::OtherResolution { size }),
            );
            faults.push(Fault::OtherFocalLength { focal_px: 0.0 });
            faults.push(Fault::OtherCrop { principal_point_px: Pixel::zeros() });
        }
        match (camera.matrix(), is_distorted(camera)) {
            (Some(_), true) => faults.extend([Fault::CoefficientOrder, Fault::UndistortedAlready]),
            (Some(_), false) => faults.push(Fault::Distorted { k1: 0.0, k2: 0.0 }),
            (None, _) => {}
        }
        faults
    }

    /// Returns the odds of the fault, beforehand, against one that is not in the list.
    pub(super) fn odds(&self) -> f64 {
        match self {
            Fault::RowsUpwards
            | Fault::AxisReversed
            | Fault::UndistortedAlready
            | Fault::Distorted { .. } => 0.1,
            Fault::PixelsExchanged
            | Fault::AxesExchanged
            | Fault::GridExchanged { .. }
            | Fault::OtherResolution { .. } => 0.05,
            Fault::OtherFocalLength { .. } | Fault::ColumnsLeftwards | Fault::CoefficientOrder => 0.03,
            Fault::OtherCrop { .. } | Fault::LabelsShifted { .. } => 0.02,
            Fault::AxisUnit { .. } => 0.005,
            Fault::LabelsExchanged { .. } => 0.002,
        }
    }

    /// Returns the number of parameters that its correction estimates.
    pub(super) fn n_parameters(&self) -> usize {
        match self {
            Fault::OtherFocalLength { .. } => 1,
            Fault::OtherCrop { .. } | Fault::Distorted { .. } => 2,
            _ => 0,
        }
    }

    /// Two faults of one kind exclude each other; a focal length and a resolution are of one kind.
    pub(super) fn kind(&self) -> core::mem::Discriminant<Fault> {
        discriminant(match self {
            Fault::OtherResolution { .. } => &Fault::OtherFocalLength { focal_px: 0.0 },
            Fault::AxesExchanged => &Fault::AxisReversed,
            other => other,
        })
    }

    /// Returns whether both faults can be there at once, and are more than one of them.
    pub(super) fn goes_with(&self, other: &Fault) -> bool {
        let kinds = [self.kind(), other.kind()];
        let are_coefficients =
            |fault: &Fault| matches!(fault, Fault::CoefficientOrder | Fault::UndistortedAlready);
        kinds[0] != kinds[1]
            && !(are_coefficients(self) && are_coefficients(other))
            && ![self, other].contains(&&Fault::AxesExchanged)
    }

    /// Returns the fault with what was estimated.
    pub(super) fn estimated(self, camera: &Camera) -> Fault {
        let Some(CameraMatrix { fx_px, cx_px, cy_px, .. }) = camera.matrix() else { return self };
        match (self, &camera.lens) {
            (Fault::OtherFocalLength { .. }, _) => Fault::OtherFocalLength { focal_px: fx_px },
            (Fault::OtherCrop { .. }, _) => Fault::OtherCrop { principal_point_px: Pixel::new(cx_px, cy_px) },
            (Fault::Distorted { .. }, LensModel::BrownConrady(lens)) => {
                let [k1, k2] = [0, 1].map(|i| lens.coefficients().get(i).copied().unwrap_or_default());
                Fault::Distorted { k1, k2 }
            }
            (fault, _) => fault,
        }
    }
}

/// Returns the size times a fraction, where that is a whole number of pixels.
fn scaled(size: ImageSize, [times, over]: [u32; 2]) -> Option<ImageSize> {
    let side = |side: u32| side.is_multiple_of(over).then(|| (side / over).checked_mul(times))?;
    Some(ImageSize { width_px: side(size.width_px)?, height_px: side(size.height_px)? })
}

fn is_distorted(camera: &Camera) -> bool {
    match &camera.lens {
        LensModel::Pinhole(_) => false,
        LensModel::BrownConrady(lens) => lens.coefficients().iter().any(|c| *c != 0.0),
        _ => true,
    }
}

/// What is estimated of the lens with the pose; nothing by default.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Free {
    pub(super) focal: bool,
    pub(super) centre: bool,
    /// None, or k1 and k2.
    pub(super) n_coefficients: usize,
}

impl Free {
    /// A lens of which nothing is known.
    pub(crate) const LENS: Free = Free { focal: true, centre: true, n_coefficients: 2 };

    pub(super) fn n_parameters(&self) -> usize {
        usize::from(self.focal) + 2 * usize::from(self.centre) + self.n_coefficients
    }
}

/// The points of a view.
pub(super) type View = Vec<Correspondence>;

/// Views of one camera with corrections.
#[derive(Debug, Clone)]
pub(super) struct Trial {
    /// Their bearings are those of the camera as stated.
    pub(super) views: Vec<View>,
    pub(super) camera: Camera,
    pub(super) free: Free,
    /// How many are corrected at once.
    pub(super) n_faults: usize,
}

impl Trial {
    /// Corrects the faults; `None` where one of them cannot be.
    pub(super) fn new(
        views: &[&[Correspondence]],
        camera: &Camera,
        free: Free,
        faults: &[Fault],
    ) -> Option<Self> {
        let views = views.iter().map(|seen| seen.to_vec()).collect();
        let mut trial = Trial { views, camera: camera.clone(), free, n_faults: faults.len() };
        // Pixels follow, because the last row is that of an image of the corrected size.
        faults.iter().try_for_each(|fault| trial.correct_lens(fault))?;
        faults.iter().try_for_each(|fault| trial.correct_points(fault))?;
        Some(trial)
    }

    fn correct_lens(&mut self, fault: &Fault) -> Option<()> {
        match fault {
            Fault::OtherResolution { size } => {
                self.camera = self.camera.scaled_to(size.width_px, size.height_px).ok()?;
            }
            Fault::CoefficientOrder => self.camera = reordered(&self.camera)?,
            Fault::UndistortedAlready => {
                let lens = LensModel::from(Pinhole { matrix: self.camera.matrix()? });
                self.camera = Camera { lens, size: self.camera.size };
            }
            Fault::Distorted { .. } => {
                let lens = BrownConrady::new(self.camera.matrix()?, &[0.0; 4]).ok()?;
                self.camera = Camera { lens: lens.into(), size: self.camera.size };
                self.free.n_coefficients = 2;
            }
            Fault::OtherFocalLength { .. } => self.free.focal = true,
            Fault::OtherCrop { .. } => self.free.centre = true,
            _ => {}
        }
        Some(())
    }

    fn correct_points(&mut self, fault: &Fault) -> Option<()> {
        let size =
            self.camera.size.map(|size| [size.width_px, size.height_px].map(|side| f64::from(side) - 1.0));
        match *fault {
            Fault::PixelsExchanged => self.each(|c| {
                c.pixel = Pixel::new(c.pixel.y, c.pixel.x);
                c.covariance_px2 = c.covariance_px2.map(|covariance| covariance.with_axes_exchanged());
            }),
            Fault::RowsUpwards => {
                let [_, last] = size?;
                self.each(|c| mirror(c, Pixel::new(c.pixel.x, last - c.pixel.y)));
            }
            Fault::ColumnsLeftwards => {
                let [last, _] = size?;
                self.each(|c| mirror(c, Pixel::new(last - c.pixel.x, c.pixel.y)));
            }
            Fault::AxesExchanged => self.each(|c| c.x_in_target.swap_rows(0, 1)),
            Fault::AxisReversed => self.each(|c| c.x_in_target.y = -c.x_in_target.y),
            Fault::AxisUnit { axis, factor } => self.each(|c| c.x_in_target[axis] *= factor),
            Fault::LabelsShifted { rows } => self.views.iter_mut().try_for_each(|seen| shift(seen, rows))?,
            Fault::GridExchanged { along_columns } => {
                let grid = Grid::of(self.views.iter().flatten())?;
                self.each(|c| c.x_in_target = grid.exchanged(&c.x_in_target, along_columns));
            }
            Fault::LabelsExchanged { a, b } => {
                let seen = self.views.first_mut()?;
                let x_in_target = seen.get(a)?.x_in_target;
                seen[a].x_in_target = core::mem::replace(&mut seen.get_mut(b)?.x_in_target, x_in_target);
            }
            _ => {}
        }
        Some(())
    }

    fn each(&mut self, change: impl Fn(&mut Correspondence)) {
        self.views.iter_mut().flatten().for_each(change);
    }
}

/// Moves each pixel to the row above, or below; the row at the end has none, and is left out.
fn shift(seen: &mut View, rows: isize) -> Option<()> {
    let points: Vec<_> = seen.iter().map(|c| c.x_in_target).collect();
    let of = |(i, c): (usize, &Correspondence)| {
        let x_in_target = *points.get(i.checked_add_signed(-rows)?)?;
        Some(Correspondence { x_in_target, ..*c })
    };
    *seen = seen.iter().enumerate().filter_map(of).collect();
    (!seen.is_empty()).then_some(())
}

/// A grid of points in the plane of x and y: the first one, the pitch along both axes, and the numbers of columns and rows, which differ.
struct Grid {
    first: Point,
    pitch: [f64; 2],
    n: [usize; 2],
}

/// Points are on a grid within this part of its pitch.
const ON_GRID: f64 = 0.01;

impl Grid {
    fn of<'a>(points: impl Iterator<Item = &'a Correspondence> + Clone) -> Option<Self> {
        let (mut first, mut pitch, mut n) = (points.clone().next()?.x_in_target, [0.0; 2], [0; 2]);
        for axis in 0..2 {
            let mut at: Vec<f64> = points.clone().map(|c| c.x_in_target[axis]).collect();
            at.sort_by(f64::total_cmp);
            let gaps = || at.windows(2).map(|pair| pair[1] - pair[0]);
            let largest = gaps().fold(0.0, f64::max);
            let is_pitch = |gap: f64| gap < ON_GRID * largest || (1.0 - ON_GRID) * largest < gap;
            if largest <= 0.0 || !gaps().all(is_pitch) {
                return None;
            }
            (first[axis], pitch[axis]) = (at[0], largest);
            n[axis] = 1 + gaps().filter(|gap| ON_GRID * largest <= *gap).count();
        }
        (n[0] != n[1]).then_some(Grid { first, pitch, n })
    }

    fn exchanged(&self, x: &Point, along_columns: bool) -> Point {
        let [column, row] =
            [0, 1].map(|axis| ((x[axis] - self.first[axis]) / self.pitch[axis]).round() as usize);
        let [n_columns, n_rows] = self.n;
        let (number, of_row) = match along_columns {
            true => (column * n_rows + row, n_columns),
            false => (row * n_columns + column, n_rows),
        };
        let at = |axis: usize, i: usize| self.first[axis] + i as f64 * self.pitch[axis];
        Point::new(at(0, number % of_row), at(1, number / of_row), x.z)
    }
}

fn mirror(c: &mut Correspondence, pixel: Pixel) {
    c.pixel = pixel;
    let covariance = |c: PixelCovariance| PixelCovariance { uv_px2: -c.uv_px2, ..c };
    c.covariance_px2 = c.covariance_px2.map(covariance);
}

/// Returns the camera with its first two coefficients and the next two exchanged.
fn reordered(camera: &Camera) -> Option<Camera> {
    let LensModel::BrownConrady(lens) = &camera.lens else { return None };
    let mut coefficients: Vec<f64> = lens.coefficients().to_vec();
    coefficients.get_mut(..4)?.rotate_left(2);
    let lens = BrownConrady::new(lens.matrix(), &coefficients).ok()?;
    Some(Camera { lens: lens.into(), size: camera.size })
}
