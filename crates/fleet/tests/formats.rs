//! One view, whatever file and layout it comes in, has one answer.

use crate::support::{day, folder, solved, solver};
use resight_fleet::answer::ColumnsObject;
use resight_fleet::source::{expand, explain_file};
use std::fmt::Write;

#[test]
fn csv_json_lines_and_rows_of_points_give_the_same_answers() {
    let folder = folder("formats");
    let fleet = day(6, 1.0, 60.0, 2);
    let solver = solver(&fleet);
    let mut flat = "camera,time_s,u0_px,v0_px,u1_px,v1_px,u2_px,v2_px,u3_px,v3_px\n".to_string();
    let mut points = "camera,time_s,x_m,y_m,z_m,u_px,v_px\n".to_string();
    let mut lines = String::new();
    for tick in 0..fleet.simulation.ticks() {
        for camera in &fleet.cameras {
            let Some((t_s, pixels)) = camera.row(&fleet.simulation, tick) else { continue };
            let numbers: Vec<f64> = pixels.iter().flat_map(|p| [p.x, p.y]).collect();
            let cells: Vec<String> = numbers.iter().map(|x| x.to_string()).collect();
            let _ = writeln!(flat, "{},{t_s},{}", camera.name, cells.join(","));
            let _ = writeln!(
                lines,
                r#"{{"camera":"{}","time_s":{t_s},"points_px":[{}]}}"#,
                camera.name,
                cells.join(",")
            );
            for (x, p) in camera.map_points.iter().zip(&pixels) {
                let _ = writeln!(points, "{},{t_s},{},{},{},{},{}", camera.name, x.x, x.y, x.z, p.x, p.y);
            }
        }
    }
    let run = |name: &str, text: &str| {
        let file = folder.join(name);
        std::fs::write(&file, text).expect("written");
        let (_, state, _) = solved(&[file], &solver, &folder.join(format!("{name}.out.csv")), 2);
        (std::fs::read_to_string(folder.join(format!("{name}.out.csv"))).expect("text"), state.into_cameras())
    };
    let first = run("flat.csv", &flat);
    assert!(300 < first.0.lines().count() && first.0.contains(",ok,"));
    assert!(run("lines.jsonl", &lines) == first && run("points.csv", &points) == first);
    for (name, mark) in [("semicolons.csv", ";"), ("tabs.csv", "\t"), ("bars.csv", "|")] {
        let of_country = |text: &str| format!("\u{feff}{}", text.replace(',', mark).replace('.', ","));
        assert!(run(name, &of_country(&flat)) == first, "{name}");
        assert!(run(&format!("points-{name}"), &of_country(&points)) == first, "points, {name}");
    }
}

#[test]
fn explain_names_what_is_missing() {
    let folder = folder("explain");
    let file = folder.join("views.csv");
    std::fs::write(&file, "cam,time_s,u0_px,v0_px,u1_px,v1_px,u2_px\nc,1,2,3,4,5,6\n").expect("written");
    let (columns, _) = explain_file(&file).expect("a table");
    let all = columns.missing.join("\n");
    assert!(all.contains("no column `camera`") && all.contains("no column `v2_px`"), "{all}");
    let long = folder.join("long.jsonl");
    let name = "x".repeat(70_000);
    let row = format!(r#"{{"camera":"a","time_s":1,"u0_px":1,"v0_px":1,"{name}":2}}"#);
    std::fs::write(&long, row).expect("written");
    let (columns, rows) = explain_file(&long).expect("a table");
    let words = ColumnsObject::of(&long, columns, rows).in_words();
    assert!(words.contains("xxx…xxx") && words.lines().all(|line| line.len() < 1000), "a name of any length");
    let refused = |name: &str, bytes: &[u8]| {
        std::fs::write(folder.join(name), bytes).expect("written");
        explain_file(folder.join(name)).expect_err("no table").to_string()
    };
    assert!(refused("views.xlsx", b"PK\x03\x04\0\0xl/workbook.xml").contains("save it as CSV"));
    assert!(refused("views16.csv", b"\xff\xfec\0,\0").contains("save it as UTF-8"));
    let nothing = expand(&[folder.join("none*").display().to_string()]);
    assert!(nothing.is_err_and(|reason| reason.to_string().contains("no file of views")));
}
