//! SplitMix64 (G. Steele, D. Lea and C. Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014).

/// What a generator adds to its state for every number.
pub(crate) const STEP: u64 = 0x9E37_79B9_7F4A_7C15;

/// The number that a generator gives in a state.
pub(crate) fn number(state: u64) -> u64 {
    mix(state.wrapping_add(STEP))
}

/// A number in [0, 1) from the 53 highest bits of another.
pub(crate) fn share(bits: u64) -> f64 {
    (bits >> 11) as f64 / (1_u64 << 53) as f64
}

/// The finaliser: a bijection of 64 bits that spreads every bit.
pub(crate) fn mix(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}

/// A generator.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> u64 {
        let number = number(self.0);
        self.0 = self.0.wrapping_add(STEP);
        number
    }

    /// A number in [0, 1).
    pub(crate) fn share(&mut self) -> f64 {
        share(self.next())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_generator_is_splitmix64() {
        // First outputs of the reference implementation for the seed 0, and of its counter's second step.
        assert_eq!(number(0), 0xe220_a839_7b1d_cdaf);
        assert_eq!(number(0x9e37_79b9_7f4a_7c15), 0x6e78_9e6a_a1b9_65f4);
    }
}
