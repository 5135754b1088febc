//! Where frames come from.

use anyhow::{Context, Result, bail};
use clap::Args;
use resight::recording::is_recording;
use resight_watch::names::{by_name, split};
use resight_watch::outputs::secret;
use resight_watch::source::mcap::McapTopic;
use resight_watch::source::pictures::{Clock, Folder, ImageFiles};
use resight_watch::source::stream::{Stream, StreamConfig, is_stream};
use resight_watch::source::{Source, lines, video};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use video::Film;

/// The sources.
#[derive(Debug, Args)]
#[command(next_help_heading = "Sources")]
pub struct SourceArgs {
    /// Where frames come from: a folder, images, a video, a recording, a stream, a device, detections, or - for stdin.
    ///
    /// A folder that fills up, images ('night/*.png'), a video file, a recording (run.mcap, or run.mcap#/topic where several topics show
    /// something), a stream (rtsp://…, http://…, tcp://…, udp://…, rtmp://…), a camera (/dev/video0, or its number: 0), detections as JSON Lines (a file, or - for
    /// stdin). NAME=SOURCE where there are several cameras. An address with a password comes from the first line of a file that only you can
    /// read (@FILE) or from a variable (env:VARIABLE).
    #[arg(long, help_heading = None, required_unless_present_any = ["session", "print_session"], value_name = "[NAME=]SOURCE")]
    source: Vec<String>,
    /// Images are this far apart [default: as they say themselves (EXIF), else as their files' times say].
    #[arg(long, hide_short_help = true, value_name = "SECONDS", value_parser = crate::args::seconds)]
    period_s: Option<f64>,
    /// A stream without a frame for this long is lost, and opened again.
    #[arg(long, hide_short_help = true, value_name = "SECONDS", default_value_t = 10.0, value_parser = crate::args::seconds)]
    lost_after_s: f64,
    /// Further options for ffmpeg, before its input: "-video_size 1280x720 -framerate 30" for a camera, "-t 60" for the first
    /// minute. NAME=OPTIONS for the stream of one camera.
    #[arg(long, hide_short_help = true, value_name = "[NAME=]OPTIONS", allow_hyphen_values = true)]
    ffmpeg_input_options: Vec<String>,
    /// The session file that `source` comes from; none where it is an argument.
    #[arg(skip)]
    pub session: Option<PathBuf>,
}

/// A source for each camera. With `once` a folder ends with what it holds, and a stream where it ends.
pub fn open(args: &SourceArgs, names: &[String], once: bool) -> Result<Vec<Box<dyn Source>>> {
    let is_lines = |source: &&str| *source == "-" || is_json(Path::new(source));
    if let Some(lines) = args.source.iter().map(|argument| split(argument).1).find(is_lines) {
        if args.source.len() != 1 {
            bail!("--source {lines} serves all cameras; give it alone");
        }
        if args.source.iter().any(|argument| split(argument).0.is_some()) {
            by_name("--source", &args.source, names)?;
        }
        let input: Box<dyn Read + Send> = match lines {
            "-" => Box::new(std::io::stdin()),
            path => Box::new(File::open(path).with_context(|| path.to_owned())?),
        };
        let all = lines::sources(BufReader::new(input), names);
        return Ok(all.into_iter().map(|source| Box::new(source) as Box<dyn Source>).collect());
    }
    let given = by_name("--source", &args.source, names)?;
    let source = |(value, name): (Option<String>, &String)| {
        let value =
            value.with_context(|| format!("camera {name} has no --source; give --source {name}=…"))?;
        let address =
            secret::address(&format!("--source of camera {name}"), &value, args.session.as_deref())?;
        let mut config =
            StreamConfig { lost_after_s: args.lost_after_s, ends: once, ..StreamConfig::default() };
        if is_stream(&address) {
            config.input_options = input_options(&args.ffmpeg_input_options, name, names)?;
        }
        let clock = args.period_s.map_or(Clock::Taken, Clock::Every);
        one(&format!("--source of camera {name}"), &address, config, clock)
    };
    given.into_iter().zip(names).map(source).collect()
}

/// One source, read to its end: a folder ends with what it holds, and a stream where it ends or is lost. `shown` stands for the argument in
/// messages, for an address may hold a password.
pub fn open_one(shown: &str, value: &str, options: Option<&str>) -> Result<Box<dyn Source>> {
    let address = secret::address(shown, value, None)?;
    let input_options = options.map_or(Ok(Vec::new()), words).context("--ffmpeg-input-options …")?;
    one(shown, &address, StreamConfig { input_options, ends: true, ..StreamConfig::default() }, Clock::Taken)
}

fn one(shown: &str, value: &str, config: StreamConfig, clock: Clock) -> Result<Box<dyn Source>> {
    let (path, once) = (Path::new(value), config.ends);
    if is_stream(value) {
        return Ok(Box::new(Stream::open(value, config)?));
    }
    if value.contains("://") && !path.exists() {
        // What stands behind may hold a password.
        let before = value.split("://").next().unwrap_or_default();
        bail!(
            "{shown}: `{before}://…` is no address; its protocol is written in small letters, as in rtsp://…"
        );
    }
    if path.is_dir() {
        let folder = Folder::open(path, clock)?;
        return Ok(Box::new(if once { folder.as_it_is() } else { folder }));
    }
    if path.is_file() && video::is_video(path) {
        return Ok(Box::new(Film::open(path)?));
    }
    if let Some((file, topic)) = recording(value) {
        let topic = McapTopic::open(file, topic)?;
        return Ok(Box::new(if once { topic.as_it_is() } else { topic }));
    }
    let pictures: Vec<PathBuf> = crate::files::expand(&[value.to_string()])?;
    Ok(Box::new(ImageFiles::new(pictures, clock)))
}

/// Whether a file holds detections as JSON Lines, as stdin has them, by its first letter or its name.
fn is_json(path: &Path) -> bool {
    let is_named_so = path
        .extension()
        .is_some_and(|ending| ["jsonl", "ndjson", "json"].iter().any(|known| ending == *known));
    let begins_so = || {
        let mut first = [0];
        File::open(path).and_then(|mut file| file.read_exact(&mut first)).is_ok_and(|()| first == *b"{")
    };
    path.is_file() && (is_named_so || begins_so())
}

/// A recording and its topic; a `#` belongs to the file's name where there is a file of that whole name.
fn recording(value: &str) -> Option<(&Path, Option<&str>)> {
    let parts = match value.rsplit_once('#') {
        Some((file, topic)) if !Path::new(value).exists() => (Path::new(file), Some(topic)),
        _ => (Path::new(value), None),
    };
    is_recording(parts.0).then_some(parts)
}

/// The options for one camera: those for all, then those with its name.
fn input_options(given: &[String], name: &str, names: &[String]) -> Result<Vec<String>> {
    let mut all = Vec::new();
    for argument in given {
        // What stands before `=` may as well be part of an option.
        let (whose, options) = match split(argument) {
            (Some(whose), options) if names.iter().any(|known| known == whose) => (Some(whose), options),
            _ => (None, argument.as_str()),
        };
        if whose.is_none_or(|whose| whose == name) {
            // Options may hold a password.
            let shown = whose.map_or("…".to_string(), |whose| format!("{whose}=…"));
            all.extend(words(options).with_context(|| format!("--ffmpeg-input-options {shown}"))?);
        }
    }
    Ok(all)
}

/// Words between blanks; '…' and "…" hold blanks.
fn words(text: &str) -> Result<Vec<String>> {
    let (mut words, mut word, mut quote) = (Vec::new(), None::<String>, None);
    for letter in text.chars() {
        match (quote, letter) {
            (Some(open), _) if open == letter => quote = None,
            (None, '\'' | '"') => {
                quote = Some(letter);
                word.get_or_insert_default();
            }
            (None, _) if letter.is_whitespace() => words.extend(word.take()),
            _ => word.get_or_insert_default().push(letter),
        }
    }
    if let Some(open) = quote {
        bail!("a {open} is not closed");
    }
    words.extend(word);
    Ok(words)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn address(value: &str, session: Option<&Path>) -> Result<String> {
        secret::address("--source of camera gate", value, session)
    }

    #[test]
    fn options_are_cut_into_words() {
        let cut = |text: &str| words(text).expect("words");
        assert_eq!(cut(" -t 60  -video_size 640x480 "), ["-t", "60", "-video_size", "640x480"]);
        assert_eq!(cut(r#"-headers 'X-A: b' """#), ["-headers", "X-A: b", ""]);
        assert!(words("-headers 'X-A").is_err());
    }

    #[test]
    fn options_go_to_the_camera_they_name() {
        let names = ["gate".to_string(), "door".to_string()];
        let given = ["-t 60".to_string(), "door=-framerate 5".to_string()];
        let of = |name: &str| input_options(&given, name, &names).expect("options").join(" ");
        assert_eq!((of("gate").as_str(), of("door").as_str()), ("-t 60", "-t 60 -framerate 5"));
    }

    #[test]
    fn passwords_are_not_arguments() {
        for value in [
            "rtsp://me:secret@cam/x",
            "rtsp://me:se/cret@cam/x",
            "http://a:b@cam?x",
            "rtsp://me:1234@cam",
            "rtsp://cam/x?password=secret",
            "rtsp://cam/user=me_password=secret_channel=1",
        ] {
            let reported = address(value, None).expect_err("refused").to_string();
            assert!(
                reported.contains("@FILE") && reported.contains("env:VARIABLE") && !reported.contains("cret"),
                "{reported}"
            );
        }
        for value in [
            "rtsp://me@cam/x",
            "rtsp://cam:554/x",
            "rtsp://cam:554/a@2x",
            "udp://@239.0.0.1:1234",
            "tcp://[::1]:5000",
            "film.mp4",
        ] {
            assert_eq!(address(value, None).expect("an address"), value);
        }
        assert!(address("env:RESIGHT_NO_SUCH_VARIABLE", None).is_err());
        assert!(address("@no/such/file", None).is_err());
    }

    /// A session file is a place for a secret while nobody else can read it.
    #[cfg(unix)]
    #[test]
    fn passwords_may_stand_in_a_private_session_file() {
        use std::os::unix::fs::PermissionsExt;
        let file = std::env::temp_dir().join(format!("resight-session-{}.toml", std::process::id()));
        std::fs::write(&file, "").expect("a file");
        let mode =
            |mode| std::fs::set_permissions(&file, std::fs::Permissions::from_mode(mode)).expect("a mode");
        let value = "rtsp://me:secret@cam/x";
        mode(0o644);
        let refused = address(value, Some(&file)).expect_err("refused").to_string();
        mode(0o600);
        let address = address(value, Some(&file)).expect("an address");
        let _ = std::fs::remove_file(&file);
        assert!(refused.contains("others can read it") && !refused.contains("secret@"), "{refused}");
        assert_eq!(address, value);
    }

    /// Not even in what is said of a typing error.
    #[test]
    fn passwords_are_not_shown() {
        let args = |source: &str, options: &str| SourceArgs {
            source: vec![source.to_string()],
            period_s: None,
            lost_after_s: 1.0,
            ffmpeg_input_options: vec![options.to_string()],
            session: None,
        };
        let names = ["gate".to_string()];
        for (source, options, said) in [
            ("gaet=rtsp://me:secret@cam/x", "", "--source gaet=…: there is no such name; there are gate"),
            (
                "gate=RTSP://me:secret@cam/x",
                "",
                "--source of camera gate: a password or token in an argument can be read",
            ),
            ("gate=rtsp://cam/x", "gate=-headers 'X: secret", "--ffmpeg-input-options gate=…: a ' is not"),
            ("gate=rtsp://cam/x", "-headers 'X: secret", "--ffmpeg-input-options …: a ' is not closed"),
        ] {
            let reported = open(&args(source, options), &names, true).err().expect("refused");
            let reported = format!("{reported:#}");
            assert!(reported.starts_with(said) && !reported.contains("secret"), "{reported}");
        }
        let more = ["rtsp://cam/x".to_string(), "rtsp://me:secret@cam/x".to_string()];
        let reported = by_name("--source", &more, &names).expect_err("refused").to_string();
        assert_eq!(reported, "--source …: there is no such name; there are gate");
    }
}
