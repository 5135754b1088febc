//! The AprilTag C library 3.4.5 (E. Olson, "AprilTag: A robust and flexible visual fiducial system", ICRA 2011;
//! J. Wang and E. Olson, IROS 2016) behind a safe interface.
//!
//! The only module of this crate with `unsafe`. Rules it keeps:
//! * `apriltag_detector_t` is only touched through the pointer the library returned: its Rust declaration may be
//!   longer than the C one (mutex size differs between systems), so it is never copied or referenced as a whole.
//! * one detector per thread and `nthreads = 1`: the library's parallel segmentation has a data race.
//! * the library puts pixel centres at +0.5 and starts corners at the bottom-left; both become ours here and nowhere
//!   else: pixel (0, 0) is a centre, corners run 0 top-left, 1 top-right, 2 bottom-right, 3 bottom-left.
#![allow(unsafe_code)]

use super::family::Family;
use super::stop;
use crate::GrayImage;
use apriltag_sys as c;
use resight_core::Pixel;
use std::ffi::c_int;
use std::ptr::NonNull;

/// A decoded tag.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DecodedTag {
    /// Index of the family in the order given to [`QuadDecoder::new`].
    pub family: usize,
    /// Id in its family.
    pub id: u32,
    /// Mean distance of the bits from the black/white threshold, grey levels (the smaller of black and white).
    pub margin_gray: f64,
    /// Corners 0 top-left, 1 top-right, 2 bottom-right, 3 bottom-left of the upright tag, pixels.
    pub corners: [Pixel; 4],
}

/// Which image is used to measure the edges of a quad before its bits are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Edges {
    /// The reduced image, by the outline: accurate enough to decode a large tag, in half of the time of a search.
    Outline,
    /// The image at full size, to which the edges are fitted again.
    FullSize,
}

/// Smallest image edge, pixels, handed to the library: it thresholds in 4 × 4 tiles of the decimated image and
/// looks at neighbouring tiles.
const MIN_EDGE_PX: u32 = 32;

/// Longest edge, pixels, of the reduced image: the library keeps twice a coordinate in 16 bits and aborts beyond this.
const MAX_EDGE_PX: f32 = 32_767.0;

/// Largest number of pixels of an image: the library counts its bytes in a signed 32-bit number.
const MAX_PIXELS: usize = 1 << 30;

/// A detector of the library with its families.
pub(super) struct QuadDecoder {
    detector: NonNull<c::apriltag_detector_t>,
    families: Vec<NonNull<OwnedFamily>>,
}

/// The C view of a family and the tables it points into; lives at a fixed address while the library knows it.
struct OwnedFamily {
    view: c::apriltag_family_t,
    ids: Vec<u32>,
    codes: Vec<u64>,
    bit_x: Vec<u32>,
    bit_y: Vec<u32>,
}

// SAFETY: the pointers are owned by this value alone, the library keeps no thread-local state, and with nthreads = 1
// it starts no thread of its own (workerpool runs the tasks in the calling thread).
unsafe impl Send for QuadDecoder {}

impl QuadDecoder {
    /// Builds a detector for these families; `None` when the library is out of memory.
    pub fn new(families: &[Family]) -> Option<Self> {
        // SAFETY: no preconditions; a null result is handled.
        let detector = NonNull::new(unsafe { c::apriltag_detector_create() })?;
        let mut decoder = QuadDecoder { detector, families: Vec::with_capacity(families.len()) };
        // SAFETY: the pointer is the library's own; only the leading fields, whose offsets agree, are written.
        unsafe {
            (*detector.as_ptr()).nthreads = 1;
            // A blur would be applied in place to our image when decimate is 1; `detect` relies on it being off.
            (*detector.as_ptr()).quad_sigma = 0.0;
        }
        for family in families {
            let owned = OwnedFamily::boxed(family);
            decoder.families.push(owned);
            let bits = family.correctable_bits() as c_int;
            // SAFETY: detector and family are valid until `drop`, which unregisters before it frees.
            unsafe {
                c::apriltag_detector_add_family_bits(detector.as_ptr(), &raw mut (*owned.as_ptr()).view, bits)
            };
        }
        Some(decoder)
    }

    /// Sets the least contrast: from the next search on, tiles with smaller differences of grey levels hold no outline (default of the library:
    /// 5).
    pub fn set_least_contrast(&mut self, gray: u8) {
        // SAFETY: the pointer is the library's own; the field lies among the leading ones, whose offsets agree.
        unsafe { (*self.detector.as_ptr()).qtp.min_white_black_diff = gray.into() };
    }

    /// Finds tags; quads are sought in the image reduced `decimate` times, bits read at full size. None are found in an image whose
    /// dimensions the library cannot take; `tiles::search` cuts such images into tiles that it can.
    pub fn detect(&mut self, image: &GrayImage, decimate: f32, edges: Edges) -> Vec<DecodedTag> {
        let pixels = image.width_px as usize * image.height_px as usize;
        let smallest = image.width_px.min(image.height_px) as f32;
        let longest = image.width_px.max(image.height_px) as f32;
        let fits = MIN_EDGE_PX as f32 * decimate <= smallest && longest <= MAX_EDGE_PX * decimate;
        if !fits || !(1.0..=64.0).contains(&decimate) || MAX_PIXELS < pixels || image.data.len() != pixels {
            return Vec::new();
        }
        if stop::is_stopped() {
            return Vec::new();
        }
        #[cfg(test)]
        super::work::count((pixels as f32 / (decimate * decimate)) as usize);
        let mut view = c::image_u8_t {
            width: image.width_px as i32,
            height: image.height_px as i32,
            stride: image.width_px as i32,
            buf: image.data.as_ptr().cast_mut(),
        };
        // SAFETY: the view describes exactly `image.data` (length checked above) which outlives the call; with
        // quad_sigma = 0 the library only reads it. The returned array is freed below, after it has been copied.
        unsafe {
            (*self.detector.as_ptr()).quad_decimate = decimate;
            (*self.detector.as_ptr()).refine_edges = edges == Edges::FullSize;
            let found = c::apriltag_detector_detect(self.detector.as_ptr(), &raw mut view);
            if found.is_null() {
                return Vec::new();
            }
            let n = (*found).size.max(0) as usize;
            let entries = (*found).data.cast::<*const c::apriltag_detection_t>();
            let tags = (0..n).filter_map(|i| self.decoded(*entries.add(i))).collect();
            c::apriltag_detections_destroy(found);
            tags
        }
    }

    /// Copies a detection of the library.
    ///
    /// # Safety
    /// `found` points to a detection of this detector that has not been destroyed.
    unsafe fn decoded(&self, found: *const c::apriltag_detection_t) -> Option<DecodedTag> {
        // SAFETY: by the contract of this function; the families are those registered in `new`, alive until `drop`.
        let (family, code, margin, p) = unsafe {
            let view = (*found).family.cast_const();
            let family =
                self.families.iter().position(|f| std::ptr::eq(&raw const (*f.as_ptr()).view, view))?;
            (family, (*found).id, (*found).decision_margin, (*found).p)
        };
        // SAFETY: as above; no mutable reference to the family exists while it is read.
        let ids = unsafe { &(*self.families[family].as_ptr()).ids };
        let id = ids.get(code as usize).copied()?;
        // The library: bottom-left, bottom-right, top-right, top-left; pixel centres at +0.5.
        let corners = [3, 2, 1, 0].map(|k: usize| Pixel::new(p[k][0] - 0.5, p[k][1] - 0.5));
        let finite = corners.iter().all(|corner| corner.iter().all(|x| x.is_finite()));
        finite.then_some(DecodedTag { family, id, margin_gray: margin as f64, corners })
    }
}

impl Drop for QuadDecoder {
    fn drop(&mut self) {
        // SAFETY: both kinds of pointer were created by `new` and are freed once, here. Destroying the detector
        // first unregisters the families and frees what the library attached to them (`impl`).
        unsafe {
            c::apriltag_detector_destroy(self.detector.as_ptr());
            for family in self.families.drain(..) {
                drop(Box::from_raw(family.as_ptr()));
            }
        }
    }
}

impl OwnedFamily {
    fn boxed(family: &Family) -> NonNull<Self> {
        let unsigned = |cells: &[i32]| cells.iter().map(|&cell| cell as u32).collect::<Vec<u32>>();
        let mut owned = Box::new(OwnedFamily {
            // SAFETY: a plain C struct of integers and pointers, for which all zero bytes are valid.
            view: unsafe { std::mem::zeroed() },
            ids: family.ids.clone(),
            codes: family.codes.clone(),
            // Negative cells (data outside the border) wrap; the library reads them back as int.
            bit_x: unsigned(&family.bit_x),
            bit_y: unsigned(&family.bit_y),
        });
        owned.view.ncodes = owned.codes.len() as u32;
        owned.view.codes = owned.codes.as_mut_ptr();
        owned.view.width_at_border = family.border_width;
        owned.view.total_width = family.total_width;
        owned.view.reversed_border = family.reversed_border;
        owned.view.nbits = owned.bit_x.len() as u32;
        owned.view.bit_x = owned.bit_x.as_mut_ptr();
        owned.view.bit_y = owned.bit_y.as_mut_ptr();
        owned.view.h = family.hamming_distance;
        NonNull::from(Box::leak(owned))
    }
}

type Create = unsafe extern "C" fn() -> *mut c::apriltag_family_t;
type Destroy = unsafe extern "C" fn(*mut c::apriltag_family_t);

/// Returns the functions with which the library makes and frees a family; `None` for an unknown name.
fn functions(name: &str) -> Option<(Create, Destroy)> {
    Some(match name {
        "tag36h11" => (c::tag36h11_create, c::tag36h11_destroy),
        "tag25h9" => (c::tag25h9_create, c::tag25h9_destroy),
        "tag16h5" => (c::tag16h5_create, c::tag16h5_destroy),
        "tagStandard41h12" => (c::tagStandard41h12_create, c::tagStandard41h12_destroy),
        "tagStandard52h13" => (c::tagStandard52h13_create, c::tagStandard52h13_destroy),
        "tagCircle21h7" => (c::tagCircle21h7_create, c::tagCircle21h7_destroy),
        "tagCircle49h12" => (c::tagCircle49h12_create, c::tagCircle49h12_destroy),
        "tagCustom48h12" => (c::tagCustom48h12_create, c::tagCustom48h12_destroy),
        _ => return None,
    })
}

/// The library's own drawing of a tag with its white rim, which the renderer uses; it does not depend on the detector's tables.
pub(crate) struct Drawing {
    /// Cells along each side.
    pub per_side: usize,
    /// Cells along the side of the square whose corners are detected.
    pub per_size: usize,
    /// Row by row, true is white.
    pub white: Vec<bool>,
}

/// Draws a tag; `Err` holds the number of ids if the id does not exist. `None` for an unknown family.
pub(crate) fn drawing(name: &str, id: u32) -> Option<Result<Drawing, usize>> {
    let (create, destroy) = functions(name)?;
    // SAFETY: create returns null or a valid family; `apriltag_to_image` needs id < ncodes, checked before, and returns null
    // or an image of `height` rows of `stride` bytes. Each object is destroyed once, after its last use.
    unsafe {
        let raw = create();
        if raw.is_null() {
            return None;
        }
        let (count, per_size) = ((*raw).ncodes, (*raw).width_at_border as usize);
        let picture = if id < count { c::apriltag_to_image(raw, id) } else { std::ptr::null_mut() };
        destroy(raw);
        if picture.is_null() {
            return Some(Err(count as usize));
        }
        let (per_side, stride) = ((*picture).width as usize, (*picture).stride as usize);
        let bytes = std::slice::from_raw_parts((*picture).buf, stride * per_side);
        let white = bytes.chunks(stride).flat_map(|row| row[..per_side].iter().map(|b| 127 < *b)).collect();
        c::image_u8_destroy(picture);
        Some(Ok(Drawing { per_side, per_size, white }))
    }
}

/// Returns the tables of a family built into the library; `None` for an unknown name.
pub(super) fn builtin_family(name: &str) -> Option<Family> {
    let (create, destroy) = functions(name)?;
    // SAFETY: create returns null or a family whose tables have the lengths it states; it is destroyed once, after
    // everything has been copied.
    unsafe {
        let raw = create();
        if raw.is_null() {
            return None;
        }
        let n_bits = (*raw).nbits as usize;
        let cells =
            |table: *const u32| std::slice::from_raw_parts(table, n_bits).iter().map(|&x| x as i32).collect();
        let family = Family {
            codes: std::slice::from_raw_parts((*raw).codes, (*raw).ncodes as usize).to_vec(),
            ids: (0..(*raw).ncodes).collect(),
            bit_x: cells((*raw).bit_x),
            bit_y: cells((*raw).bit_y),
            border_width: (*raw).width_at_border,
            total_width: (*raw).total_width,
            reversed_border: (*raw).reversed_border,
            hamming_distance: (*raw).h,
        };
        destroy(raw);
        Some(family)
    }
}
