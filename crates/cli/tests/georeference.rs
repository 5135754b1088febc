//! Points on the Earth by the commands: `solve` with its map, `georeference`, and `measure`.

use crate::book_support::root;
use crate::support::{folder, json_lines, resight};

fn path(name: &str) -> String {
    root().join(name).display().to_string()
}

/// The place is in words and in JSON (which follows the schema), and the files of the map hold it.
#[test]
fn solve_states_the_place_and_writes_the_map() {
    let folder = folder("georeference");
    let (json, kml) =
        (folder.join("a.geojson").display().to_string(), folder.join("a.kml").display().to_string());
    let (points, camera) = (path("examples/berlin/points.csv"), path("examples/berlin/camera.toml"));
    let solve = ["solve", &points, "--camera", &camera, "--sigma-px", "5"];
    let words =
        resight(&[&solve[..], &["--geojson", &json, "--kml", &kml, "--ground-height-m", "1"]].concat());
    assert_eq!(words.code, 0, "{}{}", words.stdout, words.stderr);
    assert!(words.stdout.contains("latitude 52.51892"), "{}", words.stdout);
    assert!(words.stdout.contains("heading 35.9"), "{}", words.stdout);
    let answers = json_lines(&resight(&[&solve[..], &["--json"]].concat()));
    let place = &answers[0]["georeference"];
    assert!((place["lat_deg"].as_f64().unwrap() - 52.518922101).abs() < 1e-7, "{place}");
    assert_eq!(
        (place["north"].as_str(), place["coordinate_system"].as_str()),
        (Some("true"), Some("EPSG:4326"))
    );
    let written: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&json).unwrap()).unwrap();
    let kinds: Vec<&str> = written["features"]
        .as_array()
        .unwrap()
        .iter()
        .filter_map(|f| f["properties"]["kind"].as_str())
        .collect();
    assert_eq!(kinds.iter().filter(|kind| **kind == "camera").count(), 3);
    // The third photograph looks up, above the ground.
    assert_eq!(kinds.iter().filter(|kind| **kind == "footprint").count(), 2);
    assert!(words.stderr.contains("03.jpg: no footprint: the image shows no ground"), "{}", words.stderr);
    // Ten points, seen by up to three cameras each.
    assert_eq!(kinds.iter().filter(|kind| **kind == "point").count(), 10, "{kinds:?}");
    assert!(std::fs::read_to_string(&kml).unwrap().contains("<Camera>"));
}

/// A table without places on the Earth has no map, and says what is needed before it solves anything.
#[test]
fn a_map_needs_places() {
    let folder = folder("georeference-none");
    let json = folder.join("a.geojson").display().to_string();
    let (points, camera) = (path("examples/marks/marks.csv"), path("examples/berlin/camera.toml"));
    let run = resight(&["solve", &points, "--camera", &camera, "--geojson", &json]);
    assert_eq!(run.code, 2, "{}", run.stderr);
    assert!(run.stderr.contains("lat_deg,lon_deg,height_m"), "{}", run.stderr);
    assert!(!std::path::Path::new(&json).exists());
}

/// A pixel outside the map is an error among the answers, and is not in the table.
#[test]
fn pixels_of_a_map_become_points() {
    let folder = folder("georeference-map");
    let pairs = folder.join("pairs.csv");
    std::fs::write(&pairs, "id,map_u_px,map_v_px\na,20,10\nb,500,10\n").unwrap();
    let (map, pairs) = (path("testdata/georeference/ortho.tif"), pairs.display().to_string());
    let points = folder.join("points.csv").display().to_string();
    let run = resight(&["georeference", &map, &pairs, "--height-m", "34", "--points", &points, "--json"]);
    assert_eq!(run.code, 1, "{}", run.stderr);
    let answers = json_lines(&run);
    assert_eq!(answers[0]["easting_m"].as_f64(), Some(389901.025));
    assert_eq!((answers[1]["status"].as_str(), answers[1]["lat_deg"].as_f64()), (Some("error"), None));
    assert_eq!(
        std::fs::read_to_string(&points).unwrap(),
        "id,easting_m,northing_m,zone,height_m,sigma_m\na,389901.0250,5819719.4750,33N,34,0.0500\n"
    );
}

/// Control points in latitude and longitude: the network and its map are on the Earth, and answers are those of the same points in metres.
#[test]
fn measure_takes_control_points_on_the_earth() {
    let folder = folder("georeference-measure");
    let rows = std::fs::read_to_string(path("examples/berlin/points.csv")).unwrap();
    let mut known = std::collections::BTreeMap::new();
    let mut clicks = String::from("photo,point,u_px,v_px,sigma_px\n");
    for row in rows.lines().skip(1) {
        let cells: Vec<&str> = row.split(',').collect();
        known
            .insert(cells[1].to_string(), [cells[2].to_string(), cells[3].to_string(), cells[4].to_string()]);
        clicks += &format!("{},{},{},{},5\n", cells[0], cells[1], cells[5], cells[6]);
    }
    std::fs::write(folder.join("clicks.csv"), clicks).unwrap();
    let mut scene = String::from("image_points = \"clicks.csv\"\n");
    for photo in ["01.jpg", "02.jpg", "03.jpg"] {
        scene +=
            &format!("[[photo]]\nname = \"{photo}\"\ncamera = \"{}\"\n", path("examples/berlin/camera.toml"));
    }
    // E is measured, not known.
    for (name, [lat, lon, height]) in known.iter().filter(|(name, _)| *name != "E") {
        scene += &format!(
            "[[control_point]]\nname = \"{name}\"\nlat_deg = {lat}\nlon_deg = {lon}\nheight_m = {height}\nsigma_m = 0.05\n"
        );
    }
    scene += "[[query]]\nkind = \"position\"\npoints = [\"E\"]\n";
    let file = folder.join("scene.toml");
    std::fs::write(&file, &scene).unwrap();
    let out = folder.join("out").display().to_string();
    let run = resight(&["measure", &file.display().to_string(), "--json", "-o", &out]);
    assert_eq!(run.code, 0, "{}{}", run.stdout, run.stderr);
    let answers = json_lines(&run);
    let network = answers.last().unwrap();
    let measured = network["points"].as_array().unwrap().iter().find(|p| p["name"] == "E").unwrap();
    let [lat, lon, height] = known["E"].clone().map(|text| text.parse::<f64>().unwrap());
    let place = &measured["georeference"];
    let off_m = [
        (place["lat_deg"].as_f64().unwrap() - lat) * 111_000.0,
        (place["lon_deg"].as_f64().unwrap() - lon) * 111_000.0 * 0.608,
        place["height_m"].as_f64().unwrap() - height,
    ];
    for (off, i) in off_m.into_iter().zip(0..) {
        let sigma = measured["covariance_m2"][i][i].as_f64().unwrap().sqrt();
        assert!(off.abs() < 4.0 * sigma + 0.02, "{off_m:?} {sigma}");
    }
    assert!(network["photos"][0]["georeference"]["heading_rad"].is_f64(), "{network}");
    let written: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(folder.join("out/map.geojson")).unwrap()).unwrap();
    assert_eq!(written["features"].as_array().unwrap().len(), 3 + known.len());
    let mixed =
        scene.replace("[[query]]", "[[control_point]]\nname = \"own\"\nx_m = 1.0\ny_m = 2.0\n[[query]]");
    std::fs::write(&file, mixed).unwrap();
    let run = resight(&["measure", &file.display().to_string()]);
    assert!(run.code == 2 && run.stderr.contains("give all in one system"), "{}", run.stderr);
}
