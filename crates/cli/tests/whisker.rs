//! `whisker`: readings to contacts to objects, every spelling of a file, every kind of bad line, and a stream that answers at once.

use crate::recorded::recorded;
use crate::support::{answer, folder, json_lines, resight};
use serde_json::Value;
use std::fmt::Write as _;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{ChildStdin, ChildStdout, Command, Stdio};

fn shipped(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/whisker").join(name).display().to_string()
}

fn text(path: impl AsRef<Path>) -> String {
    std::fs::read_to_string(path).unwrap()
}

fn write(folder: &Path, name: &str, text: &str) -> String {
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path.display().to_string()
}

/// The shipped readings as numbers: sweep, sample, t, hub_angle, hub_x, hub_y, fx, fy, mz.
fn readings() -> Vec<[f64; 9]> {
    let row = |line: &str| {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        cells.try_into().unwrap()
    };
    text(shipped("hub.csv")).lines().skip(1).map(row).collect()
}

/// Solves a file of the shipped whisker; one JSON object a reading, then the record.
fn solved(hub: &str, flags: &[&str]) -> Vec<Value> {
    let whisker = shipped("whisker.json");
    let run = resight(&[&["whisker", "solve", "--whisker", &whisker, hub, "--json"], flags].concat());
    assert_eq!(run.code, 0, "{}{}", run.stdout, run.stderr);
    assert!(run.stdout.lines().all(|line| line.starts_with(r#"{"schema":2,"#)), "{}", run.stdout);
    json_lines(&run)
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value}"))
}

/// Of `whisker check --json`.
fn score<'a>(checked: &'a Value, group: &str) -> &'a Value {
    checked["scores"].as_array().unwrap().iter().find(|s| s["group"] == group).unwrap()
}

fn checked(arguments: &[&str]) -> Value {
    let run = resight(&[&["whisker", "check", "--json"], arguments].concat());
    assert_eq!(run.code, 0, "{}{}", run.stdout, run.stderr);
    json_lines(&run).remove(0)
}

#[test]
fn readings_become_contacts_become_the_object() {
    let folder = folder("whisker-pipeline");
    let path = |name: &str| folder.join(name).display().to_string();
    let (contacts, object) = (path("contacts.csv"), path("object.json"));
    let hub = shipped("hub.csv");
    let run = resight(&["whisker", "solve", "--whisker", &shipped("whisker.json"), &hub, "-o", &contacts]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    let rows = text(&contacts);
    assert_eq!(rows.lines().count(), readings().len() + 1);
    let header = "sweep,sample,t,contact,x,y,s,theta,f_normal,f_tangent,friction_angle,k2,mode,mode_probability,\
                  cov_xx,cov_xy,cov_yy,cov_xtheta,cov_ytheta,cov_thetatheta,branch,status,side,";
    assert!(rows.starts_with(header), "{}", rows.lines().next().unwrap());

    let scores = checked(&[&contacts, &shipped("truth.csv")]);
    let firm = score(&scores, "firm");
    // The bound of a reading for itself, with friction and tip known, is 1.6 mm here; one seed scatters by a tenth.
    assert!(number(&firm["rms_m"]) < 1.9e-3, "{firm}");
    // 190 contacts: the mean of χ² with two degrees of freedom scatters by 0.15.
    assert!((1.4..2.6).contains(&number(&firm["nees"])), "{firm}");
    assert!(0.98 <= number(&firm["mode_right"]), "{firm}");
    assert_eq!(scores["n_false"], 0);
    // Before the touch there is nothing to score: null, which the schema allows.
    let free: String = text(shipped("truth.csv")).lines().take(3).map(|line| format!("{line}\n")).collect();
    let untouched = checked(&[&contacts, &write(&folder, "free.csv", &free)]);
    assert!(score(&untouched, "all")["rms_m"].is_null(), "{untouched}");

    let run = resight(&["whisker", "identify", &contacts, "-o", &object]);
    assert_eq!(run.code, 0, "{}{}", run.stdout, run.stderr);
    let found: Value = serde_json::from_str(&text(&object)).unwrap();
    assert_eq!(found["verdict"], "square");
    for key in ["parameters", "covariance", "scores", "coverage"] {
        assert!(!found[key].is_null(), "{key}");
    }
    let side = &found["parameters"]["side_m"];
    let error = (number(&side["value"]) - 0.04).abs();
    assert!(error < 5.0 * number(&side["sigma"]) && error < 1e-4, "{side}");
}

#[test]
fn sweep_mode_knows_the_place_along_the_whisker() {
    let (hub, truth, whisker) = (shipped("hub.csv"), shipped("truth.csv"), shipped("whisker.json"));
    let scores = checked(&[&hub, &truth, "--whisker", &whisker, "--mode", "sweep"]);
    assert!(number(&score(&scores, "firm")["rms_m"]) < 0.3e-3, "{scores}");
    let rows = solved(&hub, &["--mode", "sweep"]);
    let record = rows.last().unwrap();
    let error = (number(&record["mu"]) - 0.2).abs();
    assert!(error < 5.0 * number(&record["mu_sigma"]), "{record}");
}

/// Whoever reads an answer finds each key's meaning in the schema: numbers with their unit, words with all there are.
#[test]
fn the_schema_describes_every_key_of_a_contact() {
    let schema: Value = serde_json::from_str(&resight(&["schema"]).stdout).unwrap();
    let reference = schema["answers"]["whisker_contact"]["$ref"].as_str().unwrap();
    let contact = schema.pointer(reference.trim_start_matches('#')).unwrap();
    assert!(contact["description"].as_str().unwrap().starts_with("The contact of one reading"), "{contact}");
    let keys = contact["properties"].as_object().unwrap();
    let rows = solved(&shipped("hub.csv"), &[]);
    for key in rows[0].as_object().unwrap().keys().filter(|key| *key != "schema") {
        assert!(keys[key]["description"].is_string(), "{key}");
    }
    for (key, word) in [("status", "beyond_tip"), ("mode", "mid"), ("side", "left"), ("event", "slip_off")] {
        assert!(keys[key]["enum"].as_array().unwrap().contains(&word.into()), "{key}: {}", keys[key]);
    }
}

/// Simulated again without noise, the raw contacts are where the simulator has them.
#[test]
fn simulated_readings_are_solved_exactly() {
    let folder = folder("whisker-simulate");
    let path = |name: &str| folder.join(name).display().to_string();
    let (hub, truth, whisker) = (path("hub.csv"), path("truth.csv"), shipped("whisker.json"));
    let (square, sweeps) = (shipped("square.json"), shipped("path.json"));
    let simulate = ["whisker", "simulate", "--whisker", &whisker, "--object", &square, "--path", &sweeps];
    let files = ["--samples", "80", "-o", &hub, "--truth", &truth];
    let run = resight(&[&simulate[..], &files].concat());
    assert_eq!(run.code, 0, "{}", run.stderr);
    assert!(run.stdout.contains("touch at") && run.stdout.contains("slip-off at"), "{}", run.stdout);
    let scores = checked(&[&hub, &truth, "--whisker", &whisker, "--mode", "raw"]);
    // The simulator's own equilibria are good to 1e-7 of the whisker.
    assert!(number(&score(&scores, "firm_mid")["median_m"]) < 1e-8, "{scores}");
    assert_eq!(
        score(&scores, "all")["n_true"],
        score(&checked(&[&shipped("hub.csv"), &shipped("truth.csv"), "--whisker", &whisker]), "all")["n_true"]
    );

    let again = path("again.csv");
    for seed in ["7", "7", "8"] {
        let noisy = ["--samples", "80", "--noise-seed", seed, "-o", &again];
        assert_eq!(resight(&[&simulate[..], &noisy].concat()).code, 0);
        // The shipped readings came from seed 7; rounding to steps hides the last digits of the machine.
        assert_eq!(text(&again) == text(shipped("hub.csv")), seed == "7", "{seed}");
    }
}

/// Other units, another order, other axes, the opposite sign, objects for cells: the same contacts.
#[test]
fn spellings_of_the_same_readings_give_the_same_contacts() {
    let folder = folder("whisker-spellings");
    let wanted = solved(&shipped("hub.csv"), &["--mode", "raw"]);
    let degrees = |rad: f64| rad.to_degrees();
    let mut units = String::from(
        "# units in the header\n\nmz[N mm],fx (mN),hub_angle_deg,sweep,fy[mN],hub_y[mm],hub_x[mm],sample,t[ms]\n",
    );
    let mut flags = String::from("hub_y;hub_x;hub_angle;sweep;sample;mz;fy;fx;remark\r\n");
    let mut world = String::from("sweep\tsample\ttime\tpsi\thub_x\thub_y\tfx\tfy\tmz\n");
    let mut objects = String::new();
    for [sweep, sample, t, angle, x, y, fx, fy, mz] in readings() {
        writeln!(
            units,
            "{},{},{},{sweep},{},{},{},{sample},{}",
            1e3 * mz,
            1e3 * fx,
            degrees(angle),
            1e3 * fy,
            1e3 * y,
            1e3 * x,
            1e3 * t
        )
        .unwrap();
        write!(
            flags,
            "{};{};{};{sweep};{sample};{};{};{};\"a; b\"\r\n",
            1e3 * y,
            1e3 * x,
            degrees(angle),
            -1e3 * mz,
            -fy,
            -fx
        )
        .unwrap();
        let (sin, cos) = angle.sin_cos();
        writeln!(
            world,
            "{sweep}\t{sample}\t{t}\t{angle}\t{x}\t{y}\t{}\t{}\t{mz}",
            cos * fx - sin * fy,
            sin * fx + cos * fy
        )
        .unwrap();
        writeln!(objects, "{{\"sweep\":{sweep},\"sample\":{sample},\"t\":{t},\"hub_angle\":{angle},\"hub_x\":{x},\"hub_y\":{y},\"fx\":{fx},\"fy\":{fy},\"mz[N mm]\":{}}}", 1e3 * mz).unwrap();
    }
    let cases: [(&str, &str, &[&str]); 4] = [
        ("units.csv", &units, &[]),
        ("flags.csv", &flags, &["--units", "length=mm,angle=deg,moment=Nmm", "--sign", "on-whisker"]),
        ("world.tsv", &world, &["--force-frame", "world"]),
        ("objects.jsonl", &objects, &[]),
    ];
    for (name, content, extra) in cases {
        let rows = solved(&write(&folder, name, content), &[&["--mode", "raw"], extra].concat());
        assert_eq!(rows.len(), wanted.len(), "{name}");
        for (row, wanted) in rows.iter().zip(&wanted) {
            assert_eq!((&row["status"], &row["sample"]), (&wanted["status"], &wanted["sample"]), "{name}");
            for key in ["x", "y", "theta", "cov_xx"] {
                let near = match (row[key].as_f64(), wanted[key].as_f64()) {
                    (Some(a), Some(b)) => (a - b).abs() <= 1e-6 * b.abs() + 1e-9, // Units and back cost some ulps, the weakest contacts magnify them.
                    (a, b) => a == b,
                };
                assert!(near, "{name} {key}: {row} {wanted}");
            }
        }
    }
}

#[test]
fn numbers_of_the_contacts_file_are_read_back_whole() {
    let folder = folder("whisker-round-trip");
    let (csv, lines) =
        (folder.join("c.csv").display().to_string(), folder.join("c.jsonl").display().to_string());
    for output in [&csv, &lines] {
        solved(&shipped("hub.csv"), &["-o", output]);
    }
    let [a, b] = [&csv, &lines].map(|path| checked(&[path, &shipped("truth.csv")]));
    assert_eq!(a, b);
    let columns: Vec<String> = text(&csv).lines().next().unwrap().split(',').map(str::to_string).collect();
    for (row, line) in text(&csv).lines().skip(1).zip(text(&lines).lines()) {
        let object = answer(line);
        for (name, cell) in columns.iter().zip(row.split(',')) {
            if let Some(number) = object[name].as_f64() {
                assert_eq!(cell.parse::<f64>().unwrap(), number, "{name}");
            }
        }
    }
}

#[test]
fn a_reading_with_an_empty_cell_keeps_its_row() {
    let folder = folder("whisker-missing");
    let mut lines: Vec<String> = text(shipped("hub.csv")).lines().map(str::to_string).collect();
    for (at, empty) in [(41, ""), (42, "nan")] {
        let cells: Vec<&str> = lines[at].split(',').collect();
        lines[at] = [&cells[..8], &[empty]].concat().join(",");
    }
    let hub = write(&folder, "hub.csv", &lines.join("\n"));
    let run = resight(&["whisker", "solve", "--whisker", &shipped("whisker.json"), &hub, "--json"]);
    assert_eq!(run.code, 1, "{}", run.stderr);
    let rows = json_lines(&run);
    assert_eq!(rows.len(), lines.len()); // A header less, a record more.
    for row in &rows[40..42] {
        assert_eq!((&row["status"], &row["contact"]), (&Value::from("missing"), &Value::from(0)));
        assert!(row["note"].as_str().unwrap().contains("mz"), "{row}");
    }
    assert_eq!(rows[42]["status"], "ok");
}

#[test]
fn bad_files_are_reported_with_line_and_column() {
    let folder = folder("whisker-bad");
    let header = "sweep,sample,t,hub_angle,hub_x,hub_y,fx,fy,mz\n";
    let good = "0,0,0,1.5,0,0,0.1,0.2,0.03\n";
    let cases = [
        ("", "no readings"),
        (header, "no rows"),
        (
            &format!("{header}{good}0,1,0,1.5,0,0,0.1,0;2,0.03\n"),
            ":3: column `fy` is `0;2`, which is not a number",
        ),
        (&format!("{header}# remark\n{good}0,1,0,1.5,0,0,0.1\n"), ":4: 7 cells where the header has 9"),
        (&format!("{header}0,1,0,1.5,0,0,0.1,1e999,0.03\n"), ":2: column `fy` is `1e999`; a finite number"),
        (&format!("{header}0,1.5,0,1.5,0,0,0.1,1,0.03\n"), ":2: column `sample` is 1.5; a whole number"),
        (&header.replace(",mz", ",torque"), "no column `mz`; the columns are sweep"),
        (&header.replace("fy", "fx"), "column `fx` appears twice"),
        (&header.replace("fy", "fx[N]"), "both mean fx"),
        (&header.replace("mz", "mz[N]"), "`N` is no unit of moment; there are nm, nmm"),
        (good, "the header is missing"),
        ("{\"hub_angle\": 1}\n", ":1: no column `hub_x`"),
        ("{\"hub_angle\": }\n", ":1: no JSON object"),
    ];
    for (content, wanted) in cases {
        let hub = write(&folder, "hub.csv", content);
        let run = resight(&["whisker", "solve", "--whisker", &shipped("whisker.json"), &hub]);
        assert_eq!(run.code, 2, "{content}");
        assert!(run.stderr.contains(wanted), "{content}\nsaid {}\nwanted {wanted}", run.stderr);
    }
}

#[test]
fn bad_whisker_files_are_reported_by_key() {
    let folder = folder("whisker-bad-meta");
    let whisker = |inside: &str| format!("{{\"whisker\": {{{inside}}}}}");
    let cases = [
        ("[]".to_string(), "`whisker` is missing"),
        (whisker("\"length\": 1"), "`whisker.length_m` is missing; there are length"),
        (whisker("\"length_m\": -1"), "`whisker.length_m` is `-1`; a positive number is needed"),
        (whisker("\"length_m\": 0.2"), "the stiffness is missing"),
        (whisker("\"length_m\": 0.2, \"EI_Nm2\": \"x\""), "`whisker.EI_Nm2` is `\"x\"`"),
        (
            whisker("\"length_m\": 0.2, \"EI_profile\": {\"s_m\": [0, 0.1], \"EI_Nm2\": [1, 1]}"),
            "arc lengths from 0 to",
        ),
        ("{".to_string(), "no JSON"),
    ];
    for (content, wanted) in cases {
        let meta = write(&folder, "whisker.json", &content);
        let run = resight(&["whisker", "solve", "--whisker", &meta, &shipped("hub.csv")]);
        assert_eq!(run.code, 2, "{content}");
        assert!(run.stderr.contains(wanted), "{content}\nsaid {}", run.stderr);
    }
}

/// A profile of constant EI and curvature 0 is the uniform whisker, whichever way it is solved.
#[test]
fn a_flat_profile_is_the_uniform_whisker() {
    let folder = folder("whisker-profile");
    let mut meta: Value = serde_json::from_str(&text(shipped("whisker.json"))).unwrap();
    let ei = 2.0e11 * std::f64::consts::PI * 0.0008_f64.powi(4) / 64.0;
    meta["whisker"]["EI_profile"] = serde_json::json!({"s_m": [0.0, 0.07, 0.2], "EI_Nm2": [ei, ei, ei]});
    let profile = write(&folder, "profile.json", &meta.to_string());
    let hub = shipped("hub.csv");
    let run = resight(&["whisker", "solve", "--whisker", &profile, &hub, "--mode", "raw", "--json"]);
    let wanted =
        [solved(&hub, &["--mode", "raw"]), solved(&hub, &["--mode", "raw", "--method", "integrate"])];
    let rows = json_lines(&run);
    for (i, row) in rows.iter().enumerate().filter(|(_, row)| row["contact"] == 1 && row["status"] == "ok") {
        for wanted in &wanted {
            assert!((number(&row["x"]) - number(&wanted[i]["x"])).abs() < 1e-9, "{row}");
        }
    }
}

/// A child process under test: the answer is read before the next line is written.
struct Stream {
    child: std::process::Child,
    stdin: Option<ChildStdin>,
    stdout: BufReader<ChildStdout>,
}

impl Stream {
    fn start(flags: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_resight"))
            .args(["whisker", "stream", "--whisker", &shipped("whisker.json")])
            .args(flags)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let (stdin, stdout) = (child.stdin.take(), BufReader::new(child.stdout.take().unwrap()));
        Stream { child, stdin, stdout }
    }

    fn say(&mut self, line: &str) {
        let stdin = self.stdin.as_mut().unwrap();
        writeln!(stdin, "{line}").unwrap();
        stdin.flush().unwrap();
    }

    fn ask(&mut self, line: &str) -> String {
        self.say(line);
        let mut answer = String::new();
        self.stdout.read_line(&mut answer).unwrap();
        answer.trim_end().to_string()
    }

    fn end(mut self) -> i32 {
        drop(self.stdin.take());
        self.child.wait().unwrap().code().unwrap()
    }
}

#[test]
fn a_stream_answers_each_line_before_the_next() {
    let wanted = folder("whisker-stream").join("c.csv").display().to_string();
    solved(&shipped("hub.csv"), &["--mode", "raw", "-o", &wanted]);
    let (hub, wanted) = (text(shipped("hub.csv")), text(&wanted));
    let mut stream = Stream::start(&["--mode", "raw"]);
    for (line, wanted) in hub.lines().zip(wanted.lines()).take(60) {
        assert_eq!(stream.ask(line), wanted);
    }
    assert_eq!(stream.end(), 0);
}

#[test]
fn a_bad_line_of_a_stream_is_answered_and_the_stream_goes_on() {
    let mut stream = Stream::start(&["--json"]);
    let object = |line: String| answer(&line);
    let good = r#"{"sweep":3,"sample":7,"hub_angle[deg]":90,"hub_x":0,"hub_y":0,"fx":-0.02,"fy":0.15,"mz[N mm]":15}"#;
    assert_eq!(object(stream.ask(good))["status"], "ok");
    for bad in ["no JSON", &good.replace("0.15", "\"x\"")] {
        let answer = object(stream.ask(bad));
        assert_eq!((&answer["status"], &answer["sample"]), (&Value::from("error"), &Value::Null));
        assert!(answer["note"].as_str().unwrap().starts_with("line "), "{answer}");
    }
    stream.say(""); // Says nothing, is answered by nothing.
    assert_eq!(object(stream.ask(&good.replace("0.15", "null")))["status"], "missing");
    assert_eq!(object(stream.ask(good))["sample"], 7);
    assert_eq!(stream.end(), 1);
}

/// Without a later reading, friction and tip are used all the same: modes as a whole record has them, nearer than each reading alone.
#[test]
fn a_constrained_stream_knows_modes_and_friction() {
    let folder = folder("whisker-online");
    let answers = |name: &str, flags: &[&str]| {
        let mut stream = Stream::start(flags);
        let lines: Vec<String> = text(shipped("hub.csv")).lines().map(|line| stream.ask(line)).collect();
        assert_eq!(stream.end(), 0);
        checked(&[&write(&folder, name, &lines.join("\n")), &shipped("truth.csv")])
    };
    let (auto, known) = (answers("auto.csv", &[]), answers("known.csv", &["--mu", "0.2"]));
    let raw = answers("raw.csv", &["--mode", "raw"]);
    let figure = |checked: &Value, group: &str, key: &str| number(&score(checked, group)[key]);
    for online in [&auto, &known] {
        assert!(0.98 <= figure(online, "firm", "mode_right"), "{online}");
        // At the tip the arc length is known: the error falls to a third and less.
        assert!(
            figure(online, "firm_tip", "rms_m") < 0.5 * figure(&raw, "firm_tip", "rms_m"),
            "{online} {raw}"
        );
        // 190 contacts: the mean of χ² with two degrees of freedom scatters by 0.15.
        assert!((1.4..2.6).contains(&figure(online, "firm", "nees")), "{online}");
    }
    assert!(figure(&raw, "firm", "mode_right") < 1.0, "{raw}");
}

/// The readings of the second sweep up to six before its slip-off, at sample 87.
fn cut_before_slip_off() -> String {
    let rows = text(shipped("hub.csv"));
    let is_kept = |line: &&str| {
        let cells: Vec<&str> = line.split(',').collect();
        cells[0] == "sweep" || cells[0] == "1" && cells[1].parse::<u32>().unwrap() <= 80
    };
    rows.lines().filter(is_kept).map(|line| format!("{line}\n")).collect()
}

#[test]
fn slip_off_is_foreseen() {
    let folder = folder("whisker-foresee");
    let hub = write(&folder, "hub.csv", &cut_before_slip_off());
    let rows = solved(&hub, &[]);
    let ahead = &rows.last().unwrap()["prediction"][0];
    assert_eq!(
        (&ahead["sweep"], &ahead["sample"], &ahead["ending"]),
        (&1.into(), &80.into(), &"slip_off".into())
    );
    // Sample 86 still touches, 87 no longer does; three standard deviations either side.
    let slack = 3.0 * number(&ahead["steps_sigma"]);
    assert!((6.0 - slack..7.0 + slack).contains(&number(&ahead["steps"])) && slack < 1.0, "{ahead}");
    assert!(0.0 < number(&ahead["margin_m"]), "{ahead}");
    let row = &rows[rows.len() - 2];
    assert_eq!(row["steps_to_slip_off"], ahead["steps"]);
    assert!(rows[..rows.len() - 2].iter().all(|row| row["steps_to_slip_off"].is_null()));
    let run = resight(&["whisker", "solve", "--whisker", &shipped("whisker.json"), &hub]);
    assert!(run.stdout.contains("slip-off    predicted in "), "{}", run.stdout);

    let every = solved(&hub, &["--predict"]);
    let reported = every.iter().filter(|row| row["steps_to_slip_off"].is_number()).count();
    assert!(40 < reported, "{reported}");

    let mut stream = Stream::start(&["--predict", "--json"]);
    let mut last = String::new();
    let cut = cut_before_slip_off();
    stream.say(cut.lines().next().unwrap());
    for line in cut.lines().skip(1) {
        last = stream.ask(line);
    }
    assert_eq!(stream.end(), 0);
    let steps = number(&answer(&last)["steps_to_slip_off"]);
    // The same contacts but for a friction angle of fewer readings.
    assert!((steps - number(&ahead["steps"])).abs() < 1.0, "{steps} {ahead}");

    let whole = solved(&shipped("hub.csv"), &[]);
    let sweeps: Vec<&Value> =
        whole.last().unwrap()["prediction"].as_array().unwrap().iter().map(|f| &f["sweep"]).collect();
    assert_eq!(sweeps, [&Value::from(2)], "sweeps 0 and 1 have slipped off");
}

#[test]
fn a_fixed_lag_stream_answers_at_once_and_settles_later() {
    let folder = folder("whisker-lag");
    let settled = folder.join("settled.csv").display().to_string();
    let mut now = String::new();
    let mut stream = Stream::start(&["--lag", "20", "--settled", &settled]);
    let hub = text(shipped("hub.csv"));
    for line in hub.lines() {
        now += &(stream.ask(line) + "\n");
    }
    assert_eq!(stream.end(), 0);
    assert_eq!(text(&settled).lines().count(), hub.lines().count());
    let now = checked(&[&write(&folder, "now.csv", &now), &shipped("truth.csv")]);
    let later = checked(&[&settled, &shipped("truth.csv")]);
    let rms = |checked: &Value| number(&score(checked, "firm")["rms_m"]);
    let raw = checked_raw();
    assert!(rms(&now) < rms(&raw) && rms(&later) < rms(&raw), "{now} {later}");
}

fn checked_raw() -> Value {
    checked(&[
        &shipped("hub.csv"),
        &shipped("truth.csv"),
        "--whisker",
        &shipped("whisker.json"),
        "--mode",
        "raw",
    ])
}

/// A rig with wrong zeros, gain, clamp angle and place, calibrated on the known object: contacts are where they were.
#[test]
fn a_wrong_rig_is_calibrated_away() {
    let folder = folder("whisker-calibrate");
    let mut wrong = String::from("sweep,sample,t,hub_angle,hub_x,hub_y,fx,fy,mz\n");
    for [sweep, sample, t, angle, x, y, fx, fy, mz] in readings() {
        let (angle, x) = (angle - 0.2_f64.to_radians(), x + 0.5e-3);
        writeln!(
            wrong,
            "{sweep},{sample},{t},{angle},{x},{y},{},{},{}",
            fx + 0.02,
            fy - 0.03,
            1.01 * mz + 1e-4
        )
        .unwrap();
    }
    let (hub, calibrated) =
        (write(&folder, "hub.csv", &wrong), folder.join("calibrated.json").display().to_string());
    let (whisker, truth) = (shipped("whisker.json"), shipped("truth.csv"));
    let run = resight(&[
        "whisker",
        "calibrate",
        "--whisker",
        &whisker,
        &hub,
        "--known",
        &shipped("square.json"),
        "-o",
        &calibrated,
    ]);
    assert_eq!(run.code, 0, "{}{}", run.stdout, run.stderr);
    let after = checked(&[&hub, &truth, "--whisker", &calibrated]);
    let before = checked(&[&hub, &truth, "--whisker", &whisker]);
    let good = checked(&[&shipped("hub.csv"), &truth, "--whisker", &whisker]);
    let median = |checked: &Value| number(&score(checked, "firm")["median_m"]);
    assert!(median(&after) < 1.15 * median(&good), "{after}");
    assert!(number(&score(&after, "firm")["nees"]) < 2.6, "{after}");
    // Uncalibrated, most contacts are called inconsistent, or they are plainly elsewhere.
    let is_reported = number(&score(&before, "firm")["n_true"]) < 2.0 * number(&before["n_firm_unanswered"]);
    assert!(is_reported || 2.0 * median(&good) < median(&before), "{before}");
}

/// Readings of another seed, each changed.
fn another_record(folder: &Path, name: &str, change: impl Fn(usize, &mut [f64])) -> String {
    let simulated = folder.join("simulated.csv").display().to_string();
    let (whisker, square, sweeps) = (shipped("whisker.json"), shipped("square.json"), shipped("path.json"));
    let simulate = ["whisker", "simulate", "--whisker", &whisker, "--object", &square, "--path", &sweeps];
    let run = resight(&[&simulate[..], &["--samples", "80", "--noise-seed", "8", "-o", &simulated]].concat());
    assert_eq!(run.code, 0, "{}", run.stderr);
    let mut out = String::new();
    for (i, line) in text(&simulated).lines().enumerate() {
        let mut cells: Vec<f64> = line.split(',').filter_map(|cell| cell.parse().ok()).collect();
        change(i, &mut cells);
        let cells: Vec<String> = cells.iter().map(f64::to_string).collect();
        writeln!(out, "{}", if i == 0 { line.to_string() } else { cells.join(",") }).unwrap();
    }
    write(folder, name, &out)
}

/// Between two calibrations and window by window: a sound rig is left in peace, what moved is named.
#[test]
fn what_moved_since_an_earlier_calibration_is_reported() {
    let folder = folder("whisker-drift");
    let (whisker, square) = (shipped("whisker.json"), shipped("square.json"));
    let old = folder.join("old.json").display().to_string();
    let calibrate = |hub: &str, flags: &[&str]| {
        let first = ["whisker", "calibrate", "--whisker", &whisker, hub, "--known", &square];
        resight(&[&first[..], flags].concat())
    };
    assert_eq!(calibrate(&shipped("hub.csv"), &["-o", &old]).code, 0);
    let against = ["--against", &old, "--watch", "100", "--json"];

    let steady = calibrate(&another_record(&folder, "steady.csv", |_, _| ()), &against);
    assert_eq!(steady.code, 0, "{}{}", steady.stdout, steady.stderr);
    let drift = &json_lines(&steady)[0]["drift"];
    assert_eq!(
        (&drift["has_drifted"], drift["watch"].as_array().unwrap().len()),
        (&false.into(), 3),
        "{drift}"
    );

    let gain = another_record(&folder, "gain.csv", |i, cells| {
        if 0 < i {
            cells[8] *= 1.01
        }
    });
    let moved = calibrate(&gain, &against);
    assert_eq!(moved.code, 3, "{}{}", moved.stdout, moved.stderr);
    let change = &json_lines(&moved)[0]["drift"]["changes"][0];
    assert_eq!(change["parameter"], "ln_torque_gain");
    let (by, sigma) = (number(&change["change"]), number(&change["sigma"]));
    assert!((by + 1.01_f64.ln()).abs() < 4.0 * sigma, "{change}"); // Torque over reading has fallen.
    let said = calibrate(&gain, &["--against", &old]);
    assert!(
        said.stdout.contains("MOVED since") && said.stdout.contains("torque gain less 1 alone, by -0.9"),
        "{}",
        said.stdout
    );

    // From the second window on, at a reading's line 101 below the header, the zero of fx is 4 standard deviations off.
    let zero = another_record(&folder, "zero.csv", |i, cells| {
        if 100 < i {
            cells[6] += 0.0125
        }
    });
    let watched = calibrate(&zero, &against);
    assert_eq!(watched.code, 3, "{}", watched.stderr);
    let windows = json_lines(&watched).remove(0)["drift"]["watch"].clone();
    let verdicts: Vec<&str> =
        windows.as_array().unwrap().iter().map(|w| w["verdict"].as_str().unwrap()).collect();
    assert_eq!(verdicts[..2], ["steady", "drifted"], "{windows}");
    assert_eq!(windows[1]["drift"]["changes"][0]["parameter"], "zero_fx_n", "{windows}");
}

#[test]
fn calibrations_that_cannot_be_compared_are_refused() {
    let folder = folder("whisker-drift-refused");
    let (whisker, hub) = (shipped("whisker.json"), shipped("hub.csv"));
    let old = folder.join("old.json").display().to_string();
    let run = resight(&["whisker", "calibrate", "--whisker", &whisker, &hub, "-o", &old]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    let thicker = write(&folder, "thicker.json", &text(&whisker).replace("0.0008", "0.0009"));
    for (whisker, flags, wanted) in [
        (&whisker, ["--against", &whisker, "--alpha", "1e-3"], "`calibration` is missing"),
        (&thicker, ["--against", &old, "--alpha", "1e-3"], "calibrates another whisker"),
        (&whisker, ["--against", &old, "--gravity-deg", "-90"], "its gravity differs"),
        (
            &whisker,
            ["--against", &old, "--watch", "5"],
            "5 samples in a window of the drift monitor given, 20 needed",
        ),
        (&whisker, ["--against", &old, "--alpha", "2"], "a chance between 0 and 1"),
    ] {
        let run = resight(&[&["whisker", "calibrate", "--whisker", whisker, &hub][..], &flags].concat());
        assert!(run.code == 2 && run.stderr.contains(wanted), "{}\nwanted {wanted}", run.stderr);
    }
}

/// The shipped readings as a six-axis cell has them whose whisker bends in a plane rotated by `roll` about the clamped whisker; mx besides.
fn rolled(roll: f64, mx: f64) -> String {
    let (sin, cos) = roll.sin_cos();
    let mut out = String::from("sweep,sample,t,hub_angle,hub_x,hub_y,fx,fy,fz,mx[N mm],my,mz\n");
    for [sweep, sample, t, angle, x, y, fx, fy, mz] in readings() {
        writeln!(
            out,
            "{sweep},{sample},{t},{angle},{x},{y},{fx},{},{},{},{},{}",
            cos * fy,
            sin * fy,
            1e3 * mx,
            -sin * mz,
            cos * mz
        )
        .unwrap();
    }
    out
}

/// The place in the hub frame of a row's contact.
fn in_hub(row: &Value, reading: &[f64; 9]) -> [f64; 3] {
    let (dx, dy) = (number(&row["x"]) - reading[4], number(&row["y"]) - reading[5]);
    let (sin, cos) = reading[3].sin_cos();
    [cos * dx + sin * dy, cos * dy - sin * dx, row["z"].as_f64().unwrap_or(0.0)]
}

/// A whisker that bends out of the plane touches where the planar one does, turned with its plane.
#[test]
fn six_axes_give_contacts_in_space() {
    let folder = folder("whisker-six-axis");
    let (roll, readings) = (0.6_f64, readings());
    let planar = solved(&shipped("hub.csv"), &["--mode", "raw"]);
    let hub = write(&folder, "six.csv", &rolled(roll, 0.0));
    let rows = solved(&hub, &["--mode", "raw"]);
    let is_firm = |row: &Value| row["status"] == "ok" && 0.1 < number(&row["f_normal"]);
    let mut firm = 0;
    for ((row, wanted), reading) in rows.iter().zip(&planar).zip(&readings).filter(|((_, w), _)| is_firm(w)) {
        assert_eq!(row["status"], "ok", "{row}");
        let ([x, y, z], [wanted_x, across, _]) = (in_hub(row, reading), in_hub(wanted, reading));
        for (seen, wanted) in [(x, wanted_x), (y, across * roll.cos()), (z, across * roll.sin())] {
            // The reduction's Gauss-Newton stops at a change of 1e-8 standard deviations.
            assert!((seen - wanted).abs() < 1e-8, "{row}\n{wanted}");
        }
        // What the plane turns by moves the contact out of it: in an upright plane z alone would have this variance.
        let trace =
            |row: &Value| ["cov_xx", "cov_yy", "cov_zz"].iter().filter_map(|k| row[*k].as_f64()).sum::<f64>();
        let by_roll = (across * number(&row["roll_sigma"])).powi(2);
        let ratio = (trace(row) - by_roll) / trace(wanted);
        assert!((0.8..1.2).contains(&ratio), "{ratio}"); // The planar one counts second order, too.
        // The moment in the plane is positive: bent to the other side, the plane is half a turn further on.
        let off = (number(&row["roll"]) - roll).rem_euclid(std::f64::consts::PI);
        assert!(off.min(std::f64::consts::PI - off) < 1e-6, "{row}");
        firm += 1;
    }
    assert!(150 < firm);

    let mut stream = Stream::start(&["--json"]);
    let six = rolled(roll, 0.0);
    let mut lines = six.lines();
    stream.say(lines.next().unwrap());
    for (line, wanted) in lines.zip(&rows).take(60) {
        assert_eq!(&answer(&stream.ask(line)), wanted);
    }
    assert_eq!(stream.end(), 0);
}

/// Torsion, a whisker curved of itself, what only the plane allows: refused with the reason, never a confident contact.
#[test]
fn six_axes_refuse_what_has_no_plane() {
    let folder = folder("whisker-six-refused");
    let whisker = shipped("whisker.json");
    let curved = write(
        &folder,
        "curved.json",
        &text(&whisker)
            .replace("\"intrinsic_curvature_1_per_m\": 0.0", "\"intrinsic_curvature_1_per_m\": 0.5"),
    );
    let sound = write(&folder, "six.csv", &rolled(0.6, 0.0));
    // 1e-4 N m are six standard deviations.
    let twisted = write(&folder, "twisted.csv", &rolled(0.6, 1e-4));
    for (meta, hub, word) in [(&whisker, &twisted, "not one force in one plane"), (&curved, &sound, "curved")]
    {
        let run = resight(&["whisker", "solve", "--whisker", meta, hub, "--json"]);
        assert_eq!(run.code, 1, "{}", run.stderr);
        let rows = json_lines(&run);
        let touching: Vec<&Value> = rows.iter().filter(|row| row["contact"] == 1).collect();
        assert!(150 < touching.len() && touching.iter().all(|row| row["status"] != "ok"));
        let reported = touching.iter().filter(|row| row["status"] == "inconsistent");
        assert!(
            reported.clone().all(|row| row["note"].as_str().unwrap().contains(word))
                && 150 < reported.count()
        );
    }
    let contacts = folder.join("c.csv").display().to_string();
    assert_eq!(resight(&["whisker", "solve", "--whisker", &whisker, &sound, "-o", &contacts]).code, 0);
    let header = "hub_angle,hub_x,hub_y,fx,fy,mz,fz\n0,0,0,0,0,0,0\n";
    let half = write(&folder, "half.csv", header);
    let solve = ["whisker", "solve", "--whisker", &whisker];
    for (arguments, wanted) in [
        ([&solve[..], &[&half]].concat(), "column `fz` without `mx`"),
        ([&solve[..], &[&sound, "--mode", "sweep"]].concat(), "leave those columns out"),
        ([&solve[..], &[&sound, "--tare", &sound]].concat(), "not fz, mx and my"),
        ([&solve[..], &[&sound, "--picture", &format!("{contacts}.svg")]].concat(), "shows the plane"),
        (vec!["whisker", "identify", &contacts], "contacts in space"),
    ] {
        let run = resight(&arguments);
        assert!(
            run.code == 2 && run.stderr.contains(wanted),
            "{}{}\nwanted {wanted}",
            run.stdout,
            run.stderr
        );
    }
}

#[test]
fn a_tare_takes_the_zeros_off() {
    let folder = folder("whisker-tare");
    let (mut all, mut free) = (String::from("sweep,sample,hub_angle,hub_x,hub_y,fx,fy,mz\n"), String::new());
    for (i, [sweep, sample, _, angle, x, y, fx, fy, mz]) in readings().into_iter().enumerate() {
        let row = format!("{sweep},{sample},{angle},{x},{y},{},{},{}\n", fx + 0.1, fy - 0.2, mz + 2e-3);
        all += &row;
        if i < 20 {
            free += &row;
        }
    }
    let header = all.lines().next().unwrap().to_string();
    let hub = write(&folder, "hub.csv", &all);
    let free = write(&folder, "free.csv", &format!("{header}\n{free}"));
    let rows = solved(&hub, &["--tare", &free]);
    let wanted = solved(&shipped("hub.csv"), &[]);
    let near = rows.iter().zip(&wanted).filter(|(row, wanted)| {
        let (Some(a), Some(b)) = (row["x"].as_f64(), wanted["x"].as_f64()) else {
            return row["status"] == wanted["status"];
        };
        let sigma = (number(&wanted["cov_xx"]) + number(&row["cov_xx"])).sqrt();
        (a - b).abs() < 2.0 * sigma
    });
    // The mean of 20 free readings is itself a fifth of a reading's noise off.
    assert!(rows.len() * 95 / 100 < near.count());
}

#[test]
fn pictures_are_what_their_endings_say() {
    let folder = folder("whisker-pictures");
    let (svg, png, contacts) = (folder.join("a.svg"), folder.join("b.png"), folder.join("c.csv"));
    let [svg_name, png_name, contacts] = [&svg, &png, &contacts].map(|path| path.display().to_string());
    let (hub, square) = (shipped("hub.csv"), shipped("square.json"));
    solved(&hub, &["--picture", &svg_name, "--object", &square, "-o", &contacts]);
    let drawn = text(&svg);
    for word in ["<svg", "mid-whisker (", "tip (", "outline", "x / mm", "</svg>"] {
        assert!(drawn.contains(word), "{word}");
    }
    let run = resight(&["whisker", "identify", &contacts, "--picture", &png_name]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    let bytes = std::fs::read(&png).unwrap();
    assert!(bytes.starts_with(b"\x89PNG") && 10_000 < bytes.len());
    let run = resight(&["whisker", "identify", &contacts, "--picture", "a.gif"]);
    assert!(run.code == 2 && run.stderr.contains(".svg or .png"), "{}", run.stderr);
}

#[test]
fn one_corner_is_no_object() {
    let folder = folder("whisker-corner");
    let contacts = folder.join("c.csv").display().to_string();
    solved(&shipped("hub.csv"), &["-o", &contacts]);
    // The first sweep's first contacts lean on one corner alone.
    let few: Vec<String> = text(&contacts).lines().take(60).map(str::to_string).collect();
    let run = resight(&["whisker", "identify", &write(&folder, "few.csv", &few.join("\n")), "--json"]);
    assert_eq!(run.code, 1, "{}", run.stdout);
    let answer = &json_lines(&run)[0];
    assert_eq!(answer["verdict"], "insufficient_coverage");
    assert!(
        answer["reason"]["kind"].is_string() && !answer["advice"].as_str().unwrap().is_empty(),
        "{answer}"
    );
}

/// The recorded sets through the program: bars of the contract.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn recorded_sets_keep_their_bars() {
    let root = recorded("whisker");
    for name in [
        "f1_square_00",
        "f2_square_30",
        "f3_circle_r25",
        "f4_circle_r25_mu03",
        "f5_taper_ellipse",
        "f6_slipoff_peg",
    ] {
        let file = |file: &str| root.join(name).join(file).display().to_string();
        let (meta, truth) = (file("meta.json"), file("truth.csv"));
        let clean = checked(&[&file("measured_clean.csv"), &truth, "--whisker", &meta, "--mode", "raw"]);
        assert!(number(&score(&clean, "firm")["max_m"]) < 0.25e-8, "{name} {clean}");
        let noisy = checked(&[&file("measured_noisy.csv"), &truth, "--whisker", &meta]);
        let firm = score(&noisy, "firm");
        assert!(0.98 <= number(&firm["mode_right"]), "{name} {firm}");
        assert_eq!(noisy["n_false"], 0, "{name}");
        let sweep = checked(&[&file("measured_noisy.csv"), &truth, "--whisker", &meta, "--mode", "sweep"]);
        assert!(number(&score(&sweep, "firm")["rms_m"]) < 0.3e-3, "{name} {sweep}");
    }
}
