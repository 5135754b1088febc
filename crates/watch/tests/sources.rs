//! Sources of frames: folders that fill up, lists, lines of text.

use resight_watch::source::pictures::{Clock, Folder, ImageFiles};
use resight_watch::source::{Content, Frame, Next, Source, lines};
use std::io::{BufReader, Cursor, Read};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

const SOON: Duration = Duration::from_millis(20);

fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    // A folder of an earlier run.
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).expect("a folder");
    path
}

fn picture() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/demo/left.png")
}

/// The next frame; looks again while there is nothing.
fn frame(source: &mut dyn Source) -> Frame {
    for _ in 0..200 {
        match source.next(SOON) {
            Next::Frame(frame) => return frame,
            Next::Nothing => {}
            other => panic!("{other:?}"),
        }
    }
    panic!("no frame came")
}

#[test]
fn a_folder_gives_what_appears_in_it_by_name_and_only_once() {
    let path = folder("filling");
    for name in ["b.png", "a.PNG", ".c.png.tmp", "notes.txt"] {
        std::fs::copy(picture(), path.join(name)).expect("copied");
    }
    let mut source = Folder::open(&path, Clock::Every(2.0)).expect("a folder");
    let first = [frame(&mut source), frame(&mut source)];
    assert!(first[0].name.ends_with("a.PNG") && first[1].name.ends_with("b.png"));
    assert_eq!(first.map(|frame| frame.capture_s), [0.0, 2.0]);
    assert!(matches!(source.next(SOON), Next::Nothing));
    std::fs::write(path.join("d.png"), b"half an image").expect("written");
    let torn = frame(&mut source);
    assert!(matches!(&torn.content, Content::Unreadable(reason) if reason.contains("d.png")), "{torn:?}");
    std::fs::copy(picture(), path.join("e.png")).expect("copied");
    assert!(matches!(frame(&mut source).content, Content::Image(_)));
}

/// The first half of an image, and the rest when the uplink rests for longer than a writer does.
#[test]
fn a_slow_upload_is_read_when_it_is_whole() {
    let path = folder("slow");
    let whole = std::fs::read(picture()).expect("an image");
    let slow = path.join("a.png");
    std::fs::write(&slow, &whole[..whole.len() / 2]).expect("written");
    let mut source = Folder::open(&path, Clock::Every(1.0)).expect("a folder").as_it_is();
    let begun = Instant::now();
    while begun.elapsed() < Duration::from_millis(600) {
        assert!(matches!(source.next(SOON), Next::Nothing), "it may be whole later");
    }
    std::fs::write(&slow, &whole).expect("written");
    let late = frame(&mut source);
    assert!(matches!(late.content, Content::Image(_)) && late.number == 0, "{late:?}");
    assert!(matches!(source.next(SOON), Next::End));
}

/// Told once that it is torn; when it grows all the same, it is read again.
#[test]
fn a_torn_picture_that_grows_after_all_is_read() {
    let path = folder("torn");
    let whole = std::fs::read(picture()).expect("an image");
    let torn = path.join("a.png");
    std::fs::write(&torn, &whole[..whole.len() / 2]).expect("written");
    let mut source = Folder::open(&path, Clock::Every(1.0)).expect("a folder");
    assert!(matches!(frame(&mut source).content, Content::Unreadable(_)));
    for _ in 0..20 {
        assert!(matches!(source.next(SOON), Next::Nothing), "it is reported once");
    }
    std::fs::write(&torn, &whole).expect("written");
    assert!(matches!(frame(&mut source).content, Content::Image(_)));
}

/// A ring of few names, the oldest deleted: a name that comes again is a new image, and nothing is kept of what is gone.
#[test]
fn a_name_that_comes_again_is_a_new_picture() {
    let path = folder("ring");
    let mut source = Folder::open(&path, Clock::Modified).expect("a folder");
    for _ in 0..3 {
        std::fs::copy(picture(), path.join("a.png")).expect("copied");
        assert!(matches!(frame(&mut source).content, Content::Image(_)));
        std::fs::remove_file(path.join("a.png")).expect("removed");
        assert!(matches!(source.next(SOON), Next::Nothing));
    }
}

#[test]
fn a_folder_that_goes_away_is_lost_and_may_come_back() {
    let path = folder("leaving");
    let mut source = Folder::open(&path, Clock::Modified).expect("a folder");
    std::fs::remove_dir_all(&path).expect("removed");
    assert!(matches!(source.next(SOON), Next::Lost(_)));
    std::fs::create_dir_all(&path).expect("back");
    std::fs::copy(picture(), path.join("a.png")).expect("copied");
    let back = frame(&mut source);
    // Seconds since 1970, not the start of anything.
    assert!(1.6e9 < back.capture_s, "{}", back.capture_s);
    assert!(Folder::open(path.join("nowhere"), Clock::Modified).is_err());
}

#[test]
fn a_list_ends() {
    let mut source = ImageFiles::new([picture()], Clock::Every(1.0));
    assert!(matches!(frame(&mut source).content, Content::Image(_)));
    assert!(matches!(source.next(SOON), Next::End));
    assert!(!source.is_live());
}

#[test]
fn lines_go_to_the_camera_they_name() {
    let text = r#"{"camera": "b", "t_s": 1.5, "detections": [{"id": 3, "corner": 1, "u_px": 10.0, "v_px": 20.5, "sigma_px": 0.2}]}
{"camera": "a", "t_s": 2.5, "detections": []}
{"camera": "b", "t_s": 3.5, "detections": [{"id": 3, "corner": 1, "u_px": 10.0, "v_px": 20.5, "sigma_px": -1.0}]}
"#;
    let mut sources = lines::sources(Cursor::new(text), &["a".to_string(), "b".to_string()]);
    let first = frame(&mut sources[1]);
    let Content::Detections(detections) = &first.content else { panic!("{first:?}") };
    assert_eq!((first.capture_s, detections[0].feature.id, detections[0].pixel.y), (1.5, 3, 20.5));
    assert_eq!(frame(&mut sources[0]).capture_s, 2.5);
    let bad = frame(&mut sources[1]);
    assert!(
        matches!(&bad.content, Content::Unreadable(reason) if reason.starts_with("line 3") && reason.contains("sigma_px -1"))
    );
    for source in &mut sources {
        assert!(matches!(source.next(Duration::from_secs(5)), Next::End));
    }
}

/// Each camera has its own clock: a bad line has the time of that camera's last one, and belongs to the camera it names.
#[test]
fn a_bad_line_has_no_other_camera_s_time() {
    let text = r#"{"camera": "a", "t_s": 5.0, "detections": []}
{"camera": "b", "t_s": 90000.0, "detections": []}
{"camera": "b", "t_s": "late"}
no JSON
{"camera": "c", "t_s": 7.0, "detections": []}
"#;
    let mut sources = lines::sources(Cursor::new(text), &["a".to_string(), "b".to_string()]);
    let mut reported = |camera: usize, n: usize| {
        (0..n).map(|_| frame(&mut sources[camera])).map(|f| (f.name, f.capture_s)).collect::<Vec<_>>()
    };
    let line = |number: u32, t_s: f64| (format!("line {number}"), t_s);
    assert_eq!(reported(0, 3), [line(1, 5.0), line(4, 5.0), line(5, 5.0)]);
    assert_eq!(reported(1, 2), [line(2, 90000.0), line(3, 90000.0)]);
}

/// A line without end, as of a front end that runs wild, 64 MB of it: it is passed over, and the next is read.
#[test]
fn a_line_without_end_is_refused_and_the_next_is_read() {
    let good = b"\n{\"t_s\": 2.0, \"detections\": []}\n";
    let input = std::io::repeat(b'x').take(64 << 20).chain(Cursor::new(good));
    let mut sources = lines::sources(BufReader::new(input), &["a".to_string()]);
    let long = frame(&mut sources[0]);
    assert!(
        matches!(&long.content, Content::Unreadable(reason) if reason.contains("67108865 bytes; the limit is 4194304")),
        "{long:?}"
    );
    assert_eq!(frame(&mut sources[0]).capture_s, 2.0);
}
