//! The address of a stream, the options that ffmpeg needs for it, and the part of it that may be shown.

use super::OPENING_S;
use crate::outputs::secret;
use resight::video::ffmpeg::Release;
use std::path::Path;

/// Returns whether a source is an address that ffmpeg opens (`rtsp://…`, `tcp://…`, `v4l2:///dev/video0`) or a camera (`/dev/video0`, or its
/// number).
pub fn is_stream(source: &str) -> bool {
    scheme(source).is_some() || is_device(source) || numbered(source).is_some()
}

/// Returns the device of a camera's number, as OpenCV counts them: `0` is `/dev/video0`, unless there is a file or a folder of that name.
fn numbered(source: &str) -> Option<String> {
    let is_number = (1..=2).contains(&source.len()) && source.bytes().all(|c| c.is_ascii_digit());
    (is_number && !Path::new(source).exists()).then(|| format!("/dev/video{source}"))
}

/// An address.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Address {
    /// The address for ffmpeg.
    pub input: String,
    /// The address without passwords and tokens, for messages.
    pub shown: String,
}

impl Address {
    pub fn new(given: &str) -> Self {
        let input =
            numbered(given).unwrap_or_else(|| given.strip_prefix("v4l2://").unwrap_or(given).to_string());
        Address { shown: without_secrets(&input), input }
    }

    /// Removes secrets from ffmpeg's messages.
    pub fn hide(&self, words: &str) -> String {
        words.replace(&self.input, &self.shown)
    }

    /// Returns whether it contains a secret; behind the `?` of a server's address there often is a token.
    pub fn is_secret(&self) -> bool {
        let Some((scheme, rest)) = self.input.split_once("://") else { return false };
        let is_server = matches!(scheme, "http" | "https" | "rtsp" | "rtsps" | "rtmp" | "rtmps");
        (is_server && rest.contains('?')) || secret::is_in(&self.input)
    }

    /// Returns whether the connection is secured by a certificate.
    pub fn is_tls(&self) -> bool {
        matches!(scheme(&self.input), Some("rtsps" | "https" | "tls" | "rtmps" | "rtmpts"))
    }

    /// Returns options that have the server's certificate verified, whatever the default of this ffmpeg.
    ///
    /// # Errors
    /// No file of trusted certificates.
    pub fn tls_options(&self) -> Result<Vec<String>, String> {
        if !self.is_tls() {
            return Ok(Vec::new());
        }
        let given = std::env::var("SSL_CERT_FILE").ok().filter(|path| !path.is_empty());
        let known =
            || CERTIFICATES.iter().find(|path| Path::new(path).is_file()).map(|path| path.to_string());
        let file = given.or_else(known).ok_or(
            "the certificate cannot be verified: no file of certificates is known on this machine; name one in the \
             variable SSL_CERT_FILE",
        )?;
        Ok(["-tls_verify", "1", "-ca_file", &file].map(str::to_string).to_vec())
    }

    /// Returns a playlist of this one entry with its options, and the options for ffmpeg itself.
    ///
    /// # Errors
    /// A line break in the address or in an option.
    pub fn playlist(&self, options: &[String]) -> Result<(String, Vec<String>), String> {
        let mut text = format!("ffconcat version 1.0\nfile {}\n", quoted(&self.input)?);
        let mut outside = Vec::new();
        let mut words = options.iter();
        while let Some(word) = words.next() {
            match word.strip_prefix('-').filter(|name| OF_ENTRIES.contains(name)) {
                Some(name) => {
                    let value = words.next().ok_or_else(|| format!("the option {word} has no value"))?;
                    text.push_str(&format!("option {name} {}\n", quoted(value)?));
                }
                None => outside.push(word.clone()),
            }
        }
        Ok((text, outside))
    }

    /// Returns options for the input: short delays, and limits for every wait.
    pub fn input_options(&self, patience_s: f64, release: Release) -> Vec<String> {
        let us = |seconds: f64| format!("{:.0}", 1e6 * seconds);
        let patience_us = us(patience_s);
        let udp_us = us((patience_s + OPENING_S).min(MOST_UDP_S));
        let specific: &[&str] = match scheme(&self.input) {
            None => &["-f", "v4l2"],
            // Without TCP, lost packets damage frames.
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
            // UDP has its own option. Silence is noticed earlier elsewhere: this option ends an ffmpeg that has outlived its session, which
            // would wait for ever and keep the port.
            Some("udp") => &["-timeout", &udp_us],
            Some(_) => &[], // Some(_) => &[], // Others have no such option; a silent stream is given up all the same.
        };
        LITTLE_WAITING.iter().chain(specific).map(|word| word.to_string()).collect()
    }
}

/// Usual files of trusted certificates.
const CERTIFICATES: [&str; 5] = [
    "/etc/ssl/certs/ca-certificates.crt",
    "/etc/pki/tls/certs/ca-bundle.crt",
    "/etc/pki/ca-trust/extracted/pem/tls-ca-bundle.pem",
    "/etc/ssl/ca-bundle.pem",
    "/etc/ssl/cert.pem",
];

/// Options of the opened entry, not of ffmpeg's reading of it.
const OF_ENTRIES: [&str; 28] = [
    "fflags",
    "analyzeduration",
    "probesize",
    "max_delay",
    "rtsp_transport",
    "rtsp_flags",
    "allowed_media_types",
    "timeout",
    "rw_timeout",
    "buffer_size",
    "reorder_queue_size",
    "tls_verify",
    "ca_file",
    "cafile",
    "cert_file",
    "key_file",
    "verifyhost",
    "headers",
    "user_agent",
    "referer",
    "cookies",
    "auth_type",
    "http_proxy",
    "multiple_requests",
    "reconnect",
    "seekable",
    "icy",
    "rtmp_live",
];

/// Quotes a value as ffmpeg's playlists require.
fn quoted(value: &str) -> Result<String, String> {
    match value.contains(['\n', '\r', '\0']) {
        true => Err("a line break in the address or in an option of its".to_string()),
        false => Ok(format!("'{}'", value.replace('\'', r"'\''"))),
    }
}

/// Largest timeout of ffmpeg for UDP, seconds: an `int` of microseconds.
const MOST_UDP_S: f64 = 2147.0;

/// Options for short delays: decoding in parallel slices, not frames, so that the decoder provides each frame at once (`-flags low_delay` would
/// give frames in the order of decoding where a stream has B-frames), and a shorter analysis of the stream.
const LITTLE_WAITING: [&str; 6] =
    ["-fflags", "nobuffer", "-thread_type", "slice", "-analyzeduration", "1000000"];

/// Returns `rtsp` of `rtsp://…`; none where there is no scheme.
fn scheme(source: &str) -> Option<&str> {
    let (scheme, _) = source.split_once("://")?;
    let is_scheme = scheme.starts_with(|c: char| c.is_ascii_lowercase())
        && scheme.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || "+-.".contains(c));
    is_scheme.then_some(scheme)
}

/// Returns whether a source is a character device: a camera, not a file.
#[cfg(unix)]
fn is_device(source: &str) -> bool {
    use std::os::unix::fs::FileTypeExt;
    // A camera that is unplugged at present leaves its name.
    source.starts_with("/dev/video")
        || std::fs::metadata(source).is_ok_and(|data| data.file_type().is_char_device())
}

#[cfg(not(unix))]
fn is_device(_: &str) -> bool {
    false
}

/// Returns an address without `user:password@`, without what follows `?`, and up to the first secret in its path.
fn without_secrets(input: &str) -> String {
    let Some((scheme, rest)) = input.split_once("://") else { return input.to_string() };
    if let Some(at) = secret::named_in(input).filter(|at| !input[..*at].contains('?')) {
        return format!("{}…", without_secrets(&input[..at]));
    }
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
            ("rtsp://me:a@cam/user=admin_password=7_channel=1", "rtsp://cam/user=admin_password=…"),
            ("tcp://127.0.0.1:5000", "tcp://127.0.0.1:5000"),
            ("v4l2:///dev/video0", "/dev/video0"),
        ] {
            assert_eq!(Address::new(given).shown, shown);
        }
        let address = Address::new("rtsp://a:b@cam/x");
        assert_eq!(address.hide("rtsp://a:b@cam/x: Connection refused"), "rtsp://cam/x: Connection refused");
    }

    #[test]
    fn a_playlist_holds_what_belongs_to_the_stream() {
        let address = Address::new("rtsp://me:it's@cam/x");
        let options = ["-rtsp_transport", "tcp", "-thread_type", "slice", "-timeout", "25", "-t", "60"];
        let (text, outside) = address.playlist(&options.map(str::to_string)).unwrap();
        let lines = ["file 'rtsp://me:it'\\''s@cam/x'", "option rtsp_transport 'tcp'", "option timeout '25'"];
        assert_eq!(text, format!("ffconcat version 1.0\n{}\n", lines.join("\n")));
        assert_eq!(outside, ["-thread_type", "slice", "-t", "60"]);
        assert!(Address::new("rtsp://a:b@cam/x\nfile '/etc/passwd'").playlist(&[]).is_err());
        assert!(address.is_secret() && !Address::new("rtsp://cam/x").is_secret());
        assert!(Address::new("http://cam/x?token=7").is_secret() && !Address::new("/dev/video0").is_secret());
    }

    #[test]
    fn streams_are_reported_from_files() {
        for stream in [
            "rtsp://cam/x",
            "udp://@239.0.0.1:1234",
            "v4l2:///dev/video7",
            "/dev/video7",
            "/dev/null",
            "0",
            "12",
        ] {
            assert!(is_stream(stream), "{stream}");
        }
        for other in ["night/*.png", "film.mp4", "-", "C://x", "/etc/hostname", "://", "123", "", "0x"] {
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
        assert!(options("/dev/video0").ends_with("-f v4l2") && options("0").ends_with("-f v4l2"));
        assert_eq!(Address::new("0"), Address::new("/dev/video0"));
        assert!(options("srt://cam:9000").ends_with("-analyzeduration 1000000"));
    }
}
