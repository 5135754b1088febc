//! Units as people write them.

/// What a column measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Metres inside.
    Length,
    /// Radians inside.
    Angle,
    /// Newtons inside.
    Force,
    /// Newton metres inside.
    Moment,
    /// Seconds inside.
    Time,
    /// A bare number.
    Count,
}

impl Quantity {
    /// The word of `--units`.
    pub fn name(self) -> &'static str {
        match self {
            Quantity::Length => "length",
            Quantity::Angle => "angle",
            Quantity::Force => "force",
            Quantity::Moment => "moment",
            Quantity::Time => "time",
            Quantity::Count => "count",
        }
    }

    /// Spellings (letters only, lower case, µ as u) and how many SI units one is.
    fn table(self) -> &'static [(&'static str, f64)] {
        match self {
            Quantity::Length => {
                &[("m", 1.0), ("mm", 1e-3), ("cm", 1e-2), ("um", 1e-6), ("in", 0.0254), ("inch", 0.0254)]
            }
            Quantity::Angle => &[
                ("rad", 1.0),
                ("deg", DEGREE),
                ("°", DEGREE),
                ("degree", DEGREE),
                ("degrees", DEGREE),
                ("mrad", 1e-3),
            ],
            Quantity::Force => &[("n", 1.0), ("mn", 1e-3), ("un", 1e-6), ("gf", GRAM_FORCE), ("lbf", POUND)],
            Quantity::Moment => &[
                ("nm", 1.0),
                ("nmm", 1e-3),
                ("mnm", 1e-3),
                ("ncm", 1e-2),
                ("unm", 1e-6),
                ("mnmm", 1e-6),
                ("gfcm", GRAM_FORCE * 1e-2),
                ("gfmm", GRAM_FORCE * 1e-3),
                ("lbfin", POUND * 0.0254),
            ],
            Quantity::Time => &[("s", 1.0), ("sec", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)],
            Quantity::Count => &[],
        }
    }

    /// How many SI units one of `unit` is; none for a word that is no unit of this quantity. `N mm`, `N*mm`, `N·mm`, `N-mm`,
    /// `N_mm` and `Nmm` are the same.
    pub fn factor(self, unit: &str) -> Option<f64> {
        let letters: String =
            unit.chars().filter(|c| !" *·.-_".contains(*c)).flat_map(char::to_lowercase).collect();
        let letters = letters.replace(['µ', 'μ'], "u");
        self.table().iter().find(|(name, _)| *name == letters).map(|(_, factor)| *factor)
    }

    /// The units there are, for messages.
    pub fn known(self) -> String {
        self.table().iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ")
    }
}

/// One degree, radians.
const DEGREE: f64 = std::f64::consts::PI / 180.0;
/// One gram in standard gravity, newtons.
const GRAM_FORCE: f64 = 9.806_65e-3;
/// One avoirdupois pound in standard gravity, newtons.
const POUND: f64 = 4.448_221_615_260_5;

/// The units of columns that do not state one: SI unless said otherwise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Units {
    /// Metres per unit of length.
    pub length: f64,
    /// Radians per unit of angle.
    pub angle: f64,
    /// Newtons per unit of force.
    pub force: f64,
    /// Newton metres per unit of moment.
    pub moment: f64,
    /// Seconds per unit of time.
    pub time: f64,
}

impl Default for Units {
    fn default() -> Self {
        Units { length: 1.0, angle: 1.0, force: 1.0, moment: 1.0, time: 1.0 }
    }
}

impl Units {
    /// SI units per unit of this quantity.
    pub fn of(&self, quantity: Quantity) -> f64 {
        match quantity {
            Quantity::Length => self.length,
            Quantity::Angle => self.angle,
            Quantity::Force => self.force,
            Quantity::Moment => self.moment,
            Quantity::Time => self.time,
            Quantity::Count => 1.0,
        }
    }

    /// Sets one of them: `set("length", "mm")`.
    ///
    /// # Errors
    /// A sentence with the quantities or the units there are.
    pub fn set(&mut self, quantity: &str, unit: &str) -> Result<(), String> {
        use Quantity::{Angle, Force, Length, Moment, Time};
        let all = [Length, Angle, Force, Moment, Time];
        let Some(known) = all.into_iter().find(|q| q.name() == quantity.trim()) else {
            let names = all.map(Quantity::name).join(", ");
            return Err(format!("`{quantity}` has no unit here; there are {names}"));
        };
        let Some(factor) = known.factor(unit) else {
            return Err(format!("`{unit}` is no unit of {quantity}; there are {}", known.known()));
        };
        *match known {
            Length => &mut self.length,
            Angle => &mut self.angle,
            Force => &mut self.force,
            Moment => &mut self.moment,
            _ => &mut self.time,
        } = factor;
        Ok(())
    }

    /// From `length=mm,angle=deg,moment=N mm`.
    ///
    /// # Errors
    /// As `set`, or a piece without `=`.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut units = Units::default();
        for piece in text.split(',').filter(|piece| !piece.trim().is_empty()) {
            let (quantity, unit) =
                piece.split_once('=').ok_or(format!("`{piece}` is not QUANTITY=UNIT, e.g. length=mm"))?;
            units.set(quantity, unit)?;
        }
        Ok(units)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spellings_of_one_unit_are_equal() {
        for unit in ["N mm", "N*mm", "N·mm", "N-mm", "n_mm", "Nmm", "mN m"] {
            assert_eq!(Quantity::Moment.factor(unit), Some(1e-3), "{unit}");
        }
        assert_eq!(Quantity::Length.factor("µm"), Some(1e-6));
        assert_eq!(Quantity::Force.factor("mm"), None);
    }

    #[test]
    fn pieces_are_set_and_slips_are_named() {
        let units = Units::parse("length=mm, angle=deg").expect("units");
        assert_eq!((units.length, units.force), (1e-3, 1.0));
        assert!((units.angle * 180.0 - std::f64::consts::PI).abs() < 1e-15);
        assert!(Units::parse("lenth=mm").unwrap_err().contains("length, angle"));
        assert!(Units::parse("force=mm").unwrap_err().contains("gf"));
    }
}
