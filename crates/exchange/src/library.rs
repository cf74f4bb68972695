//! Classics as model documents, each with its source, in mm and 100 mm long, wide or high.
//!
//! Curves are states with ends, so that an evaluation is one polyline. The documents are written by
//! `fixtures/derive` from exact maps.

/// A named model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Classic {
    /// Its name on the command line and over HTTP.
    pub name: &'static str,
    /// What people call it.
    pub title: &'static str,
    /// Where it comes from.
    pub source: &'static str,
    /// The model document.
    pub document: &'static str,
}

macro_rules! classics {
    ($($name:literal, $title:literal, $source:literal;)+) => {
        /// All classics, by name.
        pub const CLASSICS: &[Classic] = &[$(Classic {
            name: $name,
            title: $title,
            source: $source,
            document: include_str!(concat!("../library/", $name, ".json")),
        }),+];
    };
}

classics! {
    "barnsley_fern", "Barnsley's fern",
        "M. Barnsley, Fractals Everywhere, Academic Press, 1988, table 3.3: four affine maps, the stem's singular.";
    "binary_tree", "Binary tree",
        "B. Mandelbrot, The Fractal Geometry of Nature, Freeman, 1982, chapter 16: branches at 45 degrees, ratio 3/5.";
    "cantor_dust", "Cantor dust",
        "G. Cantor, Math. Ann. 21 (1883); the product of two of his sets, four maps of ratio 1/3.";
    "cantor_set", "Cantor's set",
        "G. Cantor, Ueber unendliche, lineare Punktmannichfaltigkeiten, Math. Ann. 21, 1883.";
    "cesaro_curve", "Cesaro's curve",
        "E. Cesaro, Remarques sur la courbe de von Koch, Atti R. Accad. Sci. Fis. Mat. Napoli 12, 1905; base angle 85 degrees, the ratio a parameter.";
    "gosper_curve", "Gosper's flowsnake",
        "M. Gardner, In which monster curves force redefinition of the word curve, Scientific American, December 1976; found by R. W. Gosper, 1973.";
    "heighway_dragon", "Heighway dragon",
        "C. Davis, D. Knuth, Number representations and dragon curves, J. Recreational Mathematics 3, 1970; found by J. Heighway, 1966.";
    "hilbert_curve", "Hilbert's curve",
        "D. Hilbert, Ueber die stetige Abbildung einer Linie auf ein Flaechenstueck, Math. Ann. 38, 1891.";
    "koch_curve", "Koch curve",
        "H. von Koch, Sur une courbe continue sans tangente, Arkiv foer Matematik 1, 1904.";
    "koch_snowflake", "Koch snowflake",
        "H. von Koch, Arkiv foer Matematik 1, 1904: his curve on the three sides of a triangle, joined.";
    "koch_surface", "Koch surface",
        "B. Mandelbrot, The Fractal Geometry of Nature, Freeman, 1982: Koch's construction with tetrahedra on triangles, six maps of ratio 1/2.";
    "levy_curve", "Levy's curve",
        "P. Levy, Les courbes planes ou gauches et les surfaces composees de parties semblables au tout, J. Ecole Polytechnique, 1938.";
    "looped_takagi_curve", "Looped Takagi curve",
        "After T. Takagi, 1903, and G. de Rham, Sur quelques courbes definies par des equations fonctionnelles, Rend. Sem. Mat. Torino 16, 1957: the details shrink by 0.65 and turn by 60 degrees.";
    "menger_sponge", "Menger sponge",
        "K. Menger, Allgemeine Raeume und Cartesische Raeume, Proc. Acad. Amsterdam 29, 1926.";
    "peano_curve", "Peano's curve",
        "G. Peano, Sur une courbe, qui remplit toute une aire plane, Math. Ann. 36, 1890.";
    "pythagoras_tree", "Pythagoras tree",
        "A. E. Bosman, 1942, in Het wondere onderzoekingsveld der vlakke meetkunde, Breda, 1957.";
    "sierpinski_carpet", "Sierpinski carpet",
        "W. Sierpinski, Sur une courbe cantorienne qui contient une image biunivoque et continue de toute courbe donnee, C. R. Acad. Sci. Paris 162, 1916.";
    "sierpinski_tetrahedron", "Sierpinski tetrahedron",
        "B. Mandelbrot, The Fractal Geometry of Nature, Freeman, 1982: Sierpinski's triangle in space.";
    "sierpinski_triangle", "Sierpinski triangle",
        "W. Sierpinski, Sur une courbe dont tout point est un point de ramification, C. R. Acad. Sci. Paris 160, 1915.";
    "takagi_curve", "Takagi's curve",
        "T. Takagi, A simple example of the continuous function without derivative, Proc. Phys.-Math. Soc. Japan 1, 1903.";
    "terdragon", "Terdragon",
        "C. Davis, D. Knuth, Number representations and dragon curves, J. Recreational Mathematics 3, 1970.";
    "vicsek_fractal", "Vicsek fractal",
        "T. Vicsek, Fractal models for diffusion controlled aggregation, J. Phys. A 16, 1983.";
}

/// The classic of a name.
#[must_use]
pub fn find(name: &str) -> Option<&'static Classic> {
    CLASSICS.iter().find(|classic| classic.name == name)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::document::{DocumentLimits, read_model, write_model};
    use lacuna_fabrication::{Geometry, Input, Job, JobKind, Outcome, Params, run, validate};
    use lacuna_kernel::budget::{Budget, Limits};
    use std::f64::consts::FRAC_1_SQRT_2;

    fn done(name: &str, kind: JobKind, tolerance_mm: f64) -> Outcome {
        let model = read_model(find(name).unwrap().document.as_bytes(), &DocumentLimits::default()).unwrap();
        let inputs = vec![Input { name: name.to_owned(), model, radius_mm: None }];
        let params = Params::new(tolerance_mm);
        let job = Job { kind, inputs, params, outputs: Vec::new(), limits: Limits::default() };
        run(&job, &Budget::default()).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    #[test]
    fn every_classic_is_valid_and_reads_back() {
        assert!(CLASSICS.len() >= 20);
        assert!(CLASSICS.is_sorted_by_key(|classic| classic.name));
        for classic in CLASSICS {
            let model = read_model(classic.document.as_bytes(), &DocumentLimits::default()).unwrap();
            let found = validate(&model, &Budget::default());
            assert!(found.valid && found.diagnostics.is_empty(), "{}: {:?}", classic.name, found.diagnostics);
            assert_eq!(found.degrees_of_freedom, Some(0));
            // The name says where it is from, as the table does.
            let year = classic.source.split(|c: char| !c.is_ascii_digit()).find(|word| word.len() == 4).unwrap();
            assert!(model.name.as_ref().unwrap().contains(year), "{}: {:?} and {}", classic.name, model.name, classic.source);
            assert_eq!(read_model(write_model(&model).as_bytes(), &DocumentLimits::default()).unwrap(), model);
        }
        assert_eq!(find("no such"), None);
    }

    /// Boxes for unit size: of curves, triangles and sponges as published; of Cesaro's curve the hull that its maps
    /// leave in place (base angle half of 85 degrees); of the Koch surface the corner of a cube that it fills; of the
    /// Pythagoras tree 6 by 4; of the binary tree geometric series of the steepest and the flattest path, with
    /// c = r/sqrt2: heights 1, c, r^2, c r^2, ..., widths c, r^2, c r^2, ....
    fn exact_box(name: &str) -> Option<[[f64; 3]; 2]> {
        let root = 3_f64.sqrt();
        let flat = |low: [f64; 2], high: [f64; 2]| Some([[low[0], low[1], 0.0], [high[0], high[1], 0.0]]);
        let (r, c) = (0.6, 0.6 * FRAC_1_SQRT_2);
        match name {
            "barnsley_fern" => Some([[-0.218_192_115_04, 0.0, 0.0], [0.265_578_322_70, 0.999_826_503_65, 0.0]]),
            "binary_tree" => {
                let width = (c + r * r) / (1.0 - r * r);
                flat([-width, 0.0], [width, (1.0 + c) / (1.0 - r * r)])
            }
            "cantor_set" => flat([0.0; 2], [1.0, 0.0]),
            "cantor_dust" | "hilbert_curve" | "peano_curve" | "sierpinski_carpet" | "vicsek_fractal" => flat([0.0; 2], [1.0; 2]),
            "cesaro_curve" => flat([0.0; 2], [1.0, 0.5 * 42.5_f64.to_radians().tan()]),
            "heighway_dragon" => flat([-1.0 / 3.0; 2], [7.0 / 6.0, 2.0 / 3.0]),
            "koch_curve" => flat([0.0; 2], [1.0, root / 6.0]),
            "koch_snowflake" => flat([0.0, -root / 6.0], [1.0, root / 2.0]),
            "koch_surface" => Some([[0.0; 3], [1.0, root / 2.0, 1.0 / 6_f64.sqrt()]]),
            "levy_curve" => flat([-0.5, -0.25], [1.5, 1.0]),
            "menger_sponge" => Some([[0.0; 3], [1.0; 3]]),
            "pythagoras_tree" => flat([-2.5, 0.0], [3.5, 4.0]),
            "sierpinski_tetrahedron" => Some([[0.0; 3], [1.0, root / 2.0, (2.0 / 3.0_f64).sqrt()]]),
            "sierpinski_triangle" => flat([0.0; 2], [1.0, root / 2.0]),
            "takagi_curve" => flat([0.0; 2], [1.0, 2.0 / 3.0]),
            "terdragon" => flat([-1.0 / 16.0, -3.0 * root / 16.0], [17.0 / 16.0, 3.0 * root / 16.0]),
            _ => None,
        }
    }

    #[test]
    fn boxes_are_those_of_the_literature() {
        // Without a closed form that we know of.
        let open = ["gosper_curve", "looped_takagi_curve"];
        for classic in CLASSICS {
            let Some([low, high]) = exact_box(classic.name) else {
                assert!(open.contains(&classic.name), "{}", classic.name);
                continue;
            };
            let tolerance = 0.5;
            let found = done(classic.name, JobKind::Measure, tolerance).certificate.bbox_mm;
            for (corner, exact) in found.iter().zip([low, high]) {
                for (interval, exact) in corner.iter().zip(exact.map(|x| 100.0 * x)) {
                    // Published to 1e-8 of the fern's unit.
                    let digits = if classic.name == "barnsley_fern" { 1e-7 } else { 1e-9 };
                    let contains = interval[0] - digits <= exact && exact <= interval[1] + digits;
                    let narrow = exact - interval[0] <= tolerance + digits && interval[1] - exact <= tolerance + digits;
                    assert!(contains && narrow, "{}: {interval:?} for {exact}", classic.name);
                }
            }
        }
    }

    #[test]
    fn curves_are_one_polyline() {
        let curves =
            ["cesaro", "gosper", "hilbert", "koch", "levy", "looped_takagi", "peano", "takagi"].map(|name| format!("{name}_curve"));
        let dragons = ["heighway_dragon", "terdragon"].map(str::to_owned);
        for name in curves.iter().chain(&dragons) {
            let Geometry::Tessellation(sample) = done(name, JobKind::Evaluate, 2.0).geometry else { panic!("{name}") };
            assert!(sample.points.is_empty() && sample.triangles.is_empty() && sample.segments.len() > 10, "{name}");
            let complex = sample.complex.as_ref().unwrap_or_else(|| panic!("{name} has no B-rep"));
            assert_eq!(complex.components, 1, "{name}");
            let mut degree = vec![0; sample.vertices.len()];
            sample.segments.as_flattened().iter().for_each(|&vertex| degree[vertex as usize] += 1);
            // Two ends, and as many ways in as out of every other vertex.
            assert_eq!(degree.iter().filter(|&&degree| degree == 1).count(), 2, "{name}");
            assert!(degree.iter().all(|&degree| degree == 1 || degree % 2 == 0), "{name}");
            // Peano's curve comes back to its own vertices: to (1/3, 1/3) as its second and its sixth.
            if name != "peano_curve" {
                assert!(degree.iter().all(|&degree| degree <= 2), "{name}");
                assert_eq!((sample.vertices.len(), complex.euler), (sample.segments.len() + 1, 1), "{name}");
            }
        }
        let Geometry::Tessellation(flake) = done("koch_snowflake", JobKind::Evaluate, 1.0).geometry else { panic!() };
        assert_eq!((flake.vertices.len(), flake.complex.unwrap().euler), (flake.segments.len(), 0));
    }

    #[test]
    fn the_koch_surface_is_a_disc() {
        let Geometry::Tessellation(sample) = done("koch_surface", JobKind::Evaluate, 5.0).geometry else { panic!() };
        let complex = sample.complex.unwrap();
        assert_eq!((complex.euler, complex.boundary_loops, complex.components), (1, 1, 1));
        assert_eq!(complex.faces, 6_u64.pow(complex.faces.ilog(6)));
    }
}
