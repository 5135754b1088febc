//! Names files by how they begin, with what to do instead: one answer for every reader of text and of images.

/// A kind of file, and the way out where it is given for another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FileKind {
    /// What it is, with its article.
    pub name: &'static str,
    /// What to do where a text file is needed.
    for_text: &'static str,
    /// What to do where an image is needed.
    for_image: &'static str,
}

impl FileKind {
    /// Returns whether it is a container of videos.
    pub fn is_video(self) -> bool {
        self == VIDEO
    }
}

const fn kind(name: &'static str, for_text: &'static str, for_image: &'static str) -> FileKind {
    FileKind { name, for_text, for_image }
}

const AS_PNG: &str = "save it as PNG or JPEG";
const IMAGES: &str = "`resight locate`, `resight detect` and `resight intrinsics` take images";
const EXPORT: &str = "export it in Python: pandas.read_feather(FILE).to_csv(\"table.csv\", index=False), of Parquet pandas.read_parquet";
const UNPACK: &str = "unpack it first";
const AS_CSV: &str = "save a table as CSV (UTF-8)";
const UTF_16: FileKind = kind("UTF-16 text (\"Unicode\" of Excel and Notepad)", "save it as UTF-8", "");
const PICKLE: FileKind = kind(
    "a Python pickle, which is a program and is not run here",
    "load it in Python: resight.Camera.from_matrix(matrix, distortion, image_size_px=(width, height))",
    "load it in Python: cv2.imwrite(\"image.png\", image)",
);
const NUMPY: FileKind = kind(
    "a NumPy array (.npy)",
    "it holds one of the matrices that a camera needs: in Python, resight.Camera.from_matrix(matrix, distortion, image_size_px=(width, height))",
    "in Python, cv2.imwrite(\"image.png\", numpy.load(FILE)), or give the array to resight.locate_image",
);
const NUMPY_ARCHIVE: FileKind = kind(
    "a NumPy archive (.npz, as OpenCV's tutorial saves it)",
    "load it in Python: d = numpy.load(FILE); resight.Camera.from_matrix(d[\"mtx\"], d[\"dist\"], image_size_px=(width, height)).to_toml() is the text of a camera file",
    "in Python, cv2.imwrite(\"image.png\", numpy.load(FILE)[NAME])",
);
const PDF: FileKind =
    kind("a PDF", "`resight print` writes the target file (.toml) beside it", "export its page as PNG");
const HEIC: &str = "convert it to JPEG, or set the phone to take JPEG (\"Most Compatible\")";
const VIDEO: FileKind = kind(
    "a video",
    "`resight watch --source FILE`, `resight rig` and `resight intrinsics` take it as images",
    "`resight watch --source`, `resight rig` and `resight intrinsics` read videos; for single images: ffmpeg -i FILE frame-%05d.png",
);

/// How kinds of files begin: bytes from an offset.
const KINDS: [(usize, &[u8], FileKind); 37] = [
    (0, b"\xff\xfe", UTF_16),
    (0, b"\xfe\xff", UTF_16),
    (0, b"\x93NUMPY", NUMPY),
    (0, b"\x80\x02", PICKLE),
    (0, b"\x80\x03", PICKLE),
    (0, b"\x80\x04", PICKLE),
    (0, b"\x80\x05", PICKLE),
    (0, b"\xff\xd8\xff", kind("a JPEG image", IMAGES, "")),
    (0, b"\x89PNG", kind("a PNG image", IMAGES, "")),
    (0, b"II*\0", kind("a TIFF or raw image", "", AS_PNG)),
    (0, b"MM\0*", kind("a TIFF or raw image", "", AS_PNG)),
    (0, b"GIF8", kind("a GIF image", "", AS_PNG)),
    (8, b"WEBP", kind("a WebP image", "", AS_PNG)), // In RIFF, as AVI is.
    (0, b"\0\0\0\x0cJXL ", kind("a JPEG XL image", "", AS_PNG)),
    (0, b"\0\0\0\x0cjP  ", kind("a JPEG 2000 image", "", AS_PNG)),
    (4, b"ftyphei", kind("a HEIC image", HEIC, HEIC)),
    (4, b"ftyphev", kind("a HEIC image", HEIC, HEIC)),
    (4, b"ftypmif", kind("a HEIC or AVIF image", HEIC, HEIC)),
    (4, b"ftypmsf", kind("a HEIC image", HEIC, HEIC)),
    (4, b"ftypavi", kind("an AVIF image", "", AS_PNG)),
    (4, b"ftypcrx", kind("a raw image (Canon)", "", AS_PNG)),
    (4, b"ftyp", VIDEO),
    (0, b"\x1aE\xdf\xa3", VIDEO),
    (8, b"AVI ", VIDEO),
    (0, b"\0\0\x01\xba", VIDEO),
    (0, b"OggS", VIDEO),
    (0, b"FLV\x01", VIDEO),
    (0, b"nut/multimedia container", VIDEO),
    (0, b"DKIF", VIDEO),
    (0, b"YUV4MPEG2 ", VIDEO),
    (0, b"%PDF", PDF),
    (0, b"\xd0\xcf\x11\xe0", kind("a document of Microsoft Office", AS_CSV, "")),
    (
        0,
        b"MATLAB 5.0 MAT-file",
        kind(
            "a MATLAB file (.mat)",
            "export the camera in MATLAB: cameraIntrinsicsToOpenCV, then write K and the coefficients as text",
            "in MATLAB: imwrite(image, \"image.png\")",
        ),
    ),
    (0, b"\x1f\x8b", kind("a file compressed by gzip", UNPACK, UNPACK)),
    (0, b"ARROW1\0\0", kind("an Arrow table (Feather)", EXPORT, "")),
    (0, b"PAR1", kind("a Parquet table", EXPORT, "")),
    (0, b"SQLite format 3\0", kind("a database (SQLite)", "", "")),
];

/// Size of a packet of an MPEG transport stream in bytes; each begins with 0x47, `G`.
const TS_PACKET: usize = 188;
/// Number of first bytes that are enough for [`what_is_it`].
pub const HEAD_BYTES: usize = 4096;

/// Returns what a file is whose kind its first bytes tell; none where it may be text.
pub fn what_is_it(bytes: &[u8]) -> Option<FileKind> {
    if bytes.starts_with(b"PK\x03\x04") {
        // Names of members stand in clear within the first headers.
        let head = &bytes[..bytes.len().min(HEAD_BYTES)];
        let holds = |word: &[u8]| head.windows(word.len()).any(|part| part == word);
        let is_office = holds(b"xl/") || holds(b"[Content_Types]") || holds(b"mimetype");
        return Some(match (holds(b".npy"), is_office) {
            (true, _) => NUMPY_ARCHIVE,
            (_, true) => kind("a spreadsheet", "save it as CSV (UTF-8)", ""),
            _ => kind("a ZIP archive", UNPACK, UNPACK),
        });
    }
    if is_text(bytes) {
        // A text may have the letters of a container where a container has them; the head of a PDF is text.
        return bytes.starts_with(b"%PDF").then_some(PDF);
    }
    let begins = |(at, begins, _): &&(usize, &[u8], FileKind)| {
        bytes.get(*at..).is_some_and(|rest| rest.starts_with(begins))
    };
    let is_transport_stream =
        [0, TS_PACKET, 2 * TS_PACKET].iter().all(|place| bytes.get(*place) == Some(&b'G'));
    KINDS.iter().find(begins).map(|(_, _, kind)| *kind).or(is_transport_stream.then_some(VIDEO))
}

/// Returns what a file is that no reader of text reads, and the way out; none where it may be text.
pub fn that_is_no_text(bytes: &[u8]) -> Option<String> {
    what_is_it(bytes).map(|kind| match kind {
        UTF_16 => sentence(UTF_16.name.to_string(), kind.for_text),
        _ => sentence(format!("{}, not a text file", kind.name), kind.for_text),
    })
}

/// Returns what a file is that is read as an image and is none, and the way out.
pub fn that_is_no_image(bytes: &[u8]) -> String {
    const NOT: &str = "not a PNG or JPEG image";
    match what_is_it(bytes) {
        Some(kind) => sentence(format!("{}, {NOT}", kind.name), kind.for_image),
        None if bytes.is_empty() => format!("an empty file, {NOT}"),
        None if is_text(bytes) => format!("a text file, {NOT}"),
        None => NOT.to_string(),
    }
}

/// Returns whether a file begins with text in UTF-8.
fn is_text(bytes: &[u8]) -> bool {
    let head = &bytes[..bytes.len().min(HEAD_BYTES)];
    // The last character may be cut.
    let is_utf_8 = std::str::from_utf8(head).map_or_else(|e| e.error_len().is_none(), |_| true);
    is_utf_8 && !head.contains(&0)
}

fn sentence(what: String, way_out: &str) -> String {
    if way_out.is_empty() { what } else { format!("{what}; {way_out}") }
}
