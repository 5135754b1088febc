//! Sources of frames: folders that fill up, lists, lines of text.

use resight::source::pictures::{Clock, Folder, Pictures};
use resight::source::{Content, Frame, Next, Source, lines};
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::time::Duration;

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
    std::fs::write(path.join("d.png"), b"half a picture").expect("written");
    let torn = frame(&mut source);
    assert!(matches!(&torn.content, Content::Unreadable(reason) if reason.contains("d.png")), "{torn:?}");
    std::fs::copy(picture(), path.join("e.png")).expect("copied");
    assert!(matches!(frame(&mut source).content, Content::Image(_)));
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
    assert!(Folder::open(&path.join("nowhere"), Clock::Modified).is_err());
}

#[test]
fn a_list_ends() {
    let mut source = Pictures::new([picture()], Clock::Every(1.0));
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
