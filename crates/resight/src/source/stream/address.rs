//! Where a stream is, what ffmpeg needs to be told about it, and what of it may be shown.

use super::super::ffmpeg::Release;
use super::OPENING_S;

/// Whether a source is an address that ffmpeg opens (`rtsp://…`, `tcp://…`, `v4l2:///dev/video0`) or a camera (`/dev/video0`).
pub fn is_stream(source: &str) -> bool {
    scheme(source).is_some() || is_device(source)
}

/// An address.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Address {
    /// What ffmpeg opens.
    pub input: String,
    /// The same without passwords and tokens, for messages.
    pub shown: String,
}

impl Address {
    pub fn new(given: &str) -> Self {
        let input = given.strip_prefix("v4l2://").unwrap_or(given);
        Address { input: input.to_string(), shown: without_secrets(input) }
    }

    /// ffmpeg's words without what is not shown.
    pub fn hide(&self, words: &str) -> String {
        words.replace(&self.input, &self.shown)
    }

    /// Options for the input: little waiting, and an end to waiting for ever.
    pub fn input_options(&self, patience_s: f64, release: Release) -> Vec<String> {
        let us = |seconds: f64| format!("{:.0}", 1e6 * seconds);
        let patience_us = us(patience_s);
        let udp_us = us((patience_s + OPENING_S).min(MOST_UDP_S));
        let specific: &[&str] = match scheme(&self.input) {
            None => &["-f", "v4l2"],
            // Without TCP, lost packets tear frames.
            Some("rtsp" | "rtsps") => &[
                "-rtsp_transport",
                "tcp",
                "-allowed_media_types",
                "video",
                release.rtsp_patience(),
                &patience_us,
            ],
            Some("http" | "https" | "tcp" | "tls" | "rtmp" | "rtmps" | "rtmpt") => {
                &["-rw_timeout", &patience_us]
            }
            // UDP has its own option. Silence is noticed here, and sooner: this one ends an ffmpeg that has outlived its session, which
            // would wait for ever and keep the port.
            Some("udp") => &["-timeout", &udp_us],
            Some(_) => &[], // Others know no such option; a stream that says nothing is given up all the same.
        };
        LITTLE_WAITING.iter().chain(specific).map(|word| word.to_string()).collect()
    }
}

/// What ffmpeg takes for UDP, seconds: an `int` of microseconds.
const MOST_UDP_S: f64 = 2147.0;

/// Decoding in slices, not frames, in parallel: the decoder gives each frame at once. (`-flags low_delay` would give frames in the order
/// of decoding where a stream has B-frames.) A shorter look at what the stream is.
const LITTLE_WAITING: [&str; 6] =
    ["-fflags", "nobuffer", "-thread_type", "slice", "-analyzeduration", "1000000"];

/// `rtsp` of `rtsp://…`; none where there is none.
fn scheme(source: &str) -> Option<&str> {
    let (scheme, _) = source.split_once("://")?;
    let is_scheme = scheme.starts_with(|c: char| c.is_ascii_lowercase())
        && scheme.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || "+-.".contains(c));
    is_scheme.then_some(scheme)
}

/// A character device: a camera, not a file.
#[cfg(unix)]
fn is_device(source: &str) -> bool {
    use std::os::unix::fs::FileTypeExt;
    // A camera that is unplugged just now leaves its name.
    source.starts_with("/dev/video")
        || std::fs::metadata(source).is_ok_and(|data| data.file_type().is_char_device())
}

#[cfg(not(unix))]
fn is_device(_: &str) -> bool {
    false
}

/// Without `user:password@` and without what follows `?`.
fn without_secrets(input: &str) -> String {
    let Some((scheme, rest)) = input.split_once("://") else { return input.to_string() };
    let (path, query) = rest.split_once('?').map_or((rest, ""), |(path, _)| (path, "?…"));
    let (host, path) = path.find('/').map_or((path, ""), |slash| path.split_at(slash));
    let host = host.rsplit_once('@').map_or(host, |(_, host)| host);
    format!("{scheme}://{host}{path}{query}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passwords_and_tokens_are_not_shown() {
        for (given, shown) in [
            ("rtsp://admin:p@ss@cam.local:554/h264?channel=1", "rtsp://cam.local:554/h264?…"),
            ("http://cam/video@2x", "http://cam/video@2x"),
            ("tcp://127.0.0.1:5000", "tcp://127.0.0.1:5000"),
            ("v4l2:///dev/video0", "/dev/video0"),
        ] {
            assert_eq!(Address::new(given).shown, shown);
        }
        let address = Address::new("rtsp://a:b@cam/x");
        assert_eq!(address.hide("rtsp://a:b@cam/x: Connection refused"), "rtsp://cam/x: Connection refused");
    }

    #[test]
    fn streams_are_told_from_files() {
        for stream in
            ["rtsp://cam/x", "udp://@239.0.0.1:1234", "v4l2:///dev/video7", "/dev/video7", "/dev/null"]
        {
            assert!(is_stream(stream), "{stream}");
        }
        for other in ["night/*.png", "film.mp4", "-", "C://x", "/etc/hostname", "://"] {
            assert!(!is_stream(other), "{other}");
        }
    }

    #[test]
    fn each_protocol_gets_its_own_options() {
        let of = |version: &str, given: &str| {
            let release = Release::read(&format!("ffmpeg version {version} Copyright"));
            Address::new(given).input_options(2.5, release).join(" ")
        };
        let options = |given: &str| of("5.1.9", given);
        let rtsp = "-rtsp_transport tcp -allowed_media_types video";
        assert!(options("rtsp://cam/x").ends_with(&format!("{rtsp} -timeout 2500000")));
        assert!(of("4.4.2", "rtsps://cam/x").ends_with(&format!("{rtsp} -stimeout 2500000")));
        assert!(options("http://cam/x").ends_with("-rw_timeout 2500000"));
        assert!(options("rtmp://cam/live/x").ends_with("-rw_timeout 2500000"));
        assert!(options("udp://@239.0.0.1:1234").ends_with("-analyzeduration 1000000 -timeout 17500000"));
        let release = Release::read("ffmpeg version 5.1.9 Copyright");
        let patient = Address::new("udp://:1234").input_options(1e5, release).join(" ");
        assert!(patient.ends_with("-timeout 2147000000"), "{patient}");
        assert!(options("/dev/video0").ends_with("-f v4l2"));
        assert!(options("srt://cam:9000").ends_with("-analyzeduration 1000000"));
    }
}
