//! What one command writes, the others read that say so: each file of `-o` and `--save-…` goes through every command that takes its kind.
//!
//! What commands there are, what they write and what they say that they read is asked of the program itself: a new output that no chain below reads
//! fails the test.

use crate::book_support::root;
use crate::support::{Run, folder, resight};
use std::collections::{BTreeMap, BTreeSet};

/// Outputs that no command reads: what people and other programs look at.
const READ_BY_NONE: [(&str, &str, &str); 17] = [
    ("advise", "output", "maps as PNG"),
    ("batch", "drift", "what became of each camera, for other programs"),
    ("demo", "output", "images, results and a page"),
    ("detect", "output", "points of one image, for other programs"),
    ("fleet-report", "output", "a page"),
    ("georeference", "output", "the answers; --points writes the table"),
    ("hand-eye", "output", "the answer, for other programs"),
    ("history", "export", "rows for other programs"),
    ("intrinsics", "report", "a page"),
    ("man", "output", "manual pages"),
    ("measure", "output", "table, plan and map"),
    ("rig", "report", "a page"),
    ("rig", "scene", "a recording for viewers"),
    ("solve", "geojson", "a map"),
    ("solve", "kml", "a map"),
    ("watch", "tf", "messages of ROS"),
    ("zones", "output", "the answers; --write writes the zones"),
];

/// Which command says that it reads what which other one writes, in its help or on its page.
const SAID: [(&str, &str); 31] = [
    ("advise", "locate"),
    ("advise", "rig"),
    ("advise", "rig-pose"),
    ("advise", "solve"),
    ("compare", "locate"),
    ("compare", "pose-graph"),
    ("compare", "rig"),
    ("compare", "solve"),
    ("convert", "map"),
    ("convert", "rig"),
    ("detect", "print"),
    ("explain", "capture"),
    ("explain", "intrinsics"),
    ("explain", "map"),
    ("fleet-report", "batch"),
    ("fleet-report", "fleet-report"),
    ("hand-eye", "locate"),
    ("hand-eye", "solve"),
    ("history", "watch"),
    ("intrinsics", "capture"),
    ("locate", "intrinsics"),
    ("locate", "map"),
    ("map", "map"),
    ("measure", "rig"),
    ("rig", "map"),
    ("rig-pose", "rig"),
    ("solve", "georeference"),
    ("watch", "map"),
    ("zones", "compare"),
    ("zones", "landmarks"),
    ("zones", "watch"),
];

/// A chain of commands, each of which reads what those before it wrote.
type Commands = fn(&mut Chain);

/// The chains; each is commands of which the later ones read what the earlier ones wrote.
const CHAINS: [(&str, Commands); 11] = [
    ("rig", of_a_rig),
    ("pose_graph", of_pairs),
    ("camera", of_intrinsics),
    ("poses", of_poses),
    ("map", of_a_map),
    ("map_image", of_a_map_image),
    ("fleet", of_a_fleet),
    ("watch", of_a_session),
    ("landmarks", of_landmarks),
    ("whisker", of_a_whisker),
    ("rig_pose", of_a_rig_as_a_whole),
];

/// The commands of a chain, as words; `@/` is the folder of its files.
struct Chain {
    folder: String,
    runs: Vec<Vec<String>>,
    /// Files of what a command printed, with its name.
    printed: Vec<(String, String)>,
}

impl Chain {
    fn new(name: &str) -> Self {
        let folder = folder(&format!("written_{name}")).display().to_string();
        Chain { folder, runs: Vec::new(), printed: Vec::new() }
    }

    /// Runs a command, given as one types it in the root of the repository, that must answer; 1 is an answer that is not to be relied on.
    fn run(&mut self, command: &str, codes: &[i32]) -> Run {
        let place = |word: &str| {
            let word = word.replace("@/", &format!("{}/", self.folder));
            let (before, path) =
                word.split_once('=').map_or(("", &word[..]), |(before, path)| (before, path));
            let is_ours = ["examples/", "testdata/"].iter().any(|folder| path.starts_with(folder));
            let path = if is_ours { root().join(path).display().to_string() } else { path.to_string() };
            if before.is_empty() { path } else { format!("{before}={path}") }
        };
        let (command, printed) =
            command.split_once(" > ").map_or((command, None), |(c, file)| (c, Some(file)));
        let words: Vec<String> = command.split_whitespace().map(place).collect();
        let run = resight(&words.iter().map(String::as_str).collect::<Vec<_>>());
        assert!(codes.contains(&run.code), "{command}: {} {}{}", run.code, run.stdout, run.stderr);
        if let Some(file) = printed {
            self.write(file, &run.stdout);
            self.printed.push((self.path(file), command_of(&words)));
        }
        self.runs.push(words);
        run
    }

    fn path(&self, file: &str) -> String {
        file.replace("@/", &format!("{}/", self.folder))
    }

    fn write(&self, file: &str, text: &str) {
        std::fs::write(self.path(file), text).unwrap();
    }

    fn text(&self, file: &str) -> String {
        std::fs::read_to_string(self.path(file)).unwrap()
    }
}

/// The name of a command that is given as words.
fn command_of(words: &[String]) -> String {
    match words[0].as_str() {
        "whisker" => words[..2].join(" "),
        one => one.to_string(),
    }
}

fn of_a_rig(chain: &mut Chain) {
    let cameras = "--camera examples/rig/cameras.toml --detections examples/rig/detections.csv";
    chain.run(&format!("rig {cameras} -o @/rig.toml --json > @/rig.json"), &[0, 1]);
    chain.run("compare @/rig.toml @/rig.toml", &[0]);
    chain.run("compare @/rig.json @/rig.toml", &[0]);
    chain.run("explain @/rig.toml", &[0]);
    chain.run("rig --camera @/rig.toml --detections examples/rig/detections.csv", &[0, 1]);
    chain.run("advise --camera @/rig.toml --target examples/rig/board.toml --distance-m 1..3 --next 1", &[0]);
    chain.run("convert @/rig.toml --to caliscope -o @/array.toml", &[0]);
    chain.run("compare @/array.toml @/array.toml --sigma-mm 0.5 --sigma-deg 0.02", &[0]);
    chain.run("explain @/array.toml", &[0]);
}

/// A rig in the commands that take one as a whole, and the poses of `rig-pose` in those that plan.
fn of_a_rig_as_a_whole(chain: &mut Chain) {
    let photographs = "--camera left=examples/photo/left.yml --camera right=examples/photo/right.yml \
        --target examples/photo/board.toml --images left=examples/photo/left0[1-4].jpg --images right=examples/photo/right0[1-4].jpg";
    chain.run(&format!("rig {photographs} -o @/rig.toml"), &[0]);
    chain.run("rig-pose examples/photo/corners.csv --rig @/rig.toml -o @/poses.jsonl", &[0, 1]);
    let clicks = "photo,point,u_px,v_px\nleft,first,277.110,72.131\nright,first,133.111,89.445\n";
    chain.write("@/points.csv", clicks);
    chain.run("measure --views @/rig.toml --image-points @/points.csv --sigma-px 0.5", &[0]);
    let board = "--target examples/photo/board.toml --distance-m 0.3..1 --next 1";
    chain.run(&format!("advise --camera @/rig.toml {board} --views @/poses.jsonl"), &[0]);
}

/// Poses without lenses are a rig for `compare`, as `pose-graph` writes them.
fn of_pairs(chain: &mut Chain) {
    let rows = |x_m: &str| {
        format!(
            "a,b,qw,qx,qy,qz,x_m,y_m,z_m,sigma_deg,sigma_mm\nc1,c0,1,0,0,0,{x_m},0,0,0.1,2\nc2,c0,1,0,0,0,-2,0.001,0,0.1,2\n\
            c2,c1,1,0,0,0,-1,0.001,0,0.1,2\n"
        )
    };
    for (x_m, file) in [("-1", "a"), ("-1.003", "b")] {
        chain.write("@/pairs.csv", &rows(x_m));
        chain.run(&format!("pose-graph @/pairs.csv -o @/{file}.toml"), &[0]);
        chain.run(&format!("compare @/{file}.toml @/{file}.toml"), &[0]);
        chain.run(&format!("explain @/{file}.toml"), &[0]);
    }
    chain.write("@/pairs.csv", &rows("-1").replace("-2,", "-2.5,").replace("-1,0.001", "-1.5,0.001"));
    chain.run("pose-graph @/pairs.csv -o @/b.toml", &[0]);
    chain.run("compare @/a.toml @/b.toml -o @/motion.jsonl", &[3]);
}

fn of_intrinsics(chain: &mut Chain) {
    let images = "examples/photo/left0*.jpg --target examples/photo/board.toml";
    chain.run(&format!("intrinsics {images} -o @/camera.toml"), &[0]);
    chain.run(&format!("intrinsics {images} --check @/camera.toml"), &[0, 1]);
    chain.run(&format!("capture {images} -o @/captured.toml --keep @/kept"), &[0, 1]);
    chain.run("intrinsics @/kept/*.png --target examples/photo/board.toml", &[0, 1]);
    chain.run(&format!("intrinsics {images} --check @/captured.toml"), &[0, 1]);
    chain.run("explain @/captured.toml", &[0]);
    chain.run("explain @/camera.toml", &[0]);
    chain.run(&format!("locate {images} --camera @/camera.toml -o @/poses.jsonl"), &[0]);
    chain.run("compare @/poses.jsonl @/poses.jsonl", &[0]);
    chain.write("@/motions.csv", &motions(&chain.text("@/poses.jsonl")));
    chain.run("hand-eye --motions @/motions.csv --inverse --poses @/poses.jsonl", &[0, 1]);
    let one = "examples/photo/left01.jpg --target examples/photo/board.toml";
    chain.run(&format!("locate {one} --camera @/camera.toml -o @/pose.jsonl"), &[0]);
    chain.write("@/places.csv", "x_m,y_m,z_m\n0,0,0\n0.2,0,0\n0.2,0.1,0\n0,0.1,0\n");
    let region = "--region-m 0,0,0.2,0.1";
    let advise = format!("advise --camera @/camera.toml --points @/places.csv {region}");
    chain.run(&format!("{advise} --pose @/pose.jsonl"), &[0, 1]);
    let board = "--kind chessboard --rows 6 --columns 9 --square-m 0.025";
    chain.run(&format!("print {board} -o @/sheet.pdf"), &[0]);
    chain.run("explain @/sheet.toml", &[0]);
    chain.run("detect examples/photo/left01.jpg --target @/sheet.toml", &[0]);
}

/// A robot that carries the camera in its gripper, whose base is the board.
fn motions(poses: &str) -> String {
    let row = |line: &str| {
        let pose: serde_json::Value = serde_json::from_str(line).unwrap();
        let numbers = |key: &str| pose["cam_from_target"][key].as_array().unwrap().clone();
        let cells = [numbers("rotation_wxyz"), numbers("translation_m")].concat();
        let cells: Vec<String> = cells.iter().map(ToString::to_string).collect();
        format!("{},{}\n", pose["view"].as_str().unwrap(), cells.join(","))
    };
    "view,qw,qx,qy,qz,x_m,y_m,z_m\n".to_string() + &poses.lines().map(row).collect::<String>()
}

fn of_poses(chain: &mut Chain) {
    chain.run(
        "solve examples/robot/corners.csv --camera examples/robot/camera.toml -o @/poses.jsonl",
        &[0, 1],
    );
    chain.run("compare @/poses.jsonl @/poses.jsonl", &[0]);
    chain
        .run("hand-eye --motions examples/robot/motions.csv --poses @/poses.jsonl -o @/hand_eye.jsonl", &[0]);
    let marks = "solve examples/marks/marks.csv --camera examples/marks/camera.toml";
    chain.run(&format!("{marks} -o @/pose.jsonl"), &[0]);
    chain.run(&format!("{marks} --sigma-px 0.4 -o @/again.jsonl"), &[0]);
    chain.write("@/places.csv", "x_m,y_m,z_m\n-2,8,0\n2.5,9,0\n-1,14,0\n2,16,0\n");
    let advise = "advise --camera examples/marks/camera.toml --points @/places.csv --region-m -5,8,5,20";
    chain.run(&format!("{advise} --pose @/pose.jsonl"), &[0]);
    chain.run("compare @/pose.jsonl @/again.jsonl -o @/motion.jsonl", &[0]);
    chain.write("@/zones.toml", ZONES);
    let zones = "zones @/zones.toml --camera examples/marks/camera.toml --shift-sigma-mm 1 --nearest-m 5";
    chain.run(&format!("{zones} --motion @/motion.jsonl"), &[0, 1]);
}

const ZONES: &str = "[[zone]]\nname = \"drive\"\ncoordinates = \"0.1,0.55,0.45,0.5,0.55,0.95,0.05,0.95\"\n";

fn of_a_map(chain: &mut Chain) {
    let camera = "--camera examples/walk/camera.toml --size-m 0.165";
    let walk = format!("map --detections examples/walk/corners.csv {camera}");
    chain.run(&format!("{walk} -o @/map.toml --field-layout @/field.json"), &[0]);
    chain.run("convert @/map.toml --to wpilib --field-size-m 6x4 -o @/layout.json", &[0]);
    for map in ["map.toml", "field.json", "layout.json"] {
        chain.run(&format!("explain @/{map}"), &[0]);
        chain.run(&format!("map --detections examples/walk/later.csv {camera} --known @/{map}"), &[0, 1]);
    }
    // The images show other tags of the family: that the map is read is what counts.
    let left = "testdata/demo/left.png --camera testdata/demo/left.toml";
    chain.run(&format!("locate {left} --target @/map.toml"), &[0, 1]);
    let cameras = "--camera left=testdata/demo/left.toml --camera right=testdata/demo/right.toml";
    let images = "--images left=testdata/demo/left.png --images right=testdata/demo/right.png";
    chain.run(&format!("rig {cameras} --target @/map.toml {images}"), &[0, 1]);
    let gate = "--camera gate=examples/gate/gate.toml --source gate=testdata/demo/left.png";
    chain.run(&format!("watch {gate} --target @/map.toml --once --period-s 1"), &[0, 1]);
}

fn of_a_map_image(chain: &mut Chain) {
    let map = "testdata/georeference/ortho.tif";
    chain.write("@/pairs.csv", "id,u_px,v_px,map_u_px,map_v_px\na,100,800,20,10\nb,600,700,60,12\nc,1000,900,90,50\nd,300,500,30,70\n");
    chain.run(&format!("georeference {map} @/pairs.csv --height-m 34 --points @/points.csv"), &[0, 1]);
    chain.run("solve @/points.csv --camera examples/berlin/camera.toml", &[0, 1]);
}

/// The second half of the views against the state after the first.
fn of_a_fleet(chain: &mut Chain) {
    let views = std::fs::read_to_string(root().join("examples/fleet/views.csv")).unwrap();
    let (header, rows) = views.split_once('\n').unwrap();
    let time = |row: &str| row.split(',').nth(1).unwrap().parse::<f64>().unwrap();
    let mut times: Vec<f64> = rows.lines().map(time).collect();
    times.sort_by(f64::total_cmp);
    let middle = times[times.len() / 2];
    let cameras = "--cameras examples/fleet/cameras.csv";
    for (day, is_first) in [("first", true), ("second", false)] {
        let of_day = rows.lines().filter(|row| (time(row) < middle) == is_first);
        let text: Vec<&str> = std::iter::once(header).chain(of_day).collect();
        chain.write(&format!("@/{day}.csv"), &(text.join("\n") + "\n"));
        chain.run(&format!("batch @/{day}.csv {cameras} -o @/{day}.parquet"), &[0, 1]);
    }
    let report = format!("fleet-report @/first.parquet {cameras} --state @/first.state -o @/day.html");
    chain.run(&report, &[0, 1, 3]);
    chain.run(&format!("fleet-report @/second.parquet {cameras} --since @/first.state"), &[0, 1, 3]);
}

fn of_a_session(chain: &mut Chain) {
    let gate = "watch --camera gate=examples/gate/gate.toml --target examples/gate/tag.toml --once";
    let day = format!("{gate} --source examples/gate/day.jsonl --json");
    let kept = "--save-reference gate=@/gate.toml --history @/gate.sqlite --state @/gate.state";
    chain.run(&format!("{day} {kept} > @/events.jsonl"), &[3]);
    let night = format!("{gate} --source examples/gate/night.jsonl");
    chain.run(&format!("{night} --reference gate=@/gate.toml"), &[3]);
    chain.run(&format!("{night} --state @/gate.state"), &[0, 3]);
    chain.run("history @/gate.sqlite --export @/gate.csv", &[0]);
    chain.run(&format!("{night} --print-session > @/session.toml"), &[0]);
    chain.run("watch @/session.toml", &[0, 1, 3]);
    let zones = "--camera examples/gate/gate.toml --motion @/events.jsonl --shift-sigma-mm 1 --nearest-m 5";
    chain.run(&format!("zones examples/zones/zones.toml {zones} --write @/moved.toml"), &[0]);
    chain.run(&format!("zones @/moved.toml {zones}"), &[0]);
}

fn of_landmarks(chain: &mut Chain) {
    let watch = "watch --hfov-deg gate=70 --source gate=examples/photo/left0*.jpg --period-s 1 --once";
    chain.run(&format!("{watch} --save-landmarks gate=@/gate.png"), &[0, 1, 3]);
    chain.run(&format!("{watch} --landmarks gate=@/gate.png"), &[0, 1, 3]);
    let images = "examples/photo/left01.jpg examples/photo/left01.jpg --camera examples/photo/left.yml";
    chain.run(&format!("landmarks {images} -o @/motion.jsonl"), &[0]);
    chain.write("@/zones.toml", ZONES);
    chain.run("zones @/zones.toml --camera examples/photo/left.yml --motion @/motion.jsonl", &[0, 1]);
}

fn of_a_whisker(chain: &mut Chain) {
    let whisker = "--whisker testdata/whisker/whisker.json";
    let object = "--object testdata/whisker/square.json --path testdata/whisker/path.json";
    let noise = "--samples 80 --noise-seed 7";
    chain.run(&format!("whisker simulate {whisker} {object} {noise} -o @/hub.csv --truth @/truth.csv"), &[0]);
    chain.run(&format!("whisker solve {whisker} @/hub.csv -o @/contacts.csv"), &[0]);
    chain.run("whisker check @/contacts.csv @/truth.csv", &[0]);
    chain.run("whisker identify @/contacts.csv -o @/object.json", &[0]);
    let drawn = "--object @/object.json --picture @/sweeps.svg";
    chain.run(&format!("whisker solve {whisker} @/hub.csv {drawn}"), &[0]);
    chain.run(
        &format!("whisker calibrate {whisker} @/hub.csv --known @/object.json -o @/calibrated.json"),
        &[0, 1],
    );
    chain.run("whisker solve --whisker @/calibrated.json @/hub.csv", &[0]);
    chain.run(&format!("whisker calibrate {whisker} @/hub.csv --against @/calibrated.json"), &[0, 1, 3]);
}

/// The flags of each command with their help, as the shell completes them: (command, flag, its letter, help).
fn flags() -> Vec<(String, String, Option<String>, String)> {
    let mut found = Vec::new();
    for line in resight(&["completions", "fish"]).stdout.lines() {
        let Some((condition, rest)) = line.split_once(" -n \"").and_then(|(_, rest)| rest.split_once('"'))
        else {
            continue;
        };
        let after = |key: &str| {
            condition
                .split_once(key)
                .map_or("", |(_, rest)| rest.trim_matches([' ', ';']).split([' ', ';']).next().unwrap())
        };
        let of =
            |key: &str| rest.split_once(key).map(|(_, rest)| rest.split(' ').next().unwrap().to_string());
        let Some(flag) = of(" -l ") else { continue };
        let second = if condition.contains(" not ") { "" } else { after("__fish_seen_subcommand_from") };
        let command = format!("{} {second}", after("__fish_resight_using_subcommand"));
        let help = rest.split_once(" -d '").map_or("", |(_, help)| help).to_string();
        found.push((command.trim().to_string(), flag, of(" -s "), help));
    }
    found
}

/// Runs every chain; then no output of any command is left that neither a command reads nor the list of those that none reads names.
#[test]
fn what_is_written_is_read() {
    let flags = flags();
    let is_output = |(command, flag, letter, help): &&(String, String, Option<String>, String)| {
        let is_kept = flag.starts_with("save-") || (command == "watch" && flag == "history");
        is_kept || letter.as_deref() == Some("o") || help.starts_with("Writes ")
    };
    let mut outputs: BTreeMap<(String, String), Option<String>> = BTreeMap::new();
    for (command, flag, letter, _) in flags.iter().filter(is_output) {
        outputs.insert((command.clone(), flag.clone()), letter.clone());
    }
    let chains: Vec<Chain> = std::thread::scope(|scope| {
        let run = |(name, chain): &(&'static str, fn(&mut Chain))| {
            let (name, chain) = (*name, *chain);
            scope.spawn(move || {
                let mut runs = Chain::new(name);
                chain(&mut runs);
                runs
            })
        };
        let threads: Vec<_> = CHAINS.iter().map(run).collect();
        threads.into_iter().map(|thread| thread.join().expect("the chain")).collect()
    });
    let read: BTreeSet<Reading> = chains.iter().flat_map(|chain| read(chain, &outputs)).collect();
    let outputs_read: BTreeSet<&(String, String)> = read.iter().map(|reading| &reading.output).collect();
    let by_none: BTreeSet<(String, String)> =
        READ_BY_NONE.map(|(command, flag, _)| (command.to_string(), flag.to_string())).into();
    let all: BTreeSet<(String, String)> = outputs.keys().cloned().collect();
    let is_left = |output: &&(String, String)| !outputs_read.contains(output) && !by_none.contains(*output);
    let left: Vec<_> = all.iter().filter(is_left).collect();
    assert!(left.is_empty(), "no chain reads what these write: {left:?}");
    let is_stale = |output: &&(String, String)| outputs_read.contains(output) || !all.contains(*output);
    let stale: Vec<_> = by_none.iter().filter(is_stale).collect();
    assert!(stale.is_empty(), "these are read, or write nothing: {stale:?}");
    for (reader, writer) in SAID {
        let is_it = |reading: &&Reading| reading.reader == reader && reading.output.0 == writer;
        assert!(read.iter().any(|reading| is_it(&reading)), "`{reader}` never reads what `{writer}` writes");
    }
}

/// A command that read what another one wrote: its name, and the other's with the flag.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Reading {
    reader: String,
    output: (String, String),
}

/// What commands of a chain read of what earlier ones wrote.
fn read(chain: &Chain, outputs: &BTreeMap<(String, String), Option<String>>) -> BTreeSet<Reading> {
    let printed =
        chain.printed.iter().map(|(path, command)| ((command.clone(), String::new()), path.clone()));
    let mut written: Vec<((String, String), String)> = printed.collect();
    let mut found = BTreeSet::new();
    for words in &chain.runs {
        let (command, mut own) = (command_of(words), Vec::new());
        for (i, word) in words.iter().enumerate().skip(1) {
            let path = word.split_once('=').map_or(&word[..], |(_, path)| path);
            let is_its_flag = |((of, flag), letter): &(&(String, String), &Option<String>)| {
                let is_short = letter.as_ref().is_some_and(|letter| words[i - 1] == format!("-{letter}"));
                *of == command && (is_short || words[i - 1] == format!("--{flag}"))
            };
            if let Some((output, _)) = outputs.iter().find(is_its_flag) {
                own.push((output.clone(), path.to_string()));
                continue;
            }
            // The target file that `print` writes beside FILE.pdf has its name; images of a folder are given by a pattern.
            let is_it = |(_, file): &&((String, String), String)| {
                let target = file.strip_suffix(".pdf").map(|stem| format!("{stem}.toml"));
                file == path || target.as_deref() == Some(path) || path.starts_with(&format!("{file}/"))
            };
            let output = written.iter().filter(is_it).map(|(output, _)| output.clone());
            found.extend(output.map(|output| Reading { reader: command.clone(), output }));
        }
        written.extend(own);
    }
    found
}
