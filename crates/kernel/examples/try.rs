use glam::*;
use lacuna_kernel::{budget::*, dilation::dilate, measure::mass, model::*, tolerance::*};
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let (name, r, eps) = (args[1].as_str(), args[2].parse::<f64>().unwrap(), args[3].parse::<f64>().unwrap());
    let similar =
        |scale: f64, t: [f64; 3]| AffineMap { linear: DMat3::from_diagonal(DVec3::splat(scale)), translation: DVec3::from_array(t) };
    let shape = match name {
        "point" => Shape::Mesh(PolygonMesh { vertices: vec![DVec3::ZERO], faces: vec![vec![0]], interior: Interior::Auto }),
        "segment" => Shape::BezierCurve(BezierCurve { control_points: vec![DVec3::ZERO, DVec3::new(10.0, 0.0, 0.0)], weights: None }),
        "two" => {
            Shape::Mesh(PolygonMesh { vertices: vec![DVec3::ZERO, DVec3::X], faces: vec![vec![0], vec![1]], interior: Interior::Auto })
        }
        "rect" => Shape::Mesh(PolygonMesh {
            vertices: vec![DVec3::ZERO, DVec3::new(4.0, 0.0, 0.0), DVec3::new(4.0, 3.0, 0.0), DVec3::new(0.0, 3.0, 0.0)],
            faces: vec![vec![0, 1, 2, 3]],
            interior: Interior::Auto,
        }),
        "cube" => {
            let vertices = (0..8).map(|i| DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2 & 1) as f64)).collect();
            let faces = vec![vec![0, 2, 3, 1], vec![4, 5, 7, 6], vec![0, 1, 5, 4], vec![2, 6, 7, 3], vec![0, 4, 6, 2], vec![1, 3, 7, 5]];
            Shape::Mesh(PolygonMesh { vertices, faces, interior: Interior::Auto })
        }
        "circle" => {
            let h = 0.5_f64.sqrt();
            let parts = (0..4)
                .map(|q| {
                    let p = |k: usize| {
                        [
                            DVec3::new(3.0, 0.0, 0.0),
                            DVec3::new(3.0, 3.0, 0.0),
                            DVec3::new(0.0, 3.0, 0.0),
                            DVec3::new(-3.0, 3.0, 0.0),
                            DVec3::new(-3.0, 0.0, 0.0),
                            DVec3::new(-3.0, -3.0, 0.0),
                            DVec3::new(0.0, -3.0, 0.0),
                            DVec3::new(3.0, -3.0, 0.0),
                        ][k % 8]
                    };
                    Part {
                        name: None,
                        transform: None,
                        shape: Shape::BezierCurve(BezierCurve {
                            control_points: vec![p(2 * q), p(2 * q + 1), p(2 * q + 2)],
                            weights: Some(vec![1.0, h, 1.0]),
                        }),
                    }
                })
                .collect();
            Shape::Group(Group { parts })
        }
        "tetra" => {
            let l = 100.0;
            let v = [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]].map(|p| p.map(|x| x * l / 2f64.sqrt()));
            Shape::Ifs(Ifs { maps: v.iter().map(|p| similar(0.5, p.map(|x| x / 2.0))).collect(), primitive: None, graph: None })
        }
        "koch" => {
            let rot =
                |a: f64, t: [f64; 3]| AffineMap { linear: DMat3::from_rotation_z(a) * (1.0 / 3.0), translation: DVec3::from_array(t) };
            let h = std::f64::consts::FRAC_PI_3;
            Shape::Ifs(Ifs {
                maps: vec![
                    rot(0.0, [0.0; 3]),
                    rot(h, [100.0 / 3.0, 0.0, 0.0]),
                    rot(-h, [50.0, 100.0 * 3f64.sqrt() / 6.0, 0.0]),
                    rot(0.0, [200.0 / 3.0, 0.0, 0.0]),
                ],
                primitive: None,
                graph: None,
            })
        }
        "tetraf" => {
            let v = [[0.0, 0.0, 0.0], [50.0, 0.0, 0.0], [25.0, 43.30127018922193, 0.0], [25.0, 14.433756729740644, 40.8248290463863]];
            Shape::Ifs(Ifs { maps: v.iter().map(|p| similar(0.5, *p)).collect(), primitive: None, graph: None })
        }
        "menger" => {
            let mut maps = vec![];
            for i in 0..27 {
                let c = [i % 3, i / 3 % 3, i / 9];
                if c.iter().filter(|&&x| x == 1).count() < 2 {
                    maps.push(similar(1.0 / 3.0, c.map(|x| x as f64 * 100.0 / 3.0)))
                }
            }
            Shape::Ifs(Ifs { maps, primitive: None, graph: None })
        }
        _ => panic!(),
    };
    let t0 = std::time::Instant::now();
    let lowered = Model { name: None, shape }.lower().unwrap();
    println!("spectral [{}, {}]", lowered.attractor.contraction().lower, lowered.attractor.contraction().upper);
    let mut budget = Budget::default();
    budget.limits.triangles = 100_000_000;
    let t1 = std::time::Instant::now();
    match dilate(&lowered.attractor, Radius::new(r).unwrap(), Tolerance::new(eps).unwrap(), &budget) {
        Ok(d) => {
            println!("lower {:?} dilate {:?}", t1 - t0, t1.elapsed());
            let v = mass::volume(d.solid.mesh());
            println!(
                "pitch {} inner {} outer {} leaves {} volume {} area {} interval {:?}",
                d.pitch_mm,
                d.inner_mm,
                d.outer_mm,
                d.leaf_cells,
                v,
                mass::area(d.solid.mesh()),
                mass::dilated_volume(v, r, d.inner_mm, d.outer_mm)
            );
            println!("{:?}", d.solid.topology());
            println!("box {:?}", d.bounds);
        }
        Err(e) => println!("{e} {e:?}"),
    }
}
