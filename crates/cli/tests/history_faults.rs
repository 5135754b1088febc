//! `watch --history` under faults: killed, full disk, no access, two at once, damaged files. What was acknowledged is there. And what else a
//! session writes, on a disk that is full.

use crate::rig_support::Chance;
use crate::support::folder;
use crate::watch_support::{Session, lines, start, still, text};
use rusqlite::Connection;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

fn count(connection: &Connection, table: &str, session: i64) -> u64 {
    let select = format!("SELECT count(*) FROM {table} WHERE session = ?1");
    connection.query_row(&select, [session], |row| row.get::<_, i64>(0)).expect("a count") as u64
}

/// The last acknowledgement.
fn stored(session: &Session) -> Option<Value> {
    session.events().into_iter().rfind(|event| event["event"] == "stored")
}

/// The file is whole, and holds every row that a session acknowledged: how many frames those were.
fn all_acknowledged_is_there(path: &Path, session: &Session) -> u64 {
    let connection = Connection::open(path).expect("the history");
    let verdict: String =
        connection.query_row("PRAGMA integrity_check", [], |row| row.get(0)).expect("a verdict");
    assert_eq!(verdict, "ok");
    let Some(stored) = stored(session) else { return 0 };
    let number = stored["session"].as_i64().expect("a session");
    let (frames, events) =
        (stored["frames"].as_u64().expect("frames"), stored["events"].as_u64().expect("events"));
    assert!(frames <= count(&connection, "frame", number), "{stored}");
    assert!(events <= count(&connection, "event", number), "{stored}");
    let mut select =
        connection.prepare("SELECT number, t_s, rms_px FROM frame WHERE session = ?1").expect("a statement");
    let row =
        |row: &rusqlite::Row| Ok((row.get::<_, i64>(0)?, (row.get::<_, f64>(1)?, row.get::<_, f64>(2)?)));
    let rows: BTreeMap<i64, (f64, f64)> =
        select.query_map([number], row).expect("rows").collect::<Result<_, _>>().expect("rows");
    let Some(through_s) = stored["through_s"]["cam0"].as_f64() else { return 0 };
    let mut seen = 0;
    for frame in session.events().iter().filter(|event| event["event"] == "frame") {
        let t_s = frame["t_s"].as_f64().expect("a time");
        if t_s <= through_s {
            let wanted = (t_s, frame["rms_px"].as_f64().expect("a residual"));
            assert_eq!(rows.get(&frame["number"].as_i64().expect("a number")), Some(&wanted), "{frame}");
            seen += 1;
        }
    }
    assert_eq!(seen, frames, "of the frames told, those up to through_s are those stored");
    frames
}

/// Fifty instants at random in one file, each in the middle of commits a hundredth of a second apart; more with RESIGHT_KILLS.
#[test]
fn what_was_acknowledged_survives_kill_9() {
    let kills = std::env::var("RESIGHT_KILLS").ok().and_then(|n| n.parse().ok()).unwrap_or(50);
    let path = folder("history-kill").join("history.sqlite");
    let input = lines(0..400, 1.0 / 30.0, 0x71, still);
    let mut chance = Chance(0x72);
    let (mut acknowledged, mut in_the_middle) = (0, 0);
    for kill in 0..kills {
        let mut session = start(&[], &["--history", text(&path), "--history-commit-s", "0.005"]);
        session.feed(&input);
        session.wait_until("the first frame", |session| 0 < session.n_said());
        std::thread::sleep(Duration::from_micros((60_000.0 * chance.uniform()) as u64));
        session.kill();
        assert_eq!(session.log(), "", "run {kill}");
        let frames = all_acknowledged_is_there(&path, &session);
        acknowledged += frames;
        in_the_middle += u32::from(0 < frames && frames < 400);
    }
    println!("{kills} kills, {acknowledged} frames acknowledged, {in_the_middle} in the middle of a run");
    assert!(0 < acknowledged && 0 < in_the_middle, "the instants say nothing: too early or too late");
}

/// As `prlimit` sets it, in bytes: writing beyond it fails as on a full disk. The signal that comes with it is ignored.
fn with_limit(bytes: u64) -> [String; 3] {
    let script = format!("trap '' XFSZ; exec prlimit --fsize={bytes}:unlimited \"$@\"");
    ["sh".to_string(), "-c".to_string(), script]
}

fn connected(program: &str) -> bool {
    std::process::Command::new(program).arg("--version").output().is_ok_and(|run| run.status.success())
}

fn lift_limit(session: &Session) {
    let pid = session.child.id().to_string();
    let lifted = std::process::Command::new("prlimit").args(["--pid", &pid, "--fsize=unlimited"]).status();
    assert!(lifted.expect("prlimit").success());
}

/// Full in the middle of the session, and full when it starts.
#[test]
fn a_full_disk_degrades_and_recovers_without_restart() {
    if !connected("prlimit") {
        println!("skipped: prlimit is not installed");
        return;
    }
    for limit in [200_000, 0] {
        let path = folder(&format!("history-full-{limit}")).join("history.sqlite");
        let script = with_limit(limit);
        let before: Vec<&str> = script.iter().map(String::as_str).chain(["sh"]).collect();
        let mut session = start(&before, &["--history", text(&path), "--history-commit-s", "0.02"]);
        session.feed(&lines(0..2000, 1.0 / 30.0, 0x73, still));
        session.wait_until("degraded", |session| session.log().contains("history: degraded"));
        session.wait_until("frames go on", |session| 2000 < session.n_said());
        let n_said = session.n_said();
        session.feed(&lines(2000..2100, 1.0 / 30.0, 0x74, still));
        session.wait_until("frames go on", |session| n_said + 100 <= session.n_said());
        assert!(!session.log().contains("stored again"));
        lift_limit(&session);
        session.wait_until("recovered", |session| session.log().contains("stored again; nothing was lost"));
        assert_eq!(session.end(), 0);
        assert_eq!(all_acknowledged_is_there(&path, &session), 2100, "{}", session.log());
    }
}

/// Still full at the end: it says what is lost and does not hang.
#[test]
fn a_session_that_ends_with_a_full_disk_says_what_was_lost() {
    if !connected("prlimit") {
        println!("skipped: prlimit is not installed");
        return;
    }
    let path = folder("history-lost").join("history.sqlite");
    let script = with_limit(200_000);
    let before: Vec<&str> = script.iter().map(String::as_str).chain(["sh"]).collect();
    let mut session = start(&before, &["--history", text(&path), "--history-commit-s", "0.02"]);
    session.feed(&lines(0..100, 1.0 / 30.0, 0x75, still));
    session.wait_until("stored", |session| session.events().iter().any(|event| event["event"] == "stored"));
    session.feed(&lines(100..2000, 1.0 / 30.0, 0x75, still));
    session.end();
    let kept = all_acknowledged_is_there(&path, &session);
    assert!(0 < kept && kept < 2000, "{kept}");
    let said = format!("history: the session ended; {} frames", 2000 - kept);
    assert!(session.log().contains(&said), "{said}: {}", session.log());
}

#[test]
fn two_programs_share_a_history() {
    let path = folder("history-two").join("history.sqlite");
    let input = lines(0..1500, 1.0 / 30.0, 0x76, still);
    let arguments = ["--history", text(&path), "--history-commit-s", "0.002", "--once"];
    let mut both = [start(&[], &arguments), start(&[], &arguments)];
    both.iter_mut().for_each(|session| session.feed(&input));
    for session in &mut both {
        assert_eq!(session.end(), 0, "{}", session.log());
    }
    for session in &both {
        assert_eq!(all_acknowledged_is_there(&path, session), 1500, "{}", session.log());
    }
    let of = |session| stored(session).expect("acknowledged")["session"].clone();
    assert_ne!(of(&both[0]), of(&both[1]));
}

fn run_once(path: &Path) -> (i32, Session) {
    let mut session = start(&[], &["--history", text(path), "--once"]);
    // A program that refuses the history is gone before it reads.
    let _ = std::io::Write::write_all(
        session.stdin.as_mut().expect("stdin"),
        lines(0..100, 1.0, 0x77, still).concat().as_bytes(),
    );
    (session.end(), session)
}

#[test]
fn a_damaged_history_is_put_aside() {
    let folder = folder("history-damaged");
    for (name, spoil) in [("garbage", true), ("middle", false)] {
        let path = folder.join(format!("{name}.sqlite"));
        if spoil {
            std::fs::write(&path, "no database at all\n".repeat(700)).expect("written");
        } else {
            assert_eq!(run_once(&path).0, 0);
            let mut bytes = std::fs::read(&path).expect("read");
            let middle = bytes.len() / 2;
            bytes[4096..middle].iter_mut().for_each(|byte| *byte ^= 0x5a);
            std::fs::write(&path, bytes).expect("written");
        }
        let spoilt = std::fs::read(&path).expect("read");
        let (code, session) = run_once(&path);
        assert_eq!(code, 0, "{}", session.log());
        assert_eq!(all_acknowledged_is_there(&path, &session), 100);
        assert!(session.log().contains("history: the file was damaged"), "{}", session.log());
        let aside =
            std::fs::read_dir(&folder).expect("the folder").map(|entry| entry.expect("an entry").path());
        let prefix = format!("{name}.sqlite.corrupt-");
        let is_it = |path: &std::path::PathBuf| {
            let name = path.file_name().expect("a name").to_string_lossy().to_string();
            name.starts_with(&prefix) && !name.ends_with("-wal") && !name.ends_with("-shm")
        };
        let aside: Vec<_> = aside.filter(is_it).collect();
        assert_eq!(aside.len(), 1, "{aside:?}");
        assert_eq!(std::fs::read(&aside[0]).expect("read"), spoilt);
    }
}

#[test]
fn histories_of_others_are_refused_and_left_alone() {
    let folder = folder("history-others");
    let newer = folder.join("newer.sqlite");
    assert_eq!(run_once(&newer).0, 0);
    let change = |path: &Path, sql: &str| {
        let connection = Connection::open(path).expect("a database");
        connection.execute_batch(sql).expect("changed");
    };
    change(&newer, "PRAGMA user_version = 99");
    let foreign = folder.join("foreign.sqlite");
    change(&foreign, "CREATE TABLE album (title TEXT)");
    let nowhere = folder.join("no/such/folder/history.sqlite");
    for (path, words) in [
        (&newer, "schema version 99, this program knows 2"),
        (&foreign, "no history of Resight"),
        (&nowhere, "give a file in a folder that exists and can be written"),
    ] {
        let before = std::fs::read(path).ok();
        let (code, session) = run_once(path);
        assert_eq!(code, 2);
        assert!(session.log().contains(words), "{words}: {}", session.log());
        assert_eq!(std::fs::read(path).ok(), before, "{} was changed", path.display());
    }
}

/// Root writes everywhere but into /proc.
#[cfg(target_os = "linux")]
#[test]
fn a_folder_that_cannot_be_written_is_refused_at_the_start() {
    use std::os::unix::fs::PermissionsExt;
    let closed = folder("history-read-only");
    std::fs::set_permissions(&closed, std::fs::Permissions::from_mode(0o555)).expect("set");
    let may_write = std::fs::write(closed.join("probe"), "").is_ok();
    let folder = if may_write { Path::new("/proc") } else { closed.as_path() };
    let (code, session) = run_once(&folder.join("history.sqlite"));
    assert_eq!(code, 2);
    assert!(session.log().contains("can be written"), "{}", session.log());
}

/// Somebody moves the file away while it is open: what is acknowledged from then on is in the new one.
#[cfg(unix)]
#[test]
fn a_history_that_was_moved_away_is_begun_anew() {
    let folder = folder("history-moved");
    let path = folder.join("history.sqlite");
    let mut session = start(&[], &["--history", text(&path), "--history-commit-s", "0.02"]);
    session.feed(&lines(0..100, 1.0, 0x78, still));
    session.wait_until("stored", |s| stored(s).is_some_and(|s| s["frames"] == 100));
    for part in ["", "-wal", "-shm"] {
        let name = |stem: &str| folder.join(format!("{stem}.sqlite{part}"));
        if name("history").exists() {
            std::fs::rename(name("history"), name("old")).expect("renamed");
        }
    }
    session.feed(&lines(100..200, 1.0, 0x79, still));
    session.wait_until("stored anew", |s| s.log().contains("stored again"));
    assert_eq!(session.end(), 0);
    assert!(session.log().contains("moved or replaced"), "{}", session.log());
    let rows = |name: &str| count(&Connection::open(folder.join(name)).expect("a history"), "frame", 1);
    assert_eq!((rows("old.sqlite"), rows("history.sqlite")), (100, 100));
}

fn limit(session: &Session, bytes: u64) {
    let pid = session.child.id().to_string();
    let limit = format!("--fsize={bytes}:unlimited");
    let limited = std::process::Command::new("prlimit").args(["--pid", &pid, &limit]).status();
    assert!(limited.expect("prlimit").success());
}

/// The log is on the full disk too: nothing can be reported, and the session continues.
#[cfg(target_os = "linux")]
#[test]
fn a_log_that_cannot_be_written_stops_nothing() {
    if !connected("prlimit") {
        println!("skipped: prlimit is not installed");
        return;
    }
    let folder = folder("faults-log");
    let (path, reference) = (folder.join("history.sqlite"), folder.join("gate.ref.toml"));
    let script = "trap '' XFSZ; exec prlimit --fsize=200000:unlimited \"$@\" 2> /dev/full";
    let arguments =
        ["--history", text(&path), "--history-commit-s", "0.02", "--save-reference", text(&reference)];
    let mut session = start(&["sh", "-c", script, "sh"], &arguments);
    session.feed(&lines(0..2000, 1.0 / 30.0, 0x7a, still));
    session.wait_until("frames go on", |session| 2000 < session.n_said());
    // Long enough for several commits: the disk is full, and said to be.
    std::thread::sleep(Duration::from_secs(1));
    // On a busy machine the first commit may be too large already.
    assert!(stored(&session).is_none_or(|stored| stored["frames"].as_u64() < Some(2000)));
    lift_limit(&session);
    session.wait_until("stored", |session| stored(session).is_some_and(|stored| stored["frames"] == 2000));
    assert_eq!(session.end(), 0);
    assert_eq!(all_acknowledged_is_there(&path, &session), 2000);
    assert!(reference.is_file());
}

fn recordings(folder: &Path) -> Vec<(String, u64)> {
    let entries = std::fs::read_dir(folder).expect("the folder").map(|entry| entry.expect("an entry"));
    let of = |entry: std::fs::DirEntry| {
        (entry.file_name().to_string_lossy().to_string(), entry.metadata().expect("its size").len())
    };
    let mut all: Vec<_> = entries.map(of).filter(|(name, _)| name.ends_with(".mcap")).collect();
    all.sort();
    all
}

fn feed(session: &mut Session, next: &mut usize, n: usize) {
    session.feed(&lines(*next..*next + n, 1.0 / 30.0, 0x7b, still));
    *next += n;
}

fn feed_until(session: &mut Session, next: &mut usize, words: &str) {
    for _ in 0..1000 {
        if session.log().contains(words) {
            return;
        }
        feed(session, next, 3);
        std::thread::sleep(Duration::from_millis(100));
    }
    panic!("not said: {words}; the log: {}", session.log());
}

/// Full for several tries: said once, and no empty file for each of them.
#[test]
fn a_recording_waits_for_room_without_a_word_and_without_leavings() {
    if !connected("prlimit") {
        println!("skipped: prlimit is not installed");
        return;
    }
    let folder = folder("faults-tf");
    let path = folder.join("poses.mcap");
    let mut session = start(&["sh", "-c", "trap '' XFSZ; exec \"$@\"", "sh"], &["--tf", text(&path)]);
    let mut next = 0;
    feed(&mut session, &mut next, 60);
    session.wait_until("a first chunk", |_| recordings(&folder).iter().any(|(_, bytes)| 1000 < *bytes));
    limit(&session, 0);
    feed_until(&mut session, &mut next, "cannot be written");
    for _ in 0..40 {
        feed(&mut session, &mut next, 3);
        std::thread::sleep(Duration::from_millis(100));
    }
    assert_eq!(session.log().lines().filter(|line| line.contains(" tf: ")).count(), 1, "{}", session.log());
    assert!(recordings(&folder).len() <= 2, "{:?}", recordings(&folder));
    lift_limit(&session);
    feed_until(&mut session, &mut next, "continues in");
    assert_eq!(session.end(), 0);
    let all = recordings(&folder);
    assert!(all.len() == 2 && all.iter().all(|(_, bytes)| 1000 < *bytes), "{all:?}");
}

/// The reference is learned while the disk is full: the session continues, and writes it when there is room.
#[test]
fn what_is_learned_on_a_full_disk_is_written_later() {
    if !connected("prlimit") {
        println!("skipped: prlimit is not installed");
        return;
    }
    for is_lifted in [true, false] {
        let reference = folder(&format!("faults-reference-{is_lifted}")).join("gate.ref.toml");
        let script = with_limit(0);
        let before: Vec<&str> = script.iter().map(String::as_str).chain(["sh"]).collect();
        let mut session = start(&before, &["--save-reference", text(&reference), "--once"]);
        session.feed(&lines(0..100, 1.0, 0x7d, still));
        session.wait_until("told", |session| session.log().contains("tried again every 10 s and at the end"));
        session.feed(&lines(100..150, 1.0, 0x7e, still));
        session.wait_until("frames go on", |session| 150 < session.n_said());
        if is_lifted {
            lift_limit(&session);
        }
        assert_eq!(session.end(), if is_lifted { 0 } else { 2 }, "{}", session.log());
        assert_eq!(session.events().last().expect("a verdict")["state"], "steady");
        assert_eq!(reference.is_file(), is_lifted, "{}", session.log());
    }
}
