//! Interprets ffmpeg's messages on stderr, at log level `info` with the level before each line.

/// What a line reports about frames.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Reported {
    /// The time base of the stamps that follow.
    TimeBase {
        /// Seconds per tick.
        seconds: f64,
    },
    /// A frame is written.
    Frame {
        /// Its index, counted from 0, and again from 0 when the format of the frames changes.
        number: u64,
        /// Its presentation time in ticks; `None` where the stream states none.
        ticks: Option<i64>,
        /// Columns and rows.
        size_px: [u32; 2],
        /// Whether it is a key frame: decoded without any other.
        is_key: bool,
    },
    /// The next frame of the decoder was made from damaged data.
    CorruptFrame(String),
    /// The decoder has produced a frame.
    Decoded {
        /// Its presentation time; `None` where the stream states none.
        time_s: Option<f64>,
    },
    /// Data from which no frame could be decoded.
    NoFrame(String),
}

/// Messages about packets that could not be decoded (before and since release 6), and about truncated Matroska and MP4 files.
const GAVE_NO_FRAME: [&str; 4] = [
    "Error while decoding stream",
    "Error submitting packet to decoder",
    "File ended prematurely",
    "partial file",
];

/// The decoder's message about a frame made from damaged data.
const CORRUPT: &str = "corrupt decoded frame";

/// Interprets a line. Two threads may share one: the filter begins it, and the decoder ends it, without its marks.
pub(super) fn reported(line: &str) -> Vec<Reported> {
    let shown = line.split_once("Parsed_showinfo").map(|(_, shown)| shown);
    let of_filter = shown.and_then(|shown| time_base(shown).or_else(|| frame(shown)));
    of_filter.into_iter().chain(of_decoder(line)).collect()
}

fn of_decoder(line: &str) -> Option<Reported> {
    if line.contains(CORRUPT) {
        return Some(Reported::CorruptFrame(complaint(line).unwrap_or_else(|| CORRUPT.to_string())));
    }
    if let Some((_, given)) = line.split_once("decoder -> pts:") {
        return Some(Reported::Decoded { time_s: decoded_s(given) });
    }
    let complaint = complaint(line)?;
    GAVE_NO_FRAME.iter().any(|words| complaint.contains(words)).then_some(Reported::NoFrame(complaint))
}

/// Reads `171000 pts_time:1.9 … time_base:1/90000`, or `NOPTS …` without a stamp. The time itself is rounded there.
fn decoded_s(given: &str) -> Option<f64> {
    let ticks: i64 = given.split_whitespace().next()?.parse().ok()?;
    let (_, base) = given.rsplit_once("time_base:")?;
    Some(ratio(base.split_whitespace().next()?)? * ticks as f64)
}

/// Returns the complaint without the marks before it; `None` where the line is not a complaint.
pub(super) fn complaint(line: &str) -> Option<String> {
    let levels = ["[panic]", "[fatal]", "[error]", "[warning]"];
    let words = levels.iter().find_map(|level| line.split_once(level))?.1.trim();
    // A misspelt protocol is named on the previous line.
    (!words.is_empty() && !words.starts_with("Did you mean")).then(|| words.to_string())
}

/// Returns whether a complaint only summarises, for an input that cannot be opened, the previous message (`bind failed: Address already in
/// use`). Its own reason is often wrong, because the error code is lost. An address in the previous message may contain a password.
pub(super) fn sums_up(complaint: &str, before: &str, input: &str) -> bool {
    let of_input = complaint.strip_prefix(input).is_some_and(|rest| rest.starts_with(": "));
    let is_sum = complaint.starts_with("Error opening input") || (of_input && !complaint.contains(CORRUPT));
    is_sum && !before.contains("://")
}

/// Reads `config in time_base: 1/90000, frame_rate: 25/1`.
fn time_base(shown: &str) -> Option<Reported> {
    let (_, after) = shown.split_once("config in time_base: ")?;
    ratio(after.split(',').next()?.trim()).map(|seconds| Reported::TimeBase { seconds })
}

/// Reads a ratio such as `1/90000`.
fn ratio(text: &str) -> Option<f64> {
    let (over, under) = text.split_once('/')?;
    let ratio = over.parse::<f64>().ok()? / under.parse::<f64>().ok()?;
    (ratio.is_finite() && 0.0 < ratio).then_some(ratio)
}

/// Reads `n:   7 pts:   3570 pts_time:0.297 … s:640x480 i:P …`, or `pts:  NOPTS` without a stamp.
fn frame(shown: &str) -> Option<Reported> {
    let after = |name: &str| shown.split_once(name).map(|(_, after)| after.trim_start());
    let word = |name: &str| after(name)?.split_whitespace().next();
    let number = word(" n:")?.parse().ok()?;
    let ticks = word(" pts:")?.parse().ok();
    let (width, height) = word(" s:")?.split_once('x')?;
    // What another thread wrote into the line may have replaced it.
    let is_key = word(" iskey:") == Some("1");
    Some(Reported::Frame { number, ticks, size_px: [width.parse().ok()?, height.parse().ok()?], is_key })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_and_sizes_are_read() {
        let line = "[Parsed_showinfo_0 @ 0x55] [info] config in time_base: 1/90000, frame_rate: 25/1";
        assert_eq!(reported(line), [Reported::TimeBase { seconds: 1.0 / 90000.0 }]);
        assert_eq!(
            reported("[Parsed_showinfo_0 @ 0x55] [info] config out time_base: 0/0, frame_rate: 0/0"),
            []
        );
        let of_5_1 = "[Parsed_showinfo_0 @ 0x55] [info] n:   7 pts:   3570 pts_time:0.297  pos:  48 fmt:yuv420p sar:1/1 s:640x480 i:P iskey:1 type:I ";
        let of_9 = "[Parsed_showinfo_0 @ 0x7f] [info] n:  20 pts:   3570 pts_time:1.7     duration:     33 duration_time:0.033   fmt:yuv420p cl:left sar:1/1 s:640x480 i:P iskey:0 type:P ";
        for (line, number, is_key) in [(of_5_1, 7, true), (of_9, 20, false)] {
            let frame = Reported::Frame { number, ticks: Some(3570), size_px: [640, 480], is_key };
            assert_eq!(reported(line), [frame], "{line}");
        }
        let without =
            "[Parsed_showinfo_0 @ 0x55] [info] n:   0 pts:  NOPTS pts_time:NOPTS fmt:gray sar:0/1 s:2x3 i:P";
        let unstamped = Reported::Frame { number: 0, ticks: None, size_px: [2, 3], is_key: false };
        assert_eq!(reported(without), [unstamped]);
        for other in ["[Parsed_showinfo_0 @ 0x55] [info]   side data - User Data", "[info] frame=  12", ""] {
            assert_eq!((reported(other), complaint(other)), (Vec::new(), None), "{other}");
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
        assert!(
            matches!(&reported(torn)[..], [Reported::CorruptFrame(words)] if words.ends_with("in stream 0"))
        );
        for lost in [
            "[error] Error while decoding stream #0:0: Invalid data found when processing input",
            "[vist#0:0/h264 @ 0x5] [dec:h264 @ 0x6] [error] Error submitting packet to decoder: Invalid data found",
        ] {
            assert!(
                matches!(&reported(lost)[..], [Reported::NoFrame(words)] if words.starts_with("Error")),
                "{lost}"
            );
        }
        assert_eq!(reported("[h264 @ 0x5] [error] error while decoding MB 6 3"), []);
    }

    #[test]
    fn the_first_reason_is_kept() {
        let taken = "bind failed: Address already in use";
        let udp = "udp://127.0.0.1:1";
        // Since and before release 6.
        for sum in ["Error opening input: Inappropriate ioctl", "udp://127.0.0.1:1: Inappropriate ioctl"] {
            assert!(sums_up(sum, taken, udp), "{sum}");
            assert!(!sums_up(sum, "Connection to tcp://h:1 failed: refused", udp), "{sum}");
        }
        for other in
            ["udp://127.0.0.1:1: corrupt decoded frame in stream 0", "Error during demuxing: timed out"]
        {
            assert!(!sums_up(other, taken, udp), "{other}");
        }
    }

    /// As release 9 says it with `-debug_ts`, on a line of its own or behind what the filter had begun.
    #[test]
    fn what_the_decoder_gives_is_read() {
        let given = "decoder -> pts:171000 pts_time:1.9 pkt_dts:NOPTS pkt_dts_time:NOPTS duration:9000 keyframe:0 frame_type:2 time_base:1/90000 \n";
        let decoded = |time_s| Reported::Decoded { time_s };
        let alone = format!("[vist#0:0/h264 @ 0x56] [dec:h264 @ 0x57] [info] {given}");
        assert_eq!(reported(&alone), [decoded(Some(171_000.0 * (1.0 / 90000.0)))]);
        let without = alone.replace("pts:171000", "pts:NOPTS");
        assert_eq!(reported(&without), [decoded(None)]);
        let begun = "[Parsed_showinfo_0 @ 0x7f] [info] n:  18 pts: 162000 pts_time:1.8 fmt:yuv420p s:320x240 i:P type:P ";
        let shown = Reported::Frame { number: 18, ticks: Some(162_000), size_px: [320, 240], is_key: false };
        assert_eq!(
            reported(&format!("{begun}{given}"))[..],
            [shown.clone(), decoded(Some(171_000.0 * (1.0 / 90000.0)))]
        );
        let torn = Reported::CorruptFrame(CORRUPT.to_string());
        assert_eq!(reported(&format!("{begun}{CORRUPT}\n")), [shown, torn]);
    }
}
