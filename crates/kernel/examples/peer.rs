//! lacuna's side of the comparison in `tests/benches/peers`: thickens the points, lines and triangles of a Wavefront file, prints what it
//! cost and what it claims as JSON, and writes the mesh in the comparison's format.
//!
//! `peer IN.obj RADIUS TOLERANCE OUT.bin [REPEATS [SCALE]]`; everything is multiplied by SCALE on the way in and divided on the way out,
//! because the kernel works in millimetres. With `RAW` in the environment the lattice's mesh is left as it is.
use std::error::Error;
use std::fs;
use std::io::{BufWriter, Write};
use std::time::Instant;

use glam::DVec3;
use lacuna_kernel::budget::{Budget, Limits};
use lacuna_kernel::dilation::{Dilation, dilate, dilate_unsimplified};
use lacuna_kernel::model::{Interior, Model, PolygonMesh, Shape};
use lacuna_kernel::tolerance::{Radius, Tolerance};

type Outcome<T> = Result<T, Box<dyn Error>>;

/// CPU seconds of all threads of this process so far; Linux counts them in hundredths.
fn cpu_seconds() -> Outcome<f64> {
    let stat = fs::read_to_string("/proc/self/stat")?;
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap_or_default().split_whitespace().collect();
    Ok((fields[11].parse::<f64>()? + fields[12].parse::<f64>()?) / 100.0)
}

/// Peak of the resident memory in megabytes.
fn peak_memory() -> Outcome<f64> {
    let status = fs::read_to_string("/proc/self/status")?;
    let line = status.lines().find(|line| line.starts_with("VmHWM")).ok_or("no VmHWM")?;
    Ok(line.split_whitespace().nth(1).ok_or("no value")?.parse::<f64>()? / 1024.0)
}

/// Vertices, and the lines and faces as lists of them.
fn read(path: &str, scale: f64) -> Outcome<Model> {
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for line in fs::read_to_string(path)?.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let x = words.map(str::parse).collect::<Result<Vec<f64>, _>>()?;
                vertices.push(scale * DVec3::new(x[0], x[1], x[2]));
            }
            Some("l" | "f") => faces.push(words.map(|word| word.parse::<u32>().map(|i| i - 1)).collect::<Result<Vec<_>, _>>()?),
            _ => {}
        }
    }
    Ok(Model { name: None, shape: Shape::Mesh(PolygonMesh { vertices, faces, interior: Interior::Surface }) })
}

/// Counts, coordinates and corners, little endian.
fn write(dilation: &Dilation, path: &str, scale: f64) -> Outcome<()> {
    let mesh = dilation.solid.mesh();
    let mut file = BufWriter::new(fs::File::create(path)?);
    file.write_all(&(mesh.vertices.len() as u64).to_le_bytes())?;
    file.write_all(&(mesh.triangles.len() as u64).to_le_bytes())?;
    for coordinate in mesh.vertices.iter().flat_map(|v| (*v / scale).to_array()) {
        file.write_all(&coordinate.to_le_bytes())?;
    }
    for corner in mesh.triangles.iter().flatten() {
        file.write_all(&corner.to_le_bytes())?;
    }
    Ok(file.flush()?)
}

fn main() -> Outcome<()> {
    let words: Vec<String> = std::env::args().collect();
    let [_, input, radius, tolerance, output, rest @ ..] = words.as_slice() else {
        return Err("peer IN.obj RADIUS TOLERANCE OUT.bin [REPEATS [SCALE]]".into());
    };
    let repeats: usize = rest.first().map_or(Ok(1), |word| word.parse())?;
    let scale: f64 = rest.get(1).map_or(Ok(1.0), |word| word.parse())?;
    let model = read(input, scale)?;
    let attractor = model.lower().map_err(|findings| format!("{findings:?}"))?.attractor;
    let radius = Radius::new(scale * radius.parse::<f64>()?)?;
    let tolerance = Tolerance::new(scale * tolerance.parse::<f64>()?)?;
    let limits = Limits { triangles: u64::MAX, memory_bytes: 12 << 30, ..Limits::default() };
    let budget = Budget { limits, ..Budget::default() };
    let run = if std::env::var_os("RAW").is_some() { dilate_unsimplified } else { dilate };
    let (mut wall, mut cpu, mut last) = (Vec::new(), Vec::new(), None);
    for _ in 0..repeats.max(1) {
        let (cpu_before, start) = (cpu_seconds()?, Instant::now());
        last = Some(run(&attractor, radius, tolerance, &budget)?);
        wall.push(start.elapsed().as_secs_f64());
        cpu.push(cpu_seconds()? - cpu_before);
    }
    let dilation = last.ok_or("no run")?;
    write(&dilation, output, scale)?;
    let (inner, outer) = (dilation.inner_mm / scale, dilation.outer_mm / scale);
    let pitch = dilation.pitch_mm.map_or("null".to_owned(), |pitch| (pitch / scale).to_string());
    writeln!(
        std::io::stdout(),
        "{{\"wall\": {wall:?}, \"cpu\": {cpu:?}, \"rss_mb\": {}, \"claimed_inner\": {inner}, \"claimed_outer\": {outer}, \"pitch\": {pitch}, \
         \"claimed_crossings\": {}, \"uncertain\": {}, \"topology_exact\": {}}}",
        peak_memory()?,
        dilation.crossings,
        dilation.uncertain,
        dilation.topology_exact
    )?;
    Ok(())
}
