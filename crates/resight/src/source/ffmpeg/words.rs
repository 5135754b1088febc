//! What ffmpeg says on stderr, at log level `info` with the level before each line.

/// What a line says of the frames.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Told {
    /// One tick of the stamps that follow.
    TimeBase {
        /// Seconds.
        seconds: f64,
    },
    /// A frame goes out.
    Frame {
        /// Counted from 0, and again from 0 when frames change.
        number: u64,
        /// Its presentation time in ticks; none where the stream states none.
        ticks: Option<i64>,
        /// Columns and rows.
        size_px: [u32; 2],
    },
    /// The frame that goes out next was pieced together from damaged data.
    CorruptFrame(String),
    /// Data that gave no frame.
    NoFrame(String),
}

/// Packets that could not be decoded (before and since release 6), Matroska and MP4 files that were cut off.
const GAVE_NO_FRAME: [&str; 4] = [
    "Error while decoding stream",
    "Error submitting packet to decoder",
    "File ended prematurely",
    "partial file",
];

/// What a line says of the frames, if anything.
pub(super) fn told(line: &str) -> Option<Told> {
    if let Some((_, shown)) = line.split_once("Parsed_showinfo") {
        return time_base(shown).or_else(|| frame(shown));
    }
    let complaint = complaint(line)?;
    if complaint.contains("corrupt decoded frame") {
        return Some(Told::CorruptFrame(complaint));
    }
    GAVE_NO_FRAME.iter().any(|words| complaint.contains(words)).then_some(Told::NoFrame(complaint))
}

/// What went wrong, without the marks before it; none where the line is no complaint.
pub(super) fn complaint(line: &str) -> Option<String> {
    let levels = ["[panic]", "[fatal]", "[error]", "[warning]"];
    let words = levels.iter().find_map(|level| line.split_once(level))?.1.trim();
    // A wrong protocol is named on the line before.
    (!words.is_empty() && !words.starts_with("Did you mean")).then(|| words.to_string())
}

/// `config in time_base: 1/90000, frame_rate: 25/1`
fn time_base(shown: &str) -> Option<Told> {
    let (_, after) = shown.split_once("config in time_base: ")?;
    let (ticks, seconds) = after.split(',').next()?.trim().split_once('/')?;
    let seconds = ticks.parse::<f64>().ok()? / seconds.parse::<f64>().ok()?;
    (seconds.is_finite() && 0.0 < seconds).then_some(Told::TimeBase { seconds })
}

/// `n:   7 pts:   3570 pts_time:0.297 … s:640x480 i:P …`; without a stamp `pts:  NOPTS`.
fn frame(shown: &str) -> Option<Told> {
    let after = |name: &str| shown.split_once(name).map(|(_, after)| after.trim_start());
    let word = |name: &str| after(name)?.split_whitespace().next();
    let number = word(" n:")?.parse().ok()?;
    let ticks = word(" pts:")?.parse().ok();
    let (width, height) = word(" s:")?.split_once('x')?;
    Some(Told::Frame { number, ticks, size_px: [width.parse().ok()?, height.parse().ok()?] })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_and_sizes_are_read() {
        let line = "[Parsed_showinfo_0 @ 0x55] [info] config in time_base: 1/90000, frame_rate: 25/1";
        assert_eq!(told(line), Some(Told::TimeBase { seconds: 1.0 / 90000.0 }));
        assert_eq!(
            told("[Parsed_showinfo_0 @ 0x55] [info] config out time_base: 0/0, frame_rate: 0/0"),
            None
        );
        let of_5_1 = "[Parsed_showinfo_0 @ 0x55] [info] n:   7 pts:   3570 pts_time:0.297  pos:  48 fmt:yuv420p sar:1/1 s:640x480 i:P iskey:1 type:I ";
        let of_9 = "[Parsed_showinfo_0 @ 0x7f] [info] n:  20 pts:   3570 pts_time:1.7     duration:     33 duration_time:0.033   fmt:yuv420p cl:left sar:1/1 s:640x480 i:P iskey:0 type:P ";
        for (line, number) in [(of_5_1, 7), (of_9, 20)] {
            let frame = Told::Frame { number, ticks: Some(3570), size_px: [640, 480] };
            assert_eq!(told(line), Some(frame), "{line}");
        }
        let without =
            "[Parsed_showinfo_0 @ 0x55] [info] n:   0 pts:  NOPTS pts_time:NOPTS fmt:gray sar:0/1 s:2x3 i:P";
        assert_eq!(told(without), Some(Told::Frame { number: 0, ticks: None, size_px: [2, 3] }));
        for other in ["[Parsed_showinfo_0 @ 0x55] [info]   side data - User Data", "[info] frame=  12", ""] {
            assert_eq!((told(other), complaint(other)), (None, None), "{other}");
        }
    }

    #[test]
    fn complaints_are_read() {
        let said = |line: &str| complaint(line).unwrap_or_default();
        assert_eq!(
            said("[tcp @ 0x5] [error] Connection to tcp://h:1 failed: refused\n"),
            "Connection to tcp://h:1 failed: refused"
        );
        let torn = "[warning] tcp://h:1: corrupt decoded frame in stream 0";
        assert!(matches!(told(torn), Some(Told::CorruptFrame(words)) if words.ends_with("in stream 0")));
        for lost in [
            "[error] Error while decoding stream #0:0: Invalid data found when processing input",
            "[vist#0:0/h264 @ 0x5] [dec:h264 @ 0x6] [error] Error submitting packet to decoder: Invalid data found",
        ] {
            assert!(matches!(told(lost), Some(Told::NoFrame(words)) if words.starts_with("Error")), "{lost}");
        }
        assert_eq!(told("[h264 @ 0x5] [error] error while decoding MB 6 3"), None);
    }
}
