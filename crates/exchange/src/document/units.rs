//! Units of length, all converted to mm on reading.

/// The unit of a document's lengths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unit {
    Micrometre,
    Millimetre,
    Centimetre,
    Metre,
    Inch,
}

/// The units by their name in documents.
pub(super) const UNITS: [(&str, Unit); 5] =
    [("um", Unit::Micrometre), ("mm", Unit::Millimetre), ("cm", Unit::Centimetre), ("m", Unit::Metre), ("in", Unit::Inch)];

impl Unit {
    /// The length in mm: one correctly rounded operation, so that 1000 um is 1 mm exactly.
    pub(super) fn to_mm(self, length: f64) -> f64 {
        match self {
            // why: a thousandth is not a double, a thousand is
            Self::Micrometre => length / 1000.0,
            Self::Millimetre => length,
            Self::Centimetre => length * 10.0,
            Self::Metre => length * 1000.0,
            Self::Inch => length * 25.4,
        }
    }

    /// Its name in documents.
    pub(super) fn symbol(self) -> &'static str {
        UNITS.iter().find(|(_, unit)| *unit == self).map_or("mm", |(name, _)| name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_become_millimetres() {
        let lengths: Vec<f64> = UNITS.iter().map(|(_, unit)| unit.to_mm(7.0)).collect();
        assert_eq!(lengths, [0.007, 7.0, 70.0, 7000.0, 177.79999999999998]);
        assert_eq!(Unit::Micrometre.to_mm(1000.0), 1.0);
        assert_eq!(Unit::Inch.symbol(), "in");
    }
}
