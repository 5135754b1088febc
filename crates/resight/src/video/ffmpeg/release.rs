//! The installed release of ffmpeg, and the names of its options.

/// Major and minor number; `None` for a snapshot, which has a name instead and is treated as new.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Release(Option<(u32, u32)>);

impl Release {
    /// Reads the output of `ffmpeg -version`.
    pub fn read(version: &str) -> Self {
        let number = version.split_whitespace().nth(2).unwrap_or_default().trim_start_matches('n');
        let mut parts = number.split(['.', '-']).map(|part| part.parse::<u32>().ok());
        let (major, minor) = (parts.next().flatten(), parts.next().flatten());
        Release(major.map(|major| (major, minor.unwrap_or(0))))
    }

    fn is_before(self, major: u32, minor: u32) -> bool {
        self.0.is_some_and(|number| number < (major, minor))
    }

    /// Returns the option that passes frames through, which was renamed in 5.1; its old name has been removed since.
    pub fn each_frame_once(self) -> [&'static str; 2] {
        [if self.is_before(5, 1) { "-vsync" } else { "-fps_mode" }, "passthrough"]
    }

    /// Returns the option that limits the wait for an RTSP server: before 5.0 `-timeout` made ffmpeg a server that waits for connections.
    pub fn rtsp_patience(self) -> &'static str {
        if self.is_before(5, 0) { "-stimeout" } else { "-timeout" }
    }

    /// Returns whether entries of a playlist can have options of their own, as since 5.0.
    pub fn takes_options_in_playlists(self) -> bool {
        !self.is_before(5, 0)
    }

    /// Returns the option with which the decoder reports each frame: since 7.0 it is a thread of its own, ahead of the filter.
    pub fn decoder_says(self) -> &'static [&'static str] {
        if self.is_before(7, 0) { &[] } else { &["-debug_ts"] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_have_the_names_of_their_release() {
        let release = |version: &str| Release::read(&format!("ffmpeg version {version} Copyright (c) …"));
        let new = "-fps_mode -timeout -debug_ts";
        for (version, options) in [
            ("4.2.7", "-vsync -stimeout "),
            ("4.4.2-0ubuntu0.22.04.1", "-vsync -stimeout "),
            ("n4.4", "-vsync -stimeout "),
            ("5.0.1", "-vsync -timeout "),
            ("5.1.9-0+deb12u1", "-fps_mode -timeout "),
            ("6.1", "-fps_mode -timeout "),
            ("7.0.2-static", new),
            ("n9.0.2-17-g2a571b6068", new),
            ("N-12345-gabcdef", new),
            ("", new),
        ] {
            let release = release(version);
            let says = release.decoder_says().concat();
            let given = format!("{} {} {says}", release.each_frame_once()[0], release.rtsp_patience());
            assert_eq!(given, options, "{version}");
        }
    }
}
