//! What trades know, as data: densities of materials, and the numbers of processes, each with its source.

mod materials;
mod profiles;

pub use materials::MATERIALS;
pub use profiles::PROFILES;

use serde::Serialize;
use utoipa::ToSchema;

use crate::problem::{Problem, ProblemKind};

/// A material.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, ToSchema)]
pub struct Material {
    /// Its name.
    pub name: &'static str,
    /// What people call it.
    pub title: &'static str,
    /// Its density in g/cm3; an alloy's own data sheet goes before it.
    pub density_g_cm3: f64,
    /// How far sources disagree.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_g_cm3: Option<[f64; 2]>,
    /// Where the numbers come from.
    pub source: &'static str,
}

/// Where a number comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// The source says so.
    Sourced,
    /// It was chosen, for the reason that the source tells.
    Chosen,
}

/// A number of a process.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, ToSchema)]
pub struct Quantity {
    /// Its name.
    pub name: &'static str,
    /// The default.
    pub value: f64,
    /// The least that is seen.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min: Option<f64>,
    /// The most that is seen.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max: Option<f64>,
    /// The unit; empty for numbers without one.
    pub unit: &'static str,
    /// Where it comes from.
    pub source: &'static str,
    /// How.
    pub kind: Kind,
    /// When it holds.
    #[serde(skip_serializing_if = "str::is_empty")]
    pub remark: &'static str,
}

/// The numbers of a process.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, ToSchema)]
pub struct Profile {
    /// The name of the process.
    pub name: &'static str,
    /// What people call it.
    pub title: &'static str,
    /// Its numbers.
    pub quantities: &'static [Quantity],
}

/// The materials.
#[derive(Debug, Serialize, ToSchema)]
pub struct MaterialPage {
    /// The materials, sorted by name.
    items: &'static [Material],
}

/// The profiles.
#[derive(Debug, Serialize, ToSchema)]
pub struct ProfilePage {
    /// The profiles, sorted by name.
    items: &'static [Profile],
}

/// All materials.
#[must_use]
pub fn materials() -> MaterialPage {
    MaterialPage { items: &MATERIALS }
}

/// All profiles.
#[must_use]
pub fn profiles() -> ProfilePage {
    ProfilePage { items: &PROFILES }
}

/// The profile of a process.
///
/// # Errors
/// When there is none, with those there are.
pub fn profile(process: &str) -> Result<&'static Profile, Problem> {
    PROFILES.iter().find(|profile| profile.name == process).ok_or_else(|| {
        let asked: String = process.chars().take(80).collect();
        let names: Vec<&str> = PROFILES.iter().map(|profile| profile.name).collect();
        Problem::new(ProblemKind::NotFound, format!("there is no profile {asked:?}; there are {}", names.join(", ")))
            .code("profile.unknown")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_lie_in_their_ranges_and_have_sources() {
        let mut names: Vec<&str> = MATERIALS.iter().map(|material| material.name).collect();
        assert!(names.is_sorted());
        names.dedup();
        assert_eq!(names.len(), MATERIALS.len());
        for material in MATERIALS {
            let [low, high] = material.range_g_cm3.unwrap_or([material.density_g_cm3; 2]);
            assert!(0.5 < low && low <= material.density_g_cm3 && material.density_g_cm3 <= high && high < 23.0, "{material:?}");
            assert!(!material.source.is_empty(), "{material:?}");
        }
        for profile in PROFILES {
            let mut names: Vec<&str> = profile.quantities.iter().map(|quantity| quantity.name).collect();
            names.sort_unstable();
            assert!(names.windows(2).all(|pair| pair[0] != pair[1]), "{names:?}");
            for quantity in profile.quantities {
                let (low, high) = (quantity.min.unwrap_or(quantity.value), quantity.max.unwrap_or(quantity.value));
                assert!(low <= quantity.value && quantity.value <= high && !quantity.source.is_empty(), "{quantity:?}");
            }
        }
    }
}
