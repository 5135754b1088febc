//! Reads from EXIF (CIPA DC-008) when an image was taken, with which lens, and in which direction the camera pointed.

/// Tags.
const ORIENTATION: u16 = 0x0112;
const MAKE: u16 = 0x010f;
const MODEL: u16 = 0x0110;
const FOCAL_LENGTH: u16 = 0x920a;
const FOCAL_LENGTH_IN_35_MM_FILM: u16 = 0xa405;
const PIXEL_X_DIMENSION: u16 = 0xa002;
const PIXEL_Y_DIMENSION: u16 = 0xa003;
const FOCAL_PLANE_X_RESOLUTION: u16 = 0xa20e;
const FOCAL_PLANE_Y_RESOLUTION: u16 = 0xa20f;
const FOCAL_PLANE_RESOLUTION_UNIT: u16 = 0xa210;
const EXIF_IFD: u16 = 0x8769;
const GPS_IFD: u16 = 0x8825;
const GPS_IMG_DIRECTION_REF: u16 = 0x0010;
const GPS_IMG_DIRECTION: u16 = 0x0011;
const DATE_TIME_ORIGINAL: u16 = 0x9003;
const OFFSET_TIME_ORIGINAL: u16 = 0x9011;
const SUB_SEC_TIME_ORIGINAL: u16 = 0x9291;
/// Types of values.
const ASCII: u16 = 2;
const SHORT: u16 = 3;
const LONG: u16 = 4;
const RATIONAL: u16 = 5;

/// Returns the time when a PNG or JPEG was taken, seconds since 1970; `None` where it is not stated. Without a stated offset from UTC the
/// camera's clock is assumed to run in UTC, so that differences between images of one camera are correct.
pub fn taken_s(picture: &[u8]) -> Option<f64> {
    of_exif(exif(picture)?)
}

/// The lens with which a photograph was taken.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ExifLens {
    /// The focal length, in millimetres, with which a 36 × 24 mm film would have the same diagonal field of view.
    pub focal_35mm: u16,
    /// Where it is from.
    pub source: FocalSource,
    /// Make and model of the camera, where stated.
    pub camera: Option<String>,
}

/// Where a focal length as of 35 mm film is from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FocalSource {
    /// It is stated: `FocalLengthIn35mmFilm`, or a data sheet.
    Stated,
    /// It is computed, from `FocalLength` and the size of the sensor by `FocalPlaneXResolution`.
    Sensor,
}

/// What a photograph's EXIF states of its camera, whether or not its lens follows from it.
#[derive(Debug, Clone, PartialEq)]
pub struct ExifCamera {
    /// Make and model, those that are stated.
    pub name: String,
    /// The model.
    pub model: Option<String>,
    /// `FocalLength`, in millimetres.
    pub focal_mm: Option<f64>,
}

/// Returns what a PNG or JPEG states of its camera; `None` where it names neither make nor model.
pub fn camera(picture: &[u8]) -> Option<ExifCamera> {
    camera_of(exif(picture)?)
}

fn camera_of(exif: &[u8]) -> Option<ExifCamera> {
    let (tiff, first) = first_list(exif)?;
    let details = lists(exif).map(|(_, _, details)| details);
    let focal_mm = details.and_then(|details| tiff.rational(details, FOCAL_LENGTH));
    let (make, model) = (tiff.text(first, MAKE), tiff.text(first, MODEL));
    let words: Vec<String> = make.into_iter().chain(model.clone()).collect();
    (!words.is_empty()).then(|| ExifCamera { name: words.join(" "), model, focal_mm })
}

/// Diagonal of film of 36 × 24 mm.
pub(crate) const FILM_DIAGONAL_MM: f64 = 43.266_615_305_567_87;

/// Returns the lens of a PNG or JPEG; `None` where it is neither stated nor follows from what is.
pub fn lens(picture: &[u8]) -> Option<ExifLens> {
    lens_of(exif(picture)?)
}

fn lens_of(exif: &[u8]) -> Option<ExifLens> {
    let (tiff, _, details) = lists(exif)?;
    let entry = tiff.entry(details, FOCAL_LENGTH_IN_35_MM_FILM, SHORT);
    let stated = entry.and_then(|entry| tiff.u16(entry + 8)).filter(|focal_35mm| 0 < *focal_35mm);
    let (focal_35mm, source) = match stated {
        Some(focal_35mm) => (focal_35mm, FocalSource::Stated),
        None => (by_sensor(&tiff, details)?, FocalSource::Sensor),
    };
    Some(ExifLens { focal_35mm, source, camera: camera_of(exif).map(|camera| camera.name) })
}

/// Smallest and largest diagonal of a sensor, mm: those of phones have 4 and more, those of medium format 55.
const SENSOR_DIAGONAL_MM: [f64; 2] = [3.0, 70.0];
/// By how much the pixels of a sensor may differ from squares, in parts: some cameras state a resolution of another axis or unit.
const NOT_SQUARE: f64 = 0.03;

/// Computes the focal length as of 35 mm film from that of the lens and the size of the sensor; `None` where no sensor can be so.
fn by_sensor(tiff: &Tiff, details: u32) -> Option<u16> {
    let unit_mm = match tiff.whole(details, FOCAL_PLANE_RESOLUTION_UNIT) {
        Some(3) => 10.0,
        Some(4) => 1.0,
        Some(5) => 1e-3,
        _ => 25.4,
    };
    let axes = [(PIXEL_X_DIMENSION, FOCAL_PLANE_X_RESOLUTION), (PIXEL_Y_DIMENSION, FOCAL_PLANE_Y_RESOLUTION)];
    let size_mm = axes.map(|(pixels, resolution)| {
        Some(f64::from(tiff.whole(details, pixels)?) / tiff.rational(details, resolution)? * unit_mm)
    });
    let [Some(width_mm), Some(height_mm)] = size_mm else { return None };
    let per_mm = axes.map(|(_, resolution)| tiff.rational(details, resolution));
    let [Some(across), Some(down)] = per_mm else { return None };
    let diagonal_mm = width_mm.hypot(height_mm);
    let focal_35mm = (tiff.rational(details, FOCAL_LENGTH)? * FILM_DIAGONAL_MM / diagonal_mm).round();
    let is_sensor = (SENSOR_DIAGONAL_MM[0]..=SENSOR_DIAGONAL_MM[1]).contains(&diagonal_mm);
    let is_square = (across / down - 1.0).abs() <= NOT_SQUARE;
    let is_lens = (1.0..f64::from(u16::MAX)).contains(&focal_35mm);
    (is_sensor && is_square && is_lens).then_some(focal_35mm as u16)
}

/// The direction of a camera according to its compass: some ten degrees off if hand-held, more beside iron.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Heading {
    /// `GPSImgDirection`: clockwise from north, degrees.
    pub deg: f64,
    /// Whether it is relative to magnetic north instead of true north.
    pub is_magnetic: bool,
}

/// Returns the direction of the camera of a PNG or JPEG; `None` where it is not stated.
pub fn heading(picture: &[u8]) -> Option<Heading> {
    heading_of(exif(picture)?)
}

fn heading_of(exif: &[u8]) -> Option<Heading> {
    let (tiff, first) = first_list(exif)?;
    let gps = tiff.u32(tiff.entry(first, GPS_IFD, LONG)? + 8)?;
    let deg = tiff.rational(gps, GPS_IMG_DIRECTION)?;
    let is_magnetic = tiff.text(gps, GPS_IMG_DIRECTION_REF).is_some_and(|reference| reference == "M");
    (0.0..=360.0).contains(&deg).then_some(Heading { deg, is_magnetic })
}

/// Describes how a viewer rotates or mirrors the stored pixels of a PNG or JPEG before it shows them; `None` where it shows them unchanged.
pub fn orientation(picture: &[u8]) -> Option<&'static str> {
    orientation_of(exif(picture)?)
}

fn orientation_of(exif: &[u8]) -> Option<&'static str> {
    let (tiff, first) = first_list(exif)?;
    Some(match tiff.u16(tiff.entry(first, ORIENTATION, SHORT)? + 8)? {
        2 => "mirrored left to right",
        3 => "rotated by 180°",
        4 => "mirrored top to bottom",
        5 => "mirrored and rotated by 90° counter-clockwise",
        6 => "rotated by 90° clockwise",
        7 => "mirrored and rotated by 90° clockwise",
        8 => "rotated by 90° counter-clockwise",
        _ => return None,
    })
}

fn exif(picture: &[u8]) -> Option<&[u8]> {
    super::header::exif(picture)
}

/// Returns the block and its first list.
fn first_list(exif: &[u8]) -> Option<(Tiff<'_>, u32)> {
    let tiff = Tiff::new(exif.strip_prefix(b"Exif\0\0").unwrap_or(exif))?;
    let first = tiff.u32(4)?;
    Some((tiff, first))
}

/// Returns the block, its first list and the list of details.
fn lists(exif: &[u8]) -> Option<(Tiff<'_>, u32, u32)> {
    let (tiff, first) = first_list(exif)?;
    let details = tiff.u32(tiff.entry(first, EXIF_IFD, LONG)? + 8)?;
    Some((tiff, first, details))
}

fn of_exif(exif: &[u8]) -> Option<f64> {
    let (tiff, _, details) = lists(exif)?;
    let local_s = seconds(&tiff.text(details, DATE_TIME_ORIGINAL)?)?;
    let fraction_s = tiff.text(details, SUB_SEC_TIME_ORIGINAL).and_then(|digits| fraction(&digits));
    let offset_s = tiff.text(details, OFFSET_TIME_ORIGINAL).and_then(|text| offset(&text));
    Some(local_s as f64 + fraction_s.unwrap_or(0.0) - offset_s.unwrap_or(0) as f64)
}

/// A TIFF block: a header with the byte order, then lists of twelve-byte entries.
struct Tiff<'a> {
    bytes: &'a [u8],
    is_little_endian: bool,
}

impl<'a> Tiff<'a> {
    fn new(bytes: &'a [u8]) -> Option<Self> {
        let is_little_endian = match bytes.get(..4)? {
            b"II*\0" => true,
            b"MM\0*" => false,
            _ => return None,
        };
        Some(Tiff { bytes, is_little_endian })
    }

    fn array<const N: usize>(&self, at: u32) -> Option<[u8; N]> {
        let at = at as usize;
        self.bytes.get(at..at.checked_add(N)?)?.try_into().ok()
    }

    fn u16(&self, at: u32) -> Option<u16> {
        let bytes = self.array(at)?;
        Some(if self.is_little_endian { u16::from_le_bytes(bytes) } else { u16::from_be_bytes(bytes) })
    }

    fn u32(&self, at: u32) -> Option<u32> {
        let bytes = self.array(at)?;
        Some(if self.is_little_endian { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) })
    }

    /// Returns where the entry with a tag and type begins in the list at `list`.
    fn entry(&self, list: u32, tag: u16, kind: u16) -> Option<u32> {
        let places = (0..self.u16(list)?).map(|i| list.checked_add(2 + 12 * u32::from(i)));
        places.flatten().find(|at| self.u16(*at) == Some(tag) && self.u16(at.saturating_add(2)) == Some(kind))
    }

    /// Reads a whole number of either size.
    fn whole(&self, list: u32, tag: u16) -> Option<u32> {
        match self.entry(list, tag, SHORT) {
            Some(entry) => self.u16(entry + 8).map(u32::from),
            None => self.u32(self.entry(list, tag, LONG)? + 8),
        }
    }

    /// Reads a fraction; `None` where it is no number.
    fn rational(&self, list: u32, tag: u16) -> Option<f64> {
        let at = self.u32(self.entry(list, tag, RATIONAL)? + 8)?;
        let value = f64::from(self.u32(at)?) / f64::from(self.u32(at.checked_add(4)?)?);
        value.is_finite().then_some(value)
    }

    /// Reads a text; up to four bytes are in the entry itself.
    fn text(&self, list: u32, tag: u16) -> Option<String> {
        let entry = self.entry(list, tag, ASCII)?;
        let length = self.u32(entry + 4)?;
        let at = if length <= 4 { entry + 8 } else { self.u32(entry + 8)? } as usize;
        let bytes = self.bytes.get(at..at.checked_add(length as usize)?)?;
        let text = std::str::from_utf8(bytes).ok()?;
        Some(text.trim_end_matches('\0').trim().to_string())
    }
}

/// Converts `2026:03:14 15:09:26` to seconds since 1970.
fn seconds(text: &str) -> Option<i64> {
    let numbers: Vec<i64> = text.split([':', ' ']).map(|part| part.parse().ok()).collect::<Option<_>>()?;
    let [year, month, day, hour, minute, second] = numbers[..] else { return None };
    let is_date = (1900..10_000).contains(&year) && (1..=12).contains(&month) && (1..=31).contains(&day);
    let is_time = (0..24).contains(&hour) && (0..60).contains(&minute) && (0..=60).contains(&second);
    (is_date && is_time).then(|| ((days(year, month, day) * 24 + hour) * 60 + minute) * 60 + second)
}

/// Returns the days since 1970 of a date of the Gregorian calendar; years are counted from March, so that a leap day is the last of its year.
fn days(year: i64, month: i64, day: i64) -> i64 {
    let year = if month <= 2 { year - 1 } else { year };
    let day_of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    365 * year + year / 4 - year / 100 + year / 400 + day_of_year - 719_468
}

/// Reads a fraction: `25` is 0.25 s, as is `250`.
fn fraction(digits: &str) -> Option<f64> {
    let is_number = !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit());
    is_number.then(|| format!("0.{digits}").parse().ok())?
}

/// Converts `+02:00` to seconds.
fn offset(text: &str) -> Option<i64> {
    let (hours, minutes) = text.get(1..)?.split_once(':')?;
    let seconds = 3600 * hours.parse::<i64>().ok()? + 60 * minutes.parse::<i64>().ok()?;
    match text.as_bytes().first()? {
        b'+' => Some(seconds),
        b'-' => Some(-seconds),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::image::codecs::{jpeg::JpegEncoder, png::PngEncoder};
    use ::image::{ExtendedColorType, ImageEncoder};

    fn number(value: u32, size: usize, is_little: bool) -> Vec<u8> {
        let big = value.to_be_bytes()[4 - size..].to_vec();
        if is_little { big.into_iter().rev().collect() } else { big }
    }

    /// A block with `DateTimeOriginal` 2026:03:14 15:09:26, fraction .5 and two hours before UTC.
    fn block(is_little: bool) -> Vec<u8> {
        let n = |value, size| number(value, size, is_little);
        let entry = |tag, kind, count, value: Vec<u8>| [n(tag, 2), n(kind, 2), n(count, 4), value].concat();
        let begin = if is_little { b"II*\0".to_vec() } else { b"MM\0*".to_vec() };
        // The header ends at 8, the first list at 26, the second at 26 + 2 + 36 + 4 = 68; texts follow.
        let first = [n(1, 2), entry(0x8769, 4, 1, n(26, 4)), n(0, 4)].concat();
        let second = [
            n(3, 2),
            entry(0x9003, 2, 20, n(68, 4)),
            entry(0x9011, 2, 7, n(88, 4)),
            entry(0x9291, 2, 2, b"5\0\0\0".to_vec()),
            n(0, 4),
        ];
        let texts = b"2026:03:14 15:09:26\0+02:00\0".to_vec();
        [begin, n(8, 4), first, second.concat(), texts].concat()
    }

    /// Seconds by `date -u -d '2026-03-14 15:09:26' +%s`, less two hours, and half a second.
    #[test]
    fn both_byte_orders_are_read() {
        for is_little in [true, false] {
            assert_eq!(of_exif(&block(is_little)), Some(1_773_500_966.0 - 7200.0 + 0.5), "{is_little}");
        }
    }

    #[test]
    fn pictures_say_when_they_were_taken() {
        let (mut png, mut jpeg, pixels) = (Vec::new(), Vec::new(), [128; 64]);
        let mut to_png = PngEncoder::new(&mut png);
        to_png.set_exif_metadata(block(true)).expect("PNG holds EXIF");
        to_png.write_image(&pixels, 8, 8, ExtendedColorType::L8).expect("a PNG");
        let mut to_jpeg = JpegEncoder::new(&mut jpeg);
        to_jpeg.set_exif_metadata(block(false)).expect("JPEG holds EXIF");
        to_jpeg.write_image(&pixels, 8, 8, ExtendedColorType::L8).expect("a JPEG");
        for picture in [png, jpeg] {
            assert_eq!(taken_s(&picture), Some(1_773_493_766.5));
            assert_eq!(taken_s(&picture[..picture.len() / 4]), None);
        }
    }

    /// A phone: make, model and a focal length of 26 mm.
    #[test]
    fn the_lens_is_read() {
        for is_little in [true, false] {
            let n = |value, size| number(value, size, is_little);
            let entry =
                |tag, kind, count, value: Vec<u8>| [n(tag, 2), n(kind, 2), n(count, 4), value].concat();
            let begin = if is_little { b"II*\0".to_vec() } else { b"MM\0*".to_vec() };
            // The first list ends at 8 + 2 + 36 + 4 = 50, the second at 50 + 2 + 12 + 4 = 68.
            let first = [
                n(3, 2),
                entry(0x010f, 2, 5, n(68, 4)),
                entry(0x0110, 2, 3, b"X9\0\0".to_vec()),
                entry(0x8769, 4, 1, n(50, 4)),
                n(0, 4),
            ];
            let focal = [n(26, 2), n(0, 2)].concat();
            let second = [n(1, 2), entry(0xa405, 3, 1, focal), n(0, 4)].concat();
            let block = [begin, n(8, 4), first.concat(), second, b"Acme\0".to_vec()].concat();
            let (focal_35mm, source) = (26, FocalSource::Stated);
            let lens = ExifLens { focal_35mm, source, camera: Some("Acme X9".into()) };
            assert_eq!(lens_of(&block), Some(lens), "{is_little}");
            assert_eq!((lens_of(&block[..60]), of_exif(&block)), (None, None));
        }
        assert_eq!(lens_of(&block(true)), None);
    }

    /// An APS-C camera as Canon writes it, without the focal length as of film: 18 mm on 22.3 × 14.9 mm are 29 mm.
    #[test]
    fn the_lens_follows_from_its_sensor() {
        let block = |is_little: bool, unit: u32, focal: [u32; 2], resolution: [u32; 2]| {
            let n = |value, size| number(value, size, is_little);
            let entry =
                |tag, kind, count, value: Vec<u8>| [n(tag, 2), n(kind, 2), n(count, 4), value].concat();
            let short = |value| [n(value, 2), n(0, 2)].concat();
            let begin = if is_little { b"II*\0".to_vec() } else { b"MM\0*".to_vec() };
            // The first list ends at 8 + 2 + 24 + 4 = 38, the second at 38 + 2 + 72 + 4 = 116; the fractions follow.
            let first =
                [n(2, 2), entry(0x0110, 2, 4, b"R7\0\0".to_vec()), entry(0x8769, 4, 1, n(38, 4)), n(0, 4)];
            let second = [
                n(6, 2),
                entry(0x920a, 5, 1, n(116, 4)),
                entry(0xa002, 3, 1, short(3888)),
                entry(0xa003, 4, 1, n(2592, 4)),
                entry(0xa20e, 5, 1, n(124, 4)),
                entry(0xa20f, 5, 1, n(132, 4)),
                entry(0xa210, 3, 1, short(unit)),
                n(0, 4),
            ];
            let fraction = |[over, under]: [u32; 2]| [n(over, 4), n(under, 4)].concat();
            let down = fraction([resolution[0], resolution[1]]);
            let fractions = [fraction(focal), fraction([3_888_000, 877]), down].concat();
            [begin, n(8, 4), first.concat(), second.concat(), fractions].concat()
        };
        for is_little in [true, false] {
            // 3888 px at 3888 000 / 877 a inch are 22.3 mm.
            let whole = block(is_little, 2, [18, 1], [2_592_000, 582]);
            let (focal_35mm, source) = (29, FocalSource::Sensor);
            assert_eq!(lens_of(&whole), Some(ExifLens { focal_35mm, source, camera: Some("R7".into()) }));
            let camera = ExifCamera { name: "R7".into(), model: Some("R7".into()), focal_mm: Some(18.0) };
            assert_eq!(camera_of(&whole), Some(camera));
            assert!((0..whole.len()).all(|length| lens_of(&whole[..length]).is_none()));
            // A sensor of 9 mm and one of 0.9 mm, pixels that are no squares, no focal length, one that is not a number.
            assert!(lens_of(&block(is_little, 3, [18, 1], [2_592_000, 582])).is_some());
            for (unit, focal, resolution) in [
                (4, [18, 1], [2_592_000, 582]),
                (2, [18, 1], [5_184_000, 582]),
                (2, [0, 1], [2_592_000, 582]),
                (2, [0, 0], [2_592_000, 582]),
                (2, [18, 1], [0, 0]),
            ] {
                assert_eq!(lens_of(&block(is_little, unit, focal, resolution)), None, "{unit} {focal:?}");
            }
        }
    }

    /// A phone that points 247.5° clockwise from north.
    #[test]
    fn the_heading_is_read() {
        let block = |is_little: bool, reference: &[u8; 4], hundredths: u32, per: u32| {
            let n = |value, size| number(value, size, is_little);
            let entry =
                |tag, kind, count, value: Vec<u8>| [n(tag, 2), n(kind, 2), n(count, 4), value].concat();
            let begin = if is_little { b"II*\0".to_vec() } else { b"MM\0*".to_vec() };
            // The first list ends at 8 + 2 + 12 + 4 = 26, the second at 26 + 2 + 24 + 4 = 56; the fraction follows.
            let first = [n(1, 2), entry(0x8825, 4, 1, n(26, 4)), n(0, 4)].concat();
            let direction = entry(0x0011, 5, 1, n(56, 4));
            let second = [n(2, 2), entry(0x0010, 2, 2, reference.to_vec()), direction, n(0, 4)].concat();
            [begin, n(8, 4), first, second, n(hundredths, 4), n(per, 4)].concat()
        };
        for is_little in [true, false] {
            let whole = block(is_little, b"T\0\0\0", 24750, 100);
            assert_eq!(heading_of(&whole), Some(Heading { deg: 247.5, is_magnetic: false }));
            assert!((0..whole.len()).all(|length| heading_of(&whole[..length]).is_none()));
            let magnetic = heading_of(&block(is_little, b"M\0\0\0", 9, 1));
            assert_eq!(magnetic, Some(Heading { deg: 9.0, is_magnetic: true }));
            // A fraction that is not a number, and one outside the circle.
            for (deg, per) in [(0, 0), (9, 0), (361, 1)] {
                assert_eq!(heading_of(&block(is_little, b"T\0\0\0", deg, per)), None, "{deg}/{per}");
            }
        }
        assert_eq!((heading_of(&super::tests::block(true)), heading_of(b"II")), (None, None));
    }

    #[test]
    fn torn_blocks_say_nothing() {
        let whole = block(true);
        for length in 0..88 {
            assert_eq!(of_exif(&whole[..length]), None, "{length} bytes");
        }
        for place in 0..whole.len() {
            let mut bent = whole.clone();
            bent[place] = 0xff;
            let _ = of_exif(&bent); // Whatever it says, it does not panic.
        }
    }

    #[test]
    fn dates_that_cannot_be_are_none() {
        assert_eq!(seconds("1970:01:01 00:00:00"), Some(0));
        assert_eq!(seconds("2024:02:29 12:00:00"), Some(1_709_208_000));
        for bad in ["0000:00:00 00:00:00", "2026:13:01 00:00:00", "    :  :     :  :  ", "2026:01:01", ""] {
            assert_eq!(seconds(bad), None, "{bad}");
        }
        assert_eq!((fraction("25"), fraction("2x"), fraction("")), (Some(0.25), None, None));
        assert_eq!((offset("-03:30"), offset("   :  "), offset("")), (Some(-12_600), None, None));
    }
}
