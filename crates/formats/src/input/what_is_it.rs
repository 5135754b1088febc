//! Files that are no text, named by how they begin, with what to do instead: one answer for every reader of text.

/// How a kind of file begins (bytes from an offset), and what to say.
const KINDS: [(usize, &[u8], &str); 20] = [
    (0, b"\xff\xfe", UTF_16),
    (0, b"\xfe\xff", UTF_16),
    (
        0,
        b"\x93NUMPY",
        "a NumPy array (.npy); it holds one of the matrices that a camera needs: in Python, resight.Camera.from_matrix(matrix, distortion, image_size_px=(width, height))",
    ),
    (0, b"\x80\x02", PICKLE),
    (0, b"\x80\x03", PICKLE),
    (0, b"\x80\x04", PICKLE),
    (0, b"\x80\x05", PICKLE),
    (0, b"\xff\xd8\xff", "a JPEG image, not a text file"),
    (0, b"\x89PNG", "a PNG image, not a text file"),
    (0, b"II*\0", "a TIFF or raw image, not a text file"),
    (0, b"MM\0*", "a TIFF or raw image, not a text file"),
    (4, b"ftyphei", "a HEIC image, not a text file; phones can be set to take JPEG"),
    (4, b"ftypmif", "a HEIC or AVIF image, not a text file; phones can be set to take JPEG"),
    (4, b"ftyp", "a video, not a text file"),
    (0, b"\x1aE\xdf\xa3", "a video (Matroska or WebM), not a text file"),
    (0, b"%PDF", "a PDF, not a text file"),
    (0, b"\xd0\xcf\x11\xe0", "a document of Microsoft Office, not a text file; save a table as CSV (UTF-8)"),
    (
        0,
        b"MATLAB 5.0 MAT-file",
        "a MATLAB file (.mat); export the camera in MATLAB: cameraIntrinsicsToOpenCV, then write K and the coefficients as text",
    ),
    (0, b"\x1f\x8b", "compressed by gzip; unpack it first"),
    (0, b"SQLite format 3\0", "a database (SQLite), not a text file"),
];
const UTF_16: &str = "UTF-16 text (\"Unicode\" of Excel and Notepad); save the file as UTF-8";
const PICKLE: &str = "a Python pickle, which is a program and is not run here; load it in Python: resight.Camera.from_matrix(matrix, distortion, image_size_px=(width, height))";
const NUMPY_ARCHIVE: &str = "a NumPy archive (.npz, as OpenCV's tutorial saves it); load it in Python: d = numpy.load(FILE); resight.Camera.from_matrix(d[\"mtx\"], d[\"dist\"], image_size_px=(width, height)).to_toml() is the text of a camera file";
const SPREADSHEET: &str = "a spreadsheet, not a text file; save it as CSV (UTF-8)";

/// What a file is that no text reader reads, and the way out; none where it may be text.
pub(crate) fn that_is_no_text(bytes: &[u8]) -> Option<&'static str> {
    if bytes.starts_with(b"PK\x03\x04") {
        // Names of members stand in clear within the first headers.
        let head = &bytes[..bytes.len().min(4096)];
        let holds = |word: &[u8]| head.windows(word.len()).any(|part| part == word);
        return Some(
            match (holds(b".npy"), holds(b"xl/") || holds(b"[Content_Types]") || holds(b"mimetype")) {
                (true, _) => NUMPY_ARCHIVE,
                (_, true) => SPREADSHEET,
                _ => "a ZIP archive; unpack it first",
            },
        );
    }
    KINDS
        .iter()
        .find(|(at, begins, _)| bytes.get(*at..).is_some_and(|rest| rest.starts_with(begins)))
        .map(|(_, _, what)| *what)
}
