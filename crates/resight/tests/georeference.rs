//! Positions on the Earth against PROJ 9.5.1 (by pyproj 3.7.2), against the values that the crate `geodesy` publishes, and as poses, GeoJSON and
//! pixels of map images. What a wrong table is called.

use nalgebra::{Matrix3, Vector3};
use resight::answer::{PoseAnswer, Status};
use resight::core::camera::ImageSize;
use resight::core::{Camera, CameraMatrix, Lens, Pose, camera::Pinhole};
use resight::georeference::earth::Utm;
use resight::georeference::{
    CoordinateSystem, Geographic, Ground, LocalFrame, MapImage, Zone, read_map_image, read_map_points,
};
use resight::locate::PointsOptions;
use resight::points::{PointsTable, TableLocator, read_table};
use std::path::{Path, PathBuf};

fn at(lat_deg: f64, lon_deg: f64, height_m: f64) -> Geographic {
    Geographic { lat_deg, lon_deg, height_m }
}

fn file(name: &str, text: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("georeference-{name}"));
    std::fs::write(&path, text).expect("written");
    path
}

fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(name)
}

/// pyproj: EPSG:4979 to EPSG:4978.
const ECEF: [(f64, f64, f64, [f64; 3]); 6] = [
    (52.516275, 13.377704, 73.5, [3784037.693515, 899928.993990, 5038025.191947]),
    (-33.8567844, 151.2152967, 25.0, [-4646987.530721, 2553087.648758, -3533279.618525]),
    (10.0, -179.9999, -3.0, [-6281869.875171, -10.963931, 1100248.026791]),
    (55.0, 12.0, 100.0, [3586525.761018, 762339.584103, 5201465.438407]),
    (-33.4489, -70.6693, 570.0, [1763565.998073, -5027316.970165, -3495920.900163]),
    (0.0, 0.0, 0.0, [6378137.0, 0.0, 0.0]),
];

#[test]
fn earth_centred_coordinates_are_those_of_proj() {
    for (lat, lon, height, expected) in ECEF {
        let place = at(lat, lon, height);
        assert!((place.ecef() - Vector3::from(expected)).amax() < 1e-6, "{place:?}");
        let back = Geographic::of_ecef(&place.ecef());
        assert!((back.lat_deg - lat).abs() < 1e-12 && (back.lon_deg - lon).abs() < 1e-12, "{back:?}");
        assert!((back.height_m - height).abs() < 1e-7, "{back:?}");
    }
}

/// pyproj: `+proj=cart +step +proj=topocentric`.
#[test]
fn local_coordinates_are_those_of_proj() {
    let frame = LocalFrame::at(CoordinateSystem::Geographic, at(52.516275, 13.377704, 73.5));
    for (place, expected) in [
        (at(52.5170, 13.379, 80.0), [87.978813, 80.677734, 6.498884]),
        (at(52.51, 13.36, 40.0), [-1202.017472, -698.120702, -33.651247]),
        (at(53.0, 14.0, 0.0), [41778.406126, 54009.142084, -438.799122]),
    ] {
        let local = frame.local(&place).expect("on the Earth");
        assert!((local - Vector3::from(expected)).amax() < 2e-6, "{local}");
        let back = frame.geographic(&local).expect("on the Earth");
        assert!(
            (back.lat_deg - place.lat_deg).abs() < 1e-12 && (back.height_m - place.height_m).abs() < 1e-8
        );
    }
}

/// pyproj: easting, northing and meridian convergence in degrees of the zone; the last two are of geodesy's own tests (from PROJ's `cct`, on GRS 80,
/// which differs from WGS 84 by 0.1 mm in the axis).
#[test]
fn utm_is_that_of_proj() {
    for (lat, lon, zone, [easting, northing], convergence_deg, tolerance_m) in [
        (52.516275, 13.377704, "33N", [389918.041550, 5819699.132438], -1.2874627803, 1e-6),
        (-33.8567844, 151.2152967, "56S", [334900.234306, 6252290.477566], 0.9945168685, 1e-6),
        (10.0, -179.9999, "1N", [171082.237719, 1106908.754376], -0.5213984330, 1e-6),
        (55.0, 12.0, "33N", [308124.367862, 6098907.825129], -2.4581998743, 1e-6),
        (-33.4489, -70.6693, "19S", [344846.720310, 6297700.155610], 0.9202904032, 1e-6),
        (55.0, 12.0, "32N", [691875.632139661, 6098907.825005012], 2.4581998743, 2e-4),
        (-55.0, 12.0, "32S", [691875.632139661, 1e7 - 6098907.825005012], -2.4581998743, 2e-4),
    ] {
        let utm = Utm::new(zone.parse::<Zone>().expect("a zone")).expect("a zone");
        let place = at(lat, lon, 5.0);
        let found = utm.project(&place).expect("in the zone");
        assert!((found[0] - easting).hypot(found[1] - northing) < tolerance_m, "{found:?}");
        let back = utm.unproject(found, 5.0).expect("a place");
        assert!((back.lat_deg - lat).abs() < 1e-11 && (back.lon_deg - lon).abs() < 1e-11, "{back:?}");
        let convergence = utm.convergence_rad(&place).expect("in the zone").to_degrees();
        assert!((convergence - convergence_deg).abs() < 1e-4, "{convergence}");
    }
}

const MATRIX: CameraMatrix = CameraMatrix { fx_px: 1600.0, fy_px: 1600.0, cx_px: 959.5, cy_px: 539.5 };

fn camera() -> Camera {
    let size = Some(ImageSize { width_px: 1920, height_px: 1080 });
    Camera { lens: Lens::Pinhole(Pinhole { matrix: MATRIX }), size }
}

/// A pose in a frame of east, north and up.
fn pose(at_m: [f64; 3], heading_deg: f64, tilt_deg: f64, roll_deg: f64) -> Pose {
    let (heading, tilt) = (heading_deg.to_radians(), tilt_deg.to_radians());
    let axis = Vector3::new(heading.sin() * tilt.cos(), heading.cos() * tilt.cos(), -tilt.sin());
    let right = Vector3::new(heading.cos(), -heading.sin(), 0.0);
    let down = axis.cross(&right);
    let (sin, cos) = roll_deg.to_radians().sin_cos();
    let (right, down) = (right * cos + down * sin, down * cos - right * sin);
    let rotation = Matrix3::from_rows(&[right.transpose(), down.transpose(), axis.transpose()]);
    Pose::new(rotation, -(rotation * Vector3::from(at_m)))
}

/// Points on the ground and on roofs, in the frame of the origin: an aerial image of known points.
const SITE_M: [[f64; 3]; 8] = [
    [0.0, 0.0, 0.0],
    [60.0, 5.0, 0.4],
    [-55.0, 12.0, 1.0],
    [40.0, -30.0, 12.0],
    [-35.0, -28.0, 0.2],
    [10.0, 33.0, 8.5],
    [-20.0, 25.0, 3.1],
    [25.0, 18.0, 0.0],
];

fn solved(path: &Path, stated: Option<&CoordinateSystem>) -> (PointsTable, TableLocator, PoseAnswer) {
    let table = read_table(path, false, stated).expect("a table");
    let locator =
        TableLocator::new(Some(camera()), Some(0.5), PointsOptions::default()).for_table(path, &table);
    let answer = locator.locate(&table.views[0]);
    (table, locator, answer)
}

/// The site around an origin as rows of latitude, longitude and height.
fn site(frame: &LocalFrame, cam_from_local: &Pose) -> String {
    let row = |x: &[f64; 3]| {
        let (x, place) = (Vector3::from(*x), frame.geographic(&Vector3::from(*x)).expect("a place"));
        let pixel = camera().project(&(*cam_from_local * x)).expect("in front");
        format!(
            "{:.11},{:.11},{:.6},{:.6},{:.6}\n",
            place.lat_deg, place.lon_deg, place.height_m, pixel.x, pixel.y
        )
    };
    "lat_deg,lon_deg,height_m,u_px,v_px\n".to_string() + &SITE_M.iter().map(row).collect::<String>()
}

/// An aerial camera and one on a mast, on both hemispheres and at the antimeridian: latitude, longitude, height, heading, tilt and roll are the truth.
#[test]
fn a_camera_over_known_points_has_its_place_and_heading() {
    for origin in
        [at(52.516275, 13.377704, 73.5), at(-33.8567844, 151.2152967, 25.0), at(65.0, 179.9998, 5.0)]
    {
        let frame = LocalFrame::at(CoordinateSystem::Geographic, origin);
        for (at_m, [heading, tilt, roll]) in
            [([5.0, -8.0, 110.0], [200.0, 80.0, 3.0]), ([-70.0, -60.0, 30.0], [47.0, 20.0, -2.0])]
        {
            let truth = pose(at_m, heading, tilt, roll);
            let path = file(&format!("site-{}-{heading}.csv", origin.lat_deg), &site(&frame, &truth));
            let (_, _, answer) = solved(&path, None);
            assert_eq!(answer.status(), Status::Ok, "{}", answer.verdict.message);
            let found = answer.georeference.expect("on the Earth");
            let place = frame.geographic(&Vector3::from(at_m)).expect("a place");
            let off_m = at(found.lat_deg.expect("known"), found.lon_deg.expect("known"), found.height_m)
                .ecef()
                - place.ecef();
            assert!(off_m.norm() < 1e-4, "{}", off_m.norm());
            let angles = [found.heading_rad, Some(found.tilt_rad), found.roll_rad]
                .map(|x| x.expect("known").to_degrees());
            for (a, b) in angles.into_iter().zip([heading, tilt, roll]) {
                // North at the camera is not quite north at the origin: by 70 m / R · tan(lat).
                assert!((a - b).abs() < 2e-3, "{angles:?}");
            }
            assert_eq!((found.north, found.easting_m), ("true", None));
        }
    }
}

/// The heading is against north at the camera, not at the origin of the points: at 65° of latitude they differ by 0.0193° for each kilometre east.
#[test]
fn north_is_that_at_the_camera() {
    let origin = at(65.0, 20.0, 0.0);
    let frame = LocalFrame::at(CoordinateSystem::Geographic, origin);
    let x = Vector3::new(10_000.0, 0.0, 50.0);
    let rotation = frame.enu_from_local(&x);
    // East of the origin meridians lean to the west: the origin's north is east of the north there.
    let turned = rotation * Vector3::y();
    let expected = (10_000.0 / 6_394_209.0) * 65_f64.to_radians().tan(); // The radius of curvature across the meridian.
    assert!((turned.x.atan2(turned.y) - expected).abs() < 2e-6, "{} {expected}", turned.x.atan2(turned.y));
}

/// One site at eastings of 500,000 m and northings of 5,000,000 m: in a UTM zone its place is that of latitudes and longitudes, and in a grid of
/// which nothing is known the camera is where it is, to a micrometre.
#[test]
fn projected_coordinates_lose_no_digits() {
    let truth = pose([-40.0, -55.0, 30.0], 47.0, 20.0, -2.0);
    let grid = |x: &[f64; 3]| {
        let pixel = camera().project(&(truth * Vector3::from(*x))).expect("in front");
        let (e, n) = (500_000.0 + x[0], 5_000_000.0 + x[1]);
        format!("{e:.4},{n:.4},{:.4},{:.9},{:.9}\n", 250.0 + x[2], pixel.x, pixel.y)
    };
    let text = "easting_m,northing_m,height_m,u_px,v_px\n".to_string()
        + &SITE_M.iter().map(grid).collect::<String>();
    let path = file("grid.csv", &text);
    let (_, _, answer) = solved(&path, None);
    let found = answer.georeference.expect("in a grid");
    let camera_m = [found.easting_m.expect("known"), found.northing_m.expect("known"), found.height_m];
    for (a, b) in camera_m.into_iter().zip([499_960.0, 4_999_945.0, 280.0]) {
        assert!((a - b).abs() < 1e-6, "{camera_m:?}");
    }
    assert_eq!((found.north, found.lat_deg, answer.verdict.status), ("grid", None, Status::Ok));
    // With the zone, metres of the grid are 0.04 % too short, which the solver would see as an inconsistency of two pixels were they not undone.
    let zone: CoordinateSystem = "33N".parse().expect("a zone");
    let utm = Utm::new("33N".parse().expect("a zone")).expect("a zone");
    let origin = utm.unproject([500_000.0, 5_000_000.0], 250.0).expect("a place");
    let frame = LocalFrame::at(zone.clone(), origin);
    let row = |x: &[f64; 3]| {
        let [e, n, h] = frame.grid_m(&Vector3::from(*x)).expect("in the zone");
        let pixel = camera().project(&(truth * Vector3::from(*x))).expect("in front");
        format!("{e:.6},{n:.6},{h:.6},{:.9},{:.9}\n", pixel.x, pixel.y)
    };
    let text =
        "easting_m,northing_m,height_m,u_px,v_px\n".to_string() + &SITE_M.iter().map(row).collect::<String>();
    let path = file("utm.csv", &text);
    let (_, _, answer) = solved(&path, Some(&zone));
    let estimate = answer.estimate.as_ref().expect("a pose");
    assert!(estimate.rms_px < 1e-5, "{}", estimate.rms_px);
    let found = answer.georeference.as_ref().expect("on the Earth");
    let place = frame.geographic(&Vector3::new(-40.0, -55.0, 30.0)).expect("a place");
    let off_m = at(found.lat_deg.expect("known"), found.lon_deg.expect("known"), found.height_m).ecef()
        - place.ecef();
    assert!(off_m.norm() < 1e-5, "{}", off_m.norm());
    assert!(found.grid_convergence_rad.is_some_and(|x| x.abs() < 1e-4), "the central meridian");
}

/// Standard deviations of place and angles are those of repeated measurements.
#[test]
fn standard_deviations_are_those_of_repeated_measurements() {
    let frame = LocalFrame::at(CoordinateSystem::Geographic, at(52.5, 13.4, 30.0));
    let at_m = [-70.0, -60.0, 30.0];
    let truth = pose(at_m, 47.0, 20.0, -2.0);
    let text = site(&frame, &truth);
    let path = file("noise.csv", &text);
    let table = read_table(&path, false, None).expect("a table");
    let locator =
        TableLocator::new(Some(camera()), Some(0.5), PointsOptions::default()).for_table(&path, &table);
    let mut seed = 7_u64;
    let mut normal = || {
        let mut uniform = || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            ((seed >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
        };
        (-2.0 * uniform().ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos()
    };
    const N: usize = 400;
    let mut squares = [0.0; 6];
    for _ in 0..N {
        let mut view = table.views[0].clone();
        view.rows.iter_mut().flat_map(|row| &mut row.image).for_each(|x| *x += 0.5 * normal());
        let answer = locator.locate(&view);
        let found = answer.georeference.expect("on the Earth");
        let place = at(found.lat_deg.expect("known"), found.lon_deg.expect("known"), found.height_m);
        // The frame of the table begins at its first point, which is the origin of the site.
        let x = frame.local(&place).expect("a place") - Vector3::from(at_m);
        let off = [
            x.x / found.east_sigma_m,
            x.y / found.north_sigma_m,
            x.z / found.height_sigma_m,
            (found.heading_rad.expect("known") - 47_f64.to_radians())
                / found.heading_sigma_rad.expect("known"),
            (found.tilt_rad - 20_f64.to_radians()) / found.tilt_sigma_rad,
            (found.roll_rad.expect("known") + 2_f64.to_radians()) / found.roll_sigma_rad.expect("known"),
        ];
        squares.iter_mut().zip(off).for_each(|(sum, z)| *sum += z * z);
    }
    // χ² of 400: its mean over 400 is within 1 ± 0.2 (almost three standard deviations).
    for (i, sum) in squares.iter().enumerate() {
        assert!((sum / N as f64 - 1.0).abs() < 0.2, "{i}: {}", sum / N as f64);
    }
}

/// Cameras, points and the footprint come back from GeoJSON where they were.
#[test]
fn geojson_holds_what_was_solved() {
    let frame = LocalFrame::at(CoordinateSystem::Geographic, at(52.516275, 13.377704, 73.5));
    let truth = pose([5.0, -8.0, 110.0], 200.0, 80.0, 3.0);
    let path = file("round-trip.csv", &site(&frame, &truth));
    let (table, locator, answer) = solved(&path, None);
    let ground = Ground { height_m: Some(73.5), limit_m: None };
    let features = locator.features(&table, std::slice::from_ref(&answer), &ground).expect("features");
    assert_eq!(features.remarks, Vec::<String>::new());
    let json: serde_json::Value = serde_json::from_str(&features.geojson()).expect("JSON");
    let list = json["features"].as_array().expect("features");
    let place = |position: &serde_json::Value| {
        let number = |i: usize| position[i].as_f64().expect("a number");
        frame.local(&at(number(1), number(0), number(2))).expect("a place")
    };
    let of_kind = |kind: &str| list.iter().filter(|f| f["properties"]["kind"] == kind).collect::<Vec<_>>();
    let camera_m = place(&of_kind("camera")[0]["geometry"]["coordinates"]);
    assert!((camera_m - Vector3::new(5.0, -8.0, 110.0)).norm() < 1e-3, "{camera_m}");
    let heading = of_kind("camera")[0]["properties"]["heading_deg"].as_f64().expect("a number");
    assert!((heading - 200.0).abs() < 1e-3, "{heading}");
    let points = of_kind("point");
    assert_eq!(points.len(), SITE_M.len());
    for (point, expected) in points.iter().zip(SITE_M) {
        assert!((place(&point["geometry"]["coordinates"]) - Vector3::from(expected)).norm() < 1e-3);
    }
    // Corners of the footprint project onto the border of the image.
    let ring = of_kind("footprint")[0]["geometry"]["coordinates"][0].as_array().expect("a ring");
    assert_eq!(ring.first(), ring.last());
    let size = Vector3::new(1920.0, 1080.0, 0.0).xy();
    for position in ring {
        let pixel = camera().project(&(truth * place(position))).expect("in front");
        let inside = (pixel + nalgebra::Vector2::repeat(0.5)).zip_map(&size, |x, w| x.min(w - x)).min();
        assert!(inside.abs() < 0.05, "{pixel}");
    }
    let kml = features.kml();
    let read = roxmltree::Document::parse(&kml).expect("XML");
    let text = |name: &str| {
        let found = read.descendants().find(|n| n.has_tag_name(("http://www.opengis.net/kml/2.2", name)));
        found.and_then(|n| n.text()).expect("an element").parse::<f64>().expect("a number")
    };
    assert!(
        (text("heading") - 200.0).abs() < 1e-3
            && (text("tilt") - 10.0).abs() < 1e-3
            && (text("roll") + 3.0).abs() < 0.01
    );
}

/// Photographs of a square in Berlin with ground control points (OpenSfM, `data/berlin/gcp_list.txt`). The expected places and angles are from SciPy's
/// `least_squares` on coordinates by pyproj.
#[test]
fn photographs_of_berlin_are_where_an_independent_solution_has_them() {
    let camera = resight::read_camera(shipped("examples/berlin/camera.toml")).expect("a camera");
    let expected = [
        (52.518922101, 13.400325202, 2.6620, [35.94516, 18.88680, 1.06309]),
        (52.518976923, 13.400381803, 2.4303, [33.93962, 13.45591, 0.64884]),
        (52.519054310, 13.400476761, 2.6710, [35.83736, 25.74132, 2.44139]),
    ];
    for name in ["points.csv", "points_utm.csv"] {
        let path = shipped("examples/berlin").join(name);
        let table = read_table(&path, false, None).expect("a table");
        let locator = TableLocator::new(Some(camera.clone()), Some(5.0), PointsOptions::default())
            .for_table(&path, &table);
        for (view, (lat, lon, height, angles)) in table.views.iter().zip(expected) {
            let answer = locator.locate(view);
            assert_eq!(answer.status(), Status::Ok, "{}: {}", view.name, answer.verdict.message);
            let found = answer.georeference.expect("on the Earth");
            let place = at(found.lat_deg.expect("known"), found.lon_deg.expect("known"), found.height_m);
            let off_m = (place.ecef() - at(lat, lon, height).ecef()).norm();
            assert!(off_m < 0.002, "{}: {off_m}", view.name);
            // The independent solution looks down by negative angles.
            let found = [found.heading_rad, Some(found.tilt_rad.abs()), found.roll_rad]
                .map(|x| x.expect("known").to_degrees());
            for (a, b) in found.into_iter().zip(angles) {
                assert!((a - b).abs() < 2e-3, "{}: {found:?}", view.name);
            }
        }
    }
}

#[test]
fn a_wrong_table_is_named() {
    let refused = |header: &str, rows: &[&str], stated: Option<&str>| {
        let text = format!(
            "{header},u_px,v_px\n{}\n",
            rows.iter().map(|row| format!("{row},1,2")).collect::<Vec<_>>().join("\n")
        );
        let path = file("wrong.csv", &text);
        let stated = stated.map(|text| text.parse::<CoordinateSystem>().expect("a system"));
        read_table(&path, false, stated.as_ref()).expect_err(&text).to_string()
    };
    for (header, rows, stated, wanted) in [
        ("lat_deg,lon_deg,height_m", &["151.2,-33.9,20"][..], None, "exchanged"),
        ("lat_deg,lon_deg,height_m", &["5819699,389918,20"], None, "easting_m and northing_m"),
        ("lat_deg,lon_deg,height_m", &["52.5,413.4,20"], None, "lon_deg is 413.4"),
        ("lat_rad,lon_rad,height_m", &["0.9,0.2,20"], None, "multiply by 180/π"),
        ("lat_deg,lon_deg", &["52.5,13.4"], None, "height_m"),
        ("lat_deg,lon_deg,height_m", &["52.5,13.4,"], None, "`height_m` is empty"),
        ("lat_deg,lon_deg,height_m", &["52.5,NaN,3"], None, "`lon_deg` is NaN"),
        ("lat_deg,lon_deg,height_ft", &["52.5,13.4,120"], None, "0.3048"),
        ("latitude,longitude,height_m", &["52.5,13.4,120"], None, "rename it where it is in degrees"),
        ("lat_deg,lon_deg,height_m", &["52.5,13.4,20"], Some("33N"), "easting_m,northing_m"),
        ("x_m,y_m,z_m,lat_deg", &["1,2,3,52"], None, "given twice"),
        ("easting_ft,northing_ft,height_ft", &["1,2,3"], None, "US survey feet"),
        (
            "easting_m,northing_m,height_m,zone",
            &["389918,5819699,20,33N", "500100,5819699,20,32N"],
            None,
            "line 2 is of zone 33N",
        ),
        ("easting_m,northing_m,height_m,zone", &["389918,5819699,20,33U"], None, "latitude band"),
        (
            "easting_m,northing_m,height_m,zone",
            &["389918,5819699,20,33N"],
            Some("32N"),
            "EPSG:32632 was stated",
        ),
        ("easting_m,northing_m,height_m", &["5819699,389918,20"], Some("33N"), "exchanged"),
        ("easting_m,northing_m,height_m", &["1279258,19093500,20"], Some("33N"), "feet"),
        ("easting_m,northing_m,height_m", &["13.4,52.5,20"], Some("33N"), "degrees"),
        ("easting_m,northing_m,height_m", &["389918,5819699,20"], Some("EPSG:4326"), "lat_deg,lon_deg"),
    ] {
        let said = refused(header, rows, stated);
        assert!(said.contains(wanted), "{header} {rows:?}\n{said}\nwanted {wanted}");
    }
    // What may be right is solved, and named as implausible.
    let radians =
        file("radians.csv", "lat_deg,lon_deg,height_m,u_px,v_px\n0.916,0.2334,1,1,2\n0.917,0.2335,1,1,2\n");
    let table = read_table(&radians, false, None).expect("a table");
    assert!(table.implausible[0].contains("in radians?"), "{:?}", table.implausible);
    let far = file("far.csv", "lat_deg,lon_deg,height_m,u_px,v_px\n52.5,13.4,1,1,2\n48.1,11.6,1,1,2\n");
    let table = read_table(&far, false, None).expect("a table");
    assert!(table.implausible[0].contains("km apart"), "{:?}", table.implausible);
}

/// Centres of pixels are where rasterio 1.4 (GDAL) has them; `ortho.tif` and `point.tif` differ in the tag by which a raster is of areas or points.
#[test]
fn map_images_are_read_as_gdal_reads_them() {
    let read = |name: &str| read_map_image(shipped("testdata/georeference").join(name), None);
    for (name, system, [x, y]) in [
        ("ortho.tif", "EPSG:32633", [389901.025, 5819719.475]),
        ("point.tif", "EPSG:32633", [389901.025, 5819719.475]),
        ("degrees.tif", "EPSG:4326", [13.3770205, 52.5169895]),
        ("rotated.tif", "EPSG:32633", [389901.135, 5819720.195]),
    ] {
        let map = read(name).expect(name);
        let found = map.xy(20.0, 10.0);
        assert!((found[0] - x).hypot(found[1] - y) < 1e-7, "{name} {found:?}");
        assert_eq!((map.system.to_string().as_str(), map.size_px), (system, [64, 48]), "{name}");
    }
    let feet = read("feet.tif").expect_err("feet").to_string();
    assert!(feet.contains("US survey feet"), "{feet}");
}

/// A world file beside a PNG; its numbers are of the centre of the first pixel.
#[test]
fn world_files_are_read() {
    let image = Path::new(env!("CARGO_TARGET_TMPDIR")).join("georeference-map.png");
    std::fs::copy(shipped("testdata/demo/left.png"), &image).expect("copied");
    let world = image.with_extension("pgw");
    let write = |text: &str| std::fs::write(&world, text).expect("written");
    let read =
        |stated: Option<&str>| read_map_image(&image, stated.map(|s| s.parse().expect("a system")).as_ref());
    write("0.05\n0.0\n0.0\n-0.05\n389900.0\n5819720.0\n");
    let map: MapImage = read(Some("33N")).expect("a map");
    assert_eq!(map.xy(2.0, 4.0), [389900.1, 5819719.8]);
    assert!((map.pixel_m() - 0.05).abs() < 1e-12);
    write("1e-6\n0\n0\n-1e-6\n13.377\n52.517\n");
    assert!(read(None).expect_err("degrees").to_string().contains("--crs EPSG:4326"));
    assert!(read(Some("EPSG:4326")).is_ok());
    for (text, wanted) in [
        ("1\n2\n3\n", "six numbers"),
        ("1\n0\n0\nx\n0\n0\n", ":4:"),
        ("0\n0\n0\n0\n5\n5\n", "area of the ground"),
    ] {
        write(text);
        let said = read(Some("EPSG:27700")).expect_err(text).to_string();
        assert!(said.contains(wanted), "{said}");
    }
    std::fs::remove_file(&world).expect("removed");
    let said = read(None).expect_err("no map").to_string();
    assert!(said.contains("georeference-map.pgw"), "{said}");
}

/// Pairs of pixels in a map and a photograph become a table that `solve` reads.
#[test]
fn pairs_become_points() {
    let map = read_map_image(shipped("testdata/georeference/ortho.tif"), None).expect("a map");
    let pairs = file(
        "pairs.csv",
        "id,map_u_px,map_v_px,u_px,v_px\na,20,10,100,200\n\"b,c\",0,0,5,6\nout,64.2,10,1,2\n",
    );
    let found = read_map_points(&pairs, &map, Some(34.5), 1.5).expect("points");
    assert_eq!(
        found.answers.iter().map(|a| a.status).collect::<Vec<_>>(),
        [Status::Ok, Status::Ok, Status::Error]
    );
    assert_eq!(
        found.csv,
        "id,u_px,v_px,easting_m,northing_m,zone,height_m,sigma_m\na,100,200,389901.0250,5819719.4750,33N,34.5,0.0750\n\"b,c\",5,6,389900.0250,5819719.9750,33N,34.5,0.0750\n"
    );
    // PROJ: 389901.025 5819719.475 in zone 33 is 52.5164546°, 13.3774464°.
    let table = read_table(file("from-map.csv", &found.csv), false, None).expect("a table");
    let origin = table.frame.expect("on the Earth").origin().expect("a place");
    assert!((origin.lat_deg - found.answers[0].lat_deg.expect("known")).abs() < 1e-11);
    assert_eq!(origin.height_m, 34.5);
    let without = read_map_points(&pairs, &map, None, 1.0).expect("points");
    assert!(without.remarks[0].contains("--height-m"), "{:?}", without.remarks);
    let twice = file("twice.csv", "map_u_px,map_v_px,easting_m\n1,2,3\n");
    assert!(read_map_points(&twice, &map, None, 1.0).is_err());
}

/// Torn and damaged files are refused or read, never a panic or more memory than a map needs.
#[test]
fn damaged_map_images_are_refused() {
    for name in ["ortho.tif", "degrees.tif"] {
        let whole = std::fs::read(shipped("testdata/georeference").join(name)).expect("a file");
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("georeference-damaged.tif");
        let mut n_refused = 0;
        for i in 0..whole.len() {
            for damaged in [whole[..i].to_vec(), [&whole[..i], &[0xff], &whole[i + 1..]].concat()] {
                std::fs::write(&path, damaged).expect("written");
                n_refused += usize::from(read_map_image(&path, None).is_err());
                // Some file systems wait for the disk where a file is written over.
                std::fs::remove_file(&path).expect("removed");
            }
        }
        assert!(100 < n_refused, "{n_refused}");
    }
}
