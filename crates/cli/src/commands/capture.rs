//! `capture`: intrinsics from a camera while its target is moved in front of it.

mod words;

use super::intrinsics::{model, words::describe};
use super::watch::sources::open_one;
use crate::args::{CornerArgs, TagArgs, positive};
use crate::output::{Outcome, print, print_answer, remark};
use crate::page::{PageArgs, run_beside};
use crate::stdio::is_quiet;
use anyhow::{Result, bail};
use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget};
use resight::answer::{CaptureAnswer, IntrinsicsAnswer};
use resight::capture::{Capture, CaptureConfig, FrameUse};
use resight::formats::{own_file, write_atomically};
use resight::intrinsics::Models;
use resight_serve::{Capturing, Server};
use resight_watch::capture::{CaptureEnd, News, Operator, Shown, capture};
use resight_watch::signals;
use resight_watch::source::Source;
use resight_watch::source::pictures::{Clock, ImageFiles};
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Estimates a camera's intrinsics while its target is moved in front of it.
///
/// Images that help are kept, each with the intrinsics so far and the view to take next. It ends by itself when the projection is known well
/// enough inside the covered part of the image, at the end of the source, or on Ctrl-C; with --serve where its page or Ctrl-C says so. The answer
/// is that of `resight intrinsics` for the kept images.
#[derive(Debug, Args)]
#[command(
    mut_arg("serve", |flag| flag.hide_short_help(false).requires("output").help("Shows the capture on a page at this address: the live image, the next view, what is known, and the button that ends it")),
    after_help = "Example: resight capture /dev/video0 --target board.toml -o camera.toml --keep kept",
    after_long_help = "Examples:
  resight capture /dev/video0 --target board.toml -o camera.toml --keep kept
  resight capture /dev/video0 --target board.toml -o camera.toml --serve 127.0.0.1:8600
  resight capture rtsp://cam.local/stream1 --target board.toml -o camera.toml
  resight capture board.mp4 --target board.toml -o camera.toml --enough-px 0.2
  resight capture 'left*.jpg' --target board.toml -o left.toml

Exit status: 0 enough; 1 not enough, or intrinsics that may not be relied on, with what is missing.
How to move the target: docs/capture.md."
)]
pub struct CaptureArgs {
    /// A device (/dev/video0), a stream, a video, a recording, a folder, or images.
    ///
    /// As `watch` takes them: 0, rtsp://…, http://…, run.mcap#/topic, 'left*.png'. An address with a password comes from the first line of a file
    /// that only you can read (@FILE) or from a variable (env:VARIABLE).
    #[arg(value_name = "SOURCE", required = true)]
    sources: Vec<String>,
    /// Target file.
    #[arg(long, value_name = "FILE")]
    target: PathBuf,
    /// Writes the kept images to FOLDER, as PNG.
    #[arg(long, value_name = "FOLDER")]
    keep: Option<PathBuf>,
    /// Ends when the projection is known to S pixels where corners were seen [default: 0.3].
    #[arg(long, value_name = "S", default_value_t = CaptureConfig::default().enough_px, hide_default_value = true, allow_negative_numbers = true, value_parser = positive)]
    enough_px: f64,
    /// Largest number of images kept.
    #[arg(long, hide_short_help = true, value_name = "N", default_value_t = CaptureConfig::default().most_views)]
    most_views: usize,
    /// Further options for ffmpeg, before its input: "-video_size 1280x720 -framerate 30" for a camera.
    #[arg(long, hide_short_help = true, value_name = "OPTIONS", allow_hyphen_values = true)]
    ffmpeg_input_options: Option<String>,
    /// Lens model: auto, or one of those of camera.toml [default: auto].
    #[arg(long, help_heading = "Solving", value_name = "MODEL", value_parser = model, default_value = "auto", hide_default_value = true)]
    model: Models,
    #[command(flatten)]
    corners: CornerArgs,
    /// Prints JSON Lines on stdout, one object per kept image and one for the answer, and nothing else.
    #[arg(long, help_heading = "Output")]
    json: bool,
    /// Writes the camera to FILE (TOML), which other commands read; none that may not be relied on.
    #[arg(long, short, help_heading = "Output", value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten, next_help_heading = "Output")]
    page: PageArgs,
}

/// See `CaptureArgs`.
pub fn run(args: &CaptureArgs) -> Result<Outcome> {
    args.output.as_deref().map_or(Ok(()), crate::files::must_be_writable)?;
    let (target, _) = super::target(&args.target, &TagArgs::default(), remark)?;
    let source = source(args)?;
    let mut job = Capture::new(
        target,
        CaptureConfig {
            enough_px: args.enough_px,
            most_views: args.most_views,
            are_photographs: source.are_photographs(),
            models: args.model,
            corner_window: args.corners.window(),
        },
    )?;
    args.keep.as_deref().map_or(Ok(()), empty_folder)?;
    let page = args.page.server()?.map(|server| show(args, server, &job)).transpose()?;
    let alone = Operator::default();
    let operator = page.as_ref().map_or(&alone, |page| page.operator());
    signals::stop_at_request(&operator.stop)?;
    let shown = Display::new(args, source.is_live());
    let end = capture(source, &mut job, (operator, page.is_some()), |job, news| {
        shown.take(job, &news)?;
        page.iter().for_each(|page| page.take(job, &news));
        Ok(())
    });
    shown.bar.finish_and_clear();
    let (answer, intrinsics) = (job.answer(), job.finish());
    let written = end.and_then(|end| Ok((end, write(args, &intrinsics)?)));
    if let Some(page) = page {
        page.ended(&job, written.as_ref().map(|(_, is_written)| *is_written).map_err(|e| format!("{e:#}")));
    }
    if written?.0 == CaptureEnd::Stopped && args.page.serve.is_none() {
        remark("stopped");
    }
    finish(args, &answer, &intrinsics)
}

/// A page that shows this capture, on a thread of its own.
fn show(args: &CaptureArgs, mut server: Server, job: &Capture) -> Result<Arc<Capturing>> {
    let output = args.output.as_deref().unwrap_or(Path::new("camera.toml"));
    let page = Arc::new(Capturing::new(args.sources.join(" "), output, job));
    server.show_capture(Arc::clone(&page));
    remark(&format!(
        "the page of this capture is http://{}/#live; it ends there, or with Ctrl-C",
        server.place()
    ));
    run_beside(server)?;
    Ok(page)
}

fn source(args: &CaptureArgs) -> Result<Box<dyn Source>> {
    match &args.sources[..] {
        [one] => open_one("SOURCE", one, args.ffmpeg_input_options.as_deref()),
        images => Ok(Box::new(ImageFiles::new(crate::files::expand(images)?, Clock::Taken))),
    }
}

/// A folder for the images of this capture alone: those of an earlier one would be taken for its own.
fn empty_folder(folder: &Path) -> Result<()> {
    crate::files::make_folder("--keep", folder)?;
    if folder.join(file_name("view-001")).exists() {
        bail!(
            "--keep {}: it holds the images of an earlier capture; give another folder, or remove them",
            folder.display()
        );
    }
    Ok(())
}

fn file_name(view: &str) -> String {
    format!("{view}.png")
}

/// What is shown while images come in.
struct Display<'a> {
    args: &'a CaptureArgs,
    is_live: bool,
    bar: ProgressBar,
}

impl<'a> Display<'a> {
    fn new(args: &'a CaptureArgs, is_live: bool) -> Self {
        let is_shown = !is_quiet() && std::io::stderr().is_terminal();
        let target = if is_shown { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        Display { args, is_live, bar: ProgressBar::with_draw_target(None, target).with_style(words::style()) }
    }

    fn take(&self, job: &Capture, news: &News) -> Result<()> {
        match news {
            News::Frame(frame) => self.frame(job, frame),
            News::TakenBack(kept) => {
                self.bar.suspend(|| remark(&format!("{} was taken back", kept.view)));
                let file = self.args.keep.as_ref().map(|folder| folder.join(file_name(&kept.view)));
                if let Some(Err(reason)) = file.as_ref().map(std::fs::remove_file) {
                    self.bar.suspend(|| remark(&format!("its image in --keep stays: {reason}")));
                }
                Ok(())
            }
            News::SourceEnded(reason) => {
                let reason = reason.as_ref().map_or(String::new(), |reason| format!(": {reason}"));
                self.bar.suspend(|| remark(&format!("the source has ended{reason}")));
                Ok(())
            }
        }
    }

    /// A kept image is written and reported; what became of the others shows on a terminal.
    fn frame(&self, job: &Capture, frame: &Shown) -> Result<()> {
        self.bar.set_message(frame.look.outcome.message());
        self.bar.tick();
        match (&frame.look.outcome, frame.image) {
            (FrameUse::Kept { view, .. }, Some(image)) => {
                if let Some(folder) = &self.args.keep {
                    let png = image.png().map_err(anyhow::Error::msg)?;
                    write_atomically(folder.join(file_name(view)), &png)?;
                }
                self.bar.suspend(|| self.kept(job))
            }
            (FrameUse::Unusable { .. } | FrameUse::OtherSize { .. }, _) => {
                let text = format!("{}: {}", frame.name, frame.look.outcome.message());
                // A live source would repeat it with every frame.
                if !self.is_live {
                    self.bar.suspend(|| remark(&text));
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn kept(&self, job: &Capture) -> Result<()> {
        let Some(answer) = job.view_answer() else { return Ok(()) };
        if self.args.json {
            return print(&format!("{}\n", serde_json::to_string(&answer)?));
        }
        print(&words::kept(&answer))?;
        if let (true, Some(next)) = (self.is_live, &answer.next_view) {
            print(&format!("  next view: {}\n", next.message))?;
        }
        Ok(())
    }
}

/// Writes the camera, where it may be relied on; returns whether it was.
fn write(args: &CaptureArgs, intrinsics: &IntrinsicsAnswer) -> Result<bool> {
    let reliable = intrinsics.reliable();
    let Some(path) = args.output.as_deref().filter(|_| !reliable.is_empty()) else { return Ok(false) };
    write_atomically(path, own_file(&reliable)?.as_bytes())?;
    Ok(true)
}

fn finish(args: &CaptureArgs, answer: &CaptureAnswer, intrinsics: &IntrinsicsAnswer) -> Result<Outcome> {
    answer.remarks.iter().for_each(|text| remark(text));
    let text = words::verdict(answer, &describe(intrinsics, args.output.as_deref()));
    print_answer(args.json, answer, &text, answer.status)?;
    Ok(Outcome::of([answer.status]))
}
