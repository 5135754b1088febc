//! Every camera's verdict as CSV, which the page contains for use in a spreadsheet.

use super::site_of;
use crate::assess::{Assessment, CameraVerdict, Motion};
use crate::cameras::Cameras;
use crate::words::utc;
use std::fmt::Write;

const HEADER: [&str; 14] = [
    "camera",
    "site",
    "found",
    "status",
    "kind",
    "since_utc",
    "since_s",
    "since_sigma_s",
    "rotation_deg",
    "rotation_sigma_deg",
    "shift_m",
    "shift_sigma_m",
    "chi2",
    "message",
];

/// Returns a row for each motion, or one for a camera without any.
pub(super) fn csv(fleet: &Assessment, cameras: Option<&Cameras>) -> Vec<u8> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let mut write = |row: Vec<String>| {
        // A vector accepts every byte.
        let _ = writer.write_record(row);
    };
    write(HEADER.map(String::from).to_vec());
    for verdict in &fleet.cameras {
        let site = site_of(cameras, verdict);
        match verdict.events.is_empty() {
            true => write(row(verdict, &site, None)),
            false => verdict.events.iter().for_each(|event| write(row(verdict, &site, Some(event)))),
        }
    }
    writer.into_inner().unwrap_or_default()
}

/// Returns a text as an address that contains all of it.
pub(super) fn address(csv: &[u8]) -> String {
    let mut address = String::from("data:text/csv;charset=utf-8,");
    for byte in csv {
        match byte {
            b'A'..=b'Z'
            | b'a'..=b'z'
            | b'0'..=b'9'
            | b','
            | b'.'
            | b'-'
            | b'_'
            | b':'
            | b';'
            | b'('
            | b')' => {
                address.push(char::from(*byte));
            }
            _ => {
                let _ = write!(address, "%{byte:02X}");
            }
        }
    }
    address
}

fn row(verdict: &CameraVerdict, site: &str, event: Option<&Motion>) -> Vec<String> {
    let number = |of: fn(&Motion) -> f64| event.map_or(String::new(), |event| of(event).to_string());
    vec![
        verdict.camera.clone(),
        site.to_string(),
        verdict.found.name().to_string(),
        verdict.found.status().name().to_string(),
        event.map_or(String::new(), |event| event.kind.to_string()),
        event.map_or(String::new(), |event| utc(event.since_s)),
        number(|event| event.since_s),
        number(|event| event.since_sigma_s),
        number(|event| event.angle_deg[0]),
        number(|event| event.angle_deg[1]),
        number(|event| event.shift_m[0]),
        number(|event| event.shift_m[1]),
        number(|event| event.chi2),
        verdict.message.clone(),
    ]
}
