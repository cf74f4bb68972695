//! Densities of materials, each with its source.

use super::Material;

const fn material(
    name: &'static str,
    title: &'static str,
    density_g_cm3: f64,
    range_g_cm3: Option<[f64; 2]>,
    source: &'static str,
) -> Material {
    Material { name, title, density_g_cm3, range_g_cm3, source }
}

/// Metals for casting and what their patterns are made of, sorted by name.
pub const MATERIALS: [Material; 18] = [
    material("aluminium", "Aluminium", 2.7, None, "Stuller metals table 2012"),
    material("bluecast", "BlueCast castable resin (pattern)", 1.09, None, "Kat Kramer"),
    material("brass", "Brass", 8.4, None, "Stuller metals table 2012"),
    material("bronze", "Bronze", 8.8, None, "Romanoff"),
    material("fine_silver", "Fine silver", 10.53, None, "Stuller metals table 2012"),
    material("gold_10k_yellow", "10 K yellow gold", 11.57, None, "Stuller metals table 2012"),
    material("gold_14k_red", "14 K red gold", 13.26, None, "Stuller metals table 2012"),
    material("gold_14k_white", "14 K white gold", 12.61, None, "Stuller metals table 2012"),
    material("gold_14k_yellow", "14 K yellow gold", 13.07, Some([13.07, 13.7]), "Stuller metals table 2012; upper: Romanoff, 585 gold"),
    material("gold_18k_red", "18 K red gold", 15.18, None, "Stuller metals table 2012"),
    material("gold_18k_white", "18 K white gold", 14.64, None, "Stuller metals table 2012"),
    material("gold_18k_yellow", "18 K yellow gold", 15.58, None, "Stuller metals table 2012"),
    material("gold_24k", "Fine gold, 24 K", 19.36, None, "Stuller metals table 2012"),
    material("injection_wax", "Injection wax (pattern)", 1.0, Some([0.95, 1.09]), "Romanoff; Ganoksin"),
    material("palladium_950", "Palladium 950", 12.0, None, "Romanoff"),
    material("platinum_950", "Platinum 950", 20.7, None, "Romanoff"),
    material("platinum_iridium", "Platinum iridium", 21.54, None, "Stuller metals table 2012"),
    material("sterling_silver", "Sterling silver", 10.4, Some([10.36, 10.4]), "Stuller metals table 2012; lower: A&U"),
];
