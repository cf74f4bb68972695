//! Adapter for the comparison with other programs: IN.obj RADIUS TOLERANCE OUT.bin REPEATS.
use lacuna_kernel::budget::Budget;
use lacuna_kernel::dilation::{dilate, dilate_unsimplified};
use lacuna_kernel::model::{Interior, Model, PolygonMesh, Shape};
use lacuna_kernel::tolerance::{Radius, Tolerance};
use std::io::Write;
fn cpu() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap();
    let f: Vec<&str> = stat.rsplit(')').next().unwrap().split_whitespace().collect();
    (f[11].parse::<f64>().unwrap() + f[12].parse::<f64>().unwrap()) / 100.0
}
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let text = std::fs::read_to_string(&a[1]).unwrap();
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for line in text.lines() {
        let mut w = line.split_whitespace();
        match w.next() {
            Some("v") => {
                let c: Vec<f64> = w.map(|x| x.parse().unwrap()).collect();
                vertices.push(glam::DVec3::new(c[0], c[1], c[2]))
            }
            Some("l" | "f") => faces.push(w.map(|x| x.split('/').next().unwrap().parse::<u32>().unwrap() - 1).collect()),
            _ => {}
        }
    }
    let scale: f64 = a.get(6).map_or(1.0, |s| s.parse().unwrap());
    vertices.iter_mut().for_each(|v: &mut glam::DVec3| *v *= scale);
    let model = Model { name: None, shape: Shape::Mesh(PolygonMesh { vertices, faces, interior: Interior::Surface }) };
    let attractor = model.lower().unwrap().attractor;
    let (r, t) =
        (Radius::new(scale * a[2].parse::<f64>().unwrap()).unwrap(), Tolerance::new(scale * a[3].parse::<f64>().unwrap()).unwrap());
    let (mut walls, mut cpus) = (vec![], vec![]);
    let mut out = None;
    for _ in 0..a[5].parse::<usize>().unwrap() {
        let (c, w) = (cpu(), std::time::Instant::now());
        let f = if std::env::var_os("RAW").is_some() { dilate_unsimplified } else { dilate };
        let d = f(
            &attractor,
            r,
            t,
            &Budget {
                limits: lacuna_kernel::budget::Limits { triangles: u64::MAX, memory_bytes: 12 << 30, ..Default::default() },
                ..Default::default()
            },
        );
        if let Err(e) = &d {
            eprintln!("{e} {} s wall {} cpu", w.elapsed().as_secs_f64(), cpu() - c);
        }
        let d = d.unwrap();
        walls.push(w.elapsed().as_secs_f64());
        cpus.push(cpu() - c);
        out = Some(d);
    }
    let d = out.unwrap();
    let mesh = d.solid.mesh();
    let mut f = std::io::BufWriter::new(std::fs::File::create(&a[4]).unwrap());
    f.write_all(&(mesh.vertices.len() as u64).to_le_bytes()).unwrap();
    f.write_all(&(mesh.triangles.len() as u64).to_le_bytes()).unwrap();
    for v in &mesh.vertices {
        for x in (*v / scale).to_array() {
            f.write_all(&x.to_le_bytes()).unwrap()
        }
    }
    for t in &mesh.triangles {
        for x in t {
            f.write_all(&x.to_le_bytes()).unwrap()
        }
    }
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let rss: f64 = status.lines().find(|l| l.starts_with("VmHWM")).unwrap().split_whitespace().nth(1).unwrap().parse().unwrap();
    eprintln!(
        "crossings {} {:?} inner {} outer {} pitch {}",
        d.crossings,
        d.solid.topology(),
        d.inner_mm / scale,
        d.outer_mm / scale,
        d.pitch_mm / scale
    );
    println!("{{\"wall\": {walls:?}, \"cpu\": {cpus:?}, \"rss_mb\": {}}}", rss / 1024.0);
}
