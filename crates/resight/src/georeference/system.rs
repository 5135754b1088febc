//! Names of coordinate systems: WGS 84, UTM zones, and grids of which only the name is known.

use serde::{Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

/// A UTM zone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Zone {
    /// 1 to 60, from 180° west, 6° each.
    pub number: u8,
    /// Whether northings are counted from 10,000,000 m at the equator.
    pub is_south: bool,
}

/// The system of given coordinates.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum CoordinateSystem {
    /// Latitude and longitude in degrees, WGS 84.
    Geographic,
    /// Easting and northing of a UTM zone, WGS 84.
    Utm(Zone),
    /// Easting and northing of another grid; its name, where stated. Its latitudes and longitudes are unknown here.
    Grid(Option<String>),
}

impl fmt::Display for Zone {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.number, if self.is_south { 'S' } else { 'N' })
    }
}

impl FromStr for Zone {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let fault = || {
            format!(
                "`{text}` is no UTM zone; 1 to 60 and N (north of the equator) or S (south of it) are needed, e.g. 33N, not the letter of a latitude band"
            )
        };
        let (digits, letter) = text.split_at_checked(text.len().saturating_sub(1)).ok_or_else(fault)?;
        let number = digits.parse().ok().filter(|n| (1..=60).contains(n)).ok_or_else(fault)?;
        match letter {
            "N" | "n" => Ok(Zone { number, is_south: false }),
            "S" | "s" => Ok(Zone { number, is_south: true }),
            _ => Err(fault()),
        }
    }
}

impl CoordinateSystem {
    /// Returns the system of an EPSG code: WGS 84 and ETRS89 (which are within a metre of each other) as latitude and longitude or as UTM,
    /// else a grid of which only the name is known.
    pub fn of_epsg(code: u32) -> Self {
        let zone = |number: u32, is_south| match u8::try_from(number) {
            Ok(number @ 1..=60) => CoordinateSystem::Utm(Zone { number, is_south }),
            _ => CoordinateSystem::Grid(Some(format!("EPSG:{code}"))),
        };
        match code {
            4326 | 4979 | 4258 | 4937 => CoordinateSystem::Geographic,
            32601..=32660 => zone(code - 32600, false),
            32701..=32760 => zone(code - 32700, true),
            25828..=25838 => zone(code - 25800, false),
            _ => CoordinateSystem::Grid(Some(format!("EPSG:{code}"))),
        }
    }
}

impl FromStr for CoordinateSystem {
    type Err = String;

    /// Reads `EPSG:32633`, `EPSG:4326` or a UTM zone such as `33N`.
    fn from_str(text: &str) -> Result<Self, String> {
        let code = text.get(..5).filter(|head| head.eq_ignore_ascii_case("epsg:")).map(|_| &text[5..]);
        match code {
            Some(code) => match code.parse() {
                Ok(code) => Ok(CoordinateSystem::of_epsg(code)),
                Err(_) => Err(format!("`{text}` is no EPSG code; EPSG: and a number are needed, e.g. EPSG:32633")),
            },
            None => text.parse().map(CoordinateSystem::Utm).map_err(|_| {
                format!("`{text}` is no coordinate system; EPSG:4326, EPSG:32633 or a UTM zone such as 33N is needed")
            }),
        }
    }
}

impl fmt::Display for CoordinateSystem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            CoordinateSystem::Geographic => write!(f, "EPSG:4326"),
            CoordinateSystem::Utm(Zone { number, is_south }) => {
                write!(f, "EPSG:32{}{number:02}", if *is_south { 7 } else { 6 })
            }
            CoordinateSystem::Grid(Some(name)) => write!(f, "{name}"),
            CoordinateSystem::Grid(None) => write!(f, "grid"),
        }
    }
}

impl Serialize for CoordinateSystem {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl schemars::JsonSchema for CoordinateSystem {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "CoordinateSystem".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({
            "type": "string",
            "description": "`EPSG:…`, or `grid` where easting and northing are of a grid that is not stated."
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_and_written() {
        for (text, name) in [
            ("EPSG:4326", "EPSG:4326"),
            ("epsg:4258", "EPSG:4326"),
            ("EPSG:32633", "EPSG:32633"),
            ("EPSG:25833", "EPSG:32633"),
            ("EPSG:32756", "EPSG:32756"),
            ("33N", "EPSG:32633"),
            ("1s", "EPSG:32701"),
            ("EPSG:27700", "EPSG:27700"),
        ] {
            assert_eq!(text.parse::<CoordinateSystem>().map(|s| s.to_string()).as_deref(), Ok(name));
        }
        for text in ["", "N", "61N", "0N", "33U", "EPSG:", "EPSG:x", "WGS", "33Ñ", "Ñ"] {
            assert!(text.parse::<CoordinateSystem>().is_err(), "{text}");
        }
    }
}
