//! The grammar of the command line.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use lacuna_exchange::document::MOST_CELLS_LISTED;
use lacuna_exchange::document::with::{self, ITSELF, PRIMITIVES};
use lacuna_fabrication::job::With;

use crate::config::Role;

/// Fabrication-oriented geometry: fractals, curves and meshes to certified, printable solids.
///
/// Lengths are mm. stdout carries data only. `-` stands for stdin or stdout.
/// Exit codes: 0 ok; 1 a check failed; 2 usage; 3 invalid model or file; 4 a limit was hit;
/// 5 service unreachable; 6 input/output; 70 a defect of lacuna; 130 interrupted.
#[derive(Debug, Parser)]
#[command(name = "lacuna", version, verbatim_doc_comment)]
pub(super) struct Cli {
    /// Let a service do the work: solidify, evaluate, measure, intersect, slice, convert, run, plan, validate, solve, address,
    /// verify, bless, diff and jobs go to it; every other command works here. Its key is taken from LACUNA_API_KEY alone.
    #[arg(long, global = true, value_name = "URL", env = "LACUNA_SERVER")]
    pub(super) server: Option<String>,
    /// Work here, whatever LACUNA_SERVER says.
    #[arg(long, global = true)]
    pub(super) local: bool,
    /// How progress is told on stderr.
    #[arg(long, global = true, value_enum, default_value_t = ProgressMode::Auto)]
    pub(super) progress: ProgressMode,
    /// Say nothing but errors.
    #[arg(long, short, global = true)]
    pub(super) quiet: bool,
    /// How errors are told on stderr: words, or problem JSON (RFC 9457).
    #[arg(long, global = true, value_enum, default_value_t = ErrorFormat::Text)]
    pub(super) error_format: ErrorFormat,
    #[command(subcommand)]
    pub(super) command: Command,
}

/// How progress is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum ProgressMode {
    /// A bar if stderr is a terminal, else nothing.
    Auto,
    /// A bar.
    Bar,
    /// One JSON object per line.
    Json,
    /// Nothing.
    None,
}

/// How errors are told.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum ErrorFormat {
    /// Words.
    Text,
    /// Problem JSON.
    Json,
}

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Make a printable solid: the shape dilated by a ball.
    Solidify(SolidifyArgs),
    /// Make points, wires or a surface within a tolerance.
    Evaluate(EvaluateArgs),
    /// Measure box, area, volume, centroid, inertia, mass and fractal dimension as intervals; JSON on stdout.
    Measure(MeasureArgs),
    /// Combine solids: what lies in any of them, in all, or in the first alone. Without an operation: tell where two shapes, or a shape and a
    /// point, line, plane, box or ball, come within the tolerance of each other; JSON on stdout.
    Intersect(IntersectArgs),
    /// Cut a solid with parallel planes: closed polygons with holes, as SVG or DXF.
    Slice(SliceArgs),
    /// Say what is wrong with a model; JSON on stdout, exit code 3 when it is invalid.
    Validate {
        /// The model document.
        model: PathBuf,
        /// Draw the automaton, valid or not: `.svg`, or `.dot` for Graphviz.
        #[arg(long, value_name = "FILE")]
        draw: Option<PathBuf>,
    },
    /// Solve the unknown entries of a model; all solutions as JSON on stdout.
    Solve(SolveArgs),
    /// Tell where an address leads, or which addresses lead near a point; JSON on stdout.
    Address(AddressArgs),
    /// Predict what a job costs; JSON on stdout.
    Plan {
        /// The job document.
        job: PathBuf,
    },
    /// Do a job, or the jobs of a batch, and put the files into a folder; what was made is told as JSON on stdout. Exit code 1 if a job of a batch does not succeed.
    Run(RunArgs),
    /// Tell what a mesh file contains; JSON on stdout.
    Inspect {
        /// An STL, 3MF, OBJ, PLY, OFF or VRML file.
        file: PathBuf,
    },
    /// Write a mesh file in other formats. Polygons stay polygons where the format has them; coordinates are rounded to
    /// single precision.
    Convert(ConvertArgs),
    /// List the classics of the library as JSON, or give the model document of one.
    Library(LibraryArgs),
    /// List materials with their densities and sources; JSON on stdout.
    Materials,
    /// List the numbers of processes with their ranges and sources, or of one; JSON on stdout.
    Profiles {
        /// `sla`, `cast` or `panels`; all when absent.
        process: Option<String>,
    },
    /// Do the cases below a folder and compare with what they expect; exit code 1 when one fails.
    Verify(VerifyArgs),
    /// Do the cases below a folder and write their certificates beside them, as results that somebody approves of, with the reason,
    /// the time and the version. `verify` compares with them from then on. Exit code 1 in any case: a blessing is no verification.
    Bless(BlessArgs),
    /// Compare two certificates, or two mesh files: what differs, in which unit, by how much, and whether both can be true of one
    /// shape; exit code 1 when they cannot.
    Diff(DiffArgs),
    /// Jobs of a service, one step at a time; of the service that runs on this machine without --server.
    #[command(subcommand)]
    Jobs(JobsCommand),
    /// Serve HTTP.
    Serve(ServeArgs),
    /// Ask a running service whether it is ready; exit code 5 when not.
    Healthcheck {
        /// Its address; the one that `serve` would use when absent.
        #[arg(long)]
        url: Option<String>,
    },
    /// Do jobs for the service that started this process: told on stdin, answered on stdout.
    #[command(name = crate::jobs::process::COMMAND, hide = true)]
    DoJobs {
        /// Threads that a job may use.
        #[arg(long, value_name = "COUNT")]
        threads: usize,
        /// What it is for.
        #[arg(long, value_enum, default_value_t)]
        purpose: crate::jobs::process::Purpose,
    },
    /// Print the OpenAPI description of the service.
    Openapi,
    /// Print the settings of `serve` and where each comes from.
    Doctor(ServeArgs),
    /// Print a completion script for a shell.
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
}

#[derive(Debug, Subcommand)]
pub(super) enum JobsCommand {
    /// Submit a job document and print the job; do not wait for it.
    Submit {
        /// The job document.
        job: PathBuf,
        /// The same key gives the same job again; a new one when absent.
        #[arg(long, value_name = "KEY")]
        idempotency_key: Option<String>,
    },
    /// Print a page of jobs, the newest first.
    List {
        /// Only jobs in this state.
        #[arg(long)]
        state: Option<String>,
        /// Only jobs of this kind.
        #[arg(long)]
        kind: Option<String>,
        /// Jobs of the page, 1 to 200.
        #[arg(long)]
        limit: Option<String>,
        /// `next` of the page before.
        #[arg(long)]
        cursor: Option<String>,
    },
    /// Print a job as it stands.
    Show {
        /// Its id.
        id: String,
    },
    /// Print a job's events as lines of JSON until it ends; the exit code is that of its end.
    Watch {
        /// Its id.
        id: String,
    },
    /// Stop a job and print it.
    Cancel {
        /// Its id.
        id: String,
    },
    /// Fetch a job's files: what broke off is resumed, and every file is held against its digest.
    Fetch(FetchArgs),
}

#[derive(Debug, Args)]
pub(super) struct FetchArgs {
    /// The job's id.
    pub(super) id: String,
    /// Folder for the files; it is made if needed.
    #[arg(short = 'o', long = "output", value_name = "DIR")]
    pub(super) folder: PathBuf,
    /// Only this output, for example `3mf`; may be given several times.
    #[arg(long = "only", value_name = "NAME")]
    pub(super) outputs: Vec<String>,
}

/// What a computation may use.
#[derive(Debug, Default, Args)]
pub(super) struct LimitArgs {
    /// Most triangles of the result.
    #[arg(long, value_name = "COUNT", help_heading = "Limits")]
    pub(super) limit_triangles: Option<u64>,
    /// Most accounted memory, in bytes or with K, M or G (powers of 1024).
    #[arg(long, value_name = "BYTES", value_parser = bytes, help_heading = "Limits")]
    pub(super) limit_memory: Option<u64>,
    /// Most bytes of all files, or with K, M or G (powers of 1024).
    #[arg(long, value_name = "BYTES", value_parser = bytes, help_heading = "Limits")]
    pub(super) limit_output: Option<u64>,
    /// Most time, in seconds.
    #[arg(long, value_name = "SECONDS", value_parser = positive, help_heading = "Limits")]
    pub(super) limit_seconds: Option<f64>,
    /// Threads to use; one per core when absent. The result does not depend on it.
    #[arg(long, value_name = "COUNT", help_heading = "Limits")]
    pub(super) threads: Option<usize>,
}

/// Files to write.
#[derive(Debug, Args)]
pub(super) struct OutputArgs {
    /// File to write, its format chosen by its ending; may be given several times. `-` is stdout.
    #[arg(short, long = "output", value_name = "FILE", required = true)]
    pub(super) outputs: Vec<PathBuf>,
    /// Format of what goes to stdout.
    #[arg(long, value_name = "FORMAT")]
    pub(super) format: Option<String>,
    /// Write the certificate as JSON.
    #[arg(long, value_name = "FILE")]
    pub(super) certificate: Option<PathBuf>,
    /// Write a picture.
    #[arg(long, value_name = "FILE.png", value_parser = picture)]
    pub(super) preview: Option<PathBuf>,
}

/// On which side of a surface a wall is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum SideName {
    /// Inside: the solid becomes hollow.
    Inward,
    /// Outside: what the surface bounds becomes the hollow.
    Outward,
}

#[derive(Debug, Args)]
pub(super) struct SolidifyArgs {
    /// The model document.
    pub(super) model: PathBuf,
    /// Hausdorff bound on the result, in mm; a level needs none, for it is exact but for the single precision of the files.
    #[arg(long, value_name = "MM", value_parser = positive, required_unless_present = "level")]
    pub(super) tolerance: Option<f64>,
    /// Radius of the ball, in mm; not needed with --wall for a model that is a closed surface, nor with --level.
    #[arg(long, value_name = "MM", value_parser = positive, required_unless_present_any = ["wall", "level"])]
    pub(super) radius: Option<f64>,
    /// Fill gaps narrower than this, in mm.
    #[arg(long, value_name = "MM", value_parser = positive, requires = "radius", conflicts_with = "stability")]
    pub(super) closing: Option<f64>,
    /// Make a wall of this thickness along the surface of the solid instead, in mm: a hollow part.
    #[arg(long, value_name = "MM", value_parser = positive)]
    pub(super) wall: Option<f64>,
    /// On which side of the surface the wall is.
    #[arg(long, value_enum, default_value_t = SideName::Inward, requires = "wall")]
    pub(super) side: SideName,
    /// Of an ifs, instead of a dilation: the union of all copies of its primitive along addresses of this length, as an exact solid. The primitive is the
    /// model's solid, or else the box of its attractor.
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u32).range(0..=64), conflicts_with_all = ["radius", "closing", "wall", "no_simplify", "stability"])]
    pub(super) level: Option<u32>,
    /// Leave all triangles of the lattice: quicker, and many times more triangles.
    #[arg(long)]
    pub(super) no_simplify: bool,
    /// Examine at which radii nearby the topology changes, and from which on the shape is one piece: takes longer.
    #[arg(long)]
    pub(super) stability: bool,
    /// Make meshes solids first: join vertices at the same place, take away copies and triangles without area, turn triangles outward. What was done is told;
    /// holes of up to 64 edges are closed by triangles that meet nothing else, and other open meshes are refused.
    #[arg(long)]
    pub(super) repair: bool,
    #[command(flatten)]
    pub(super) output: OutputArgs,
    #[command(flatten)]
    pub(super) limits: LimitArgs,
}

#[derive(Debug, Args)]
pub(super) struct EvaluateArgs {
    /// The model document.
    pub(super) model: PathBuf,
    /// Hausdorff bound on the result, in mm.
    #[arg(long, value_name = "MM", value_parser = positive)]
    pub(super) tolerance: f64,
    /// Write the normals of the limit surface beside its vertices, where the format has room for them (PLY, OBJ, GLB, VRML).
    #[arg(long)]
    pub(super) normals: bool,
    #[command(flatten)]
    pub(super) output: OutputArgs,
    #[command(flatten)]
    pub(super) limits: LimitArgs,
}

#[derive(Debug, Args)]
pub(super) struct MeasureArgs {
    /// The model document, or an STL, 3MF, OBJ, PLY, OFF or VRML file.
    pub(super) model: PathBuf,
    /// Another one: tell the Hausdorff distance of both instead.
    #[arg(conflicts_with_all = ["radius", "density", "direction", "oriented_box", "thickness", "map"])]
    pub(super) other: Option<PathBuf>,
    /// Hausdorff bound on what is measured, in mm.
    #[arg(long, value_name = "MM", value_parser = positive)]
    pub(super) tolerance: f64,
    /// Radius of the ball, in mm: measure the solid instead of the shape itself.
    #[arg(long, value_name = "MM", value_parser = positive)]
    pub(super) radius: Option<f64>,
    /// Tell how far the shape extends along a direction too.
    #[arg(long, value_name = "X,Y,Z", value_parser = direction, allow_hyphen_values = true)]
    pub(super) direction: Option<[f64; 3]>,
    /// Find the smallest box, whatever way it is turned.
    #[arg(long)]
    pub(super) oriented_box: bool,
    /// Find the least thickness of walls and gaps.
    #[arg(long)]
    pub(super) thickness: bool,
    /// Write the thickness all over the surface: the mesh that is measured, every vertex and face with the properties `wall_mm` and `gap_mm`, `inf` where no
    /// face lies across.
    #[arg(long, value_name = "FILE.ply", requires = "thickness")]
    pub(super) map: Option<PathBuf>,
    /// Density of the material, in g/cm3: the mass is told too.
    #[arg(long, value_name = "G/CM3", value_parser = positive)]
    pub(super) density: Option<f64>,
    /// Make meshes solids first: join vertices at the same place, take away copies and triangles without area, turn triangles outward. What was done is told;
    /// holes of up to 64 edges are closed by triangles that meet nothing else, and other open meshes are refused.
    #[arg(long)]
    pub(super) repair: bool,
    #[command(flatten)]
    pub(super) limits: LimitArgs,
}

/// An operation on solids.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum OperationName {
    /// What lies in any input.
    Union,
    /// What lies in all inputs.
    Intersection,
    /// What lies in the first input and in none of the others.
    Difference,
    /// The convex hull of all inputs.
    Hull,
    /// What of one input lies behind a plane.
    Trim,
    /// One input in parts between planes across the axes.
    Split,
}

#[derive(Debug, Args)]
pub(super) struct IntersectArgs {
    /// Model documents, or STL, 3MF, OBJ, PLY, OFF or VRML files: two or more.
    #[arg(required = true, num_args = 1.., value_name = "MODEL")]
    pub(super) models: Vec<PathBuf>,
    /// What to leave of them as a solid; without it, files are not written.
    #[arg(long, value_enum, requires = "outputs")]
    pub(super) operation: Option<OperationName>,
    /// What one model is held against: point:X,Y,Z, segment:, ray: or line: with six numbers, plane:NX,NY,NZ,OFFSET, box: with its two corners, or
    /// ball:X,Y,Z,RADIUS, in mm; or self: where it comes near itself although no boundary that the model declares joins it there.
    #[arg(long, value_name = "WHAT:NUMBERS", value_parser = against, conflicts_with = "operation")]
    pub(super) with: Option<With>,
    /// With `--operation trim`: the plane, by its normal and its offset along that in mm. What the normal points to is taken away.
    #[arg(long, value_name = "NX,NY,NZ,OFFSET", value_parser = cut_plane, allow_hyphen_values = true)]
    pub(super) plane: Option<[f64; 4]>,
    /// With `--operation split`: the build volume that every part fits, in mm.
    #[arg(long, value_name = "XxYxZ", value_parser = volume)]
    pub(super) volume: Option<[f64; 3]>,
    /// With `--operation split`: where to cut across an axis, in mm; may be given several times.
    #[arg(long = "cut", value_name = "AXIS=MM", value_parser = axis_cut)]
    pub(super) cuts: Vec<(usize, f64)>,
    /// With `--operation split`: width and length of pegs that stand in sockets of neighbouring parts, in mm.
    #[arg(long, value_name = "MM", value_parser = positive, requires = "clearance")]
    pub(super) key: Option<f64>,
    /// Distance between the faces of a peg and of its socket, in mm.
    #[arg(long, value_name = "MM", value_parser = distance, requires = "key")]
    pub(super) clearance: Option<f64>,
    /// Hausdorff bound on every solid, in mm; without an operation, how near shapes must come.
    #[arg(long, value_name = "MM", value_parser = positive)]
    pub(super) tolerance: f64,
    /// Radius of the ball that dilates the inputs, in mm: once for all, or once for each in their order. 0, or none, takes closed surfaces as
    /// the solids that they bound.
    #[arg(long, value_name = "MM", value_parser = distance, requires = "operation")]
    pub(super) radius: Vec<f64>,
    /// File to write, its format chosen by its ending; may be given several times. `-` is stdout.
    #[arg(short, long = "output", value_name = "FILE", requires = "operation")]
    pub(super) outputs: Vec<PathBuf>,
    /// Format of what goes to stdout.
    #[arg(long, value_name = "FORMAT", requires = "operation")]
    pub(super) format: Option<String>,
    /// Write the certificate as JSON.
    #[arg(long, value_name = "FILE", requires = "operation")]
    pub(super) certificate: Option<PathBuf>,
    /// Write a picture.
    #[arg(long, value_name = "FILE.png", value_parser = picture, requires = "operation")]
    pub(super) preview: Option<PathBuf>,
    /// Make meshes solids first: join vertices at the same place, take away copies and triangles without area, turn triangles outward. What was done is told;
    /// holes of up to 64 edges are closed by triangles that meet nothing else, and other open meshes are refused.
    #[arg(long)]
    pub(super) repair: bool,
    #[command(flatten)]
    pub(super) limits: LimitArgs,
}

#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("planes").required(true).args(["at", "step"]))]
pub(super) struct SliceArgs {
    /// The model document, or an STL, 3MF, OBJ, PLY, OFF or VRML file.
    pub(super) model: PathBuf,
    /// Hausdorff bound on the solid, in mm.
    #[arg(long, value_name = "MM", value_parser = positive)]
    pub(super) tolerance: f64,
    /// Radius of the ball that dilates the model, in mm; without one, its closed surfaces are the solids that they bound.
    #[arg(long, value_name = "MM", value_parser = positive)]
    pub(super) radius: Option<f64>,
    /// What the planes are perpendicular to.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, default_value = "0,0,1", allow_hyphen_values = true)]
    pub(super) normal: [f64; 3],
    /// Where a plane is along the normal, in mm; may be given several times, or as a list with commas.
    #[arg(long, value_name = "MM", value_parser = finite, value_delimiter = ',', allow_hyphen_values = true)]
    pub(super) at: Vec<f64>,
    /// Height of layers, in mm: planes in their middles, from the bottom of the solid to its top.
    #[arg(long, value_name = "MM", value_parser = positive)]
    pub(super) step: Option<f64>,
    /// Make meshes solids first: join vertices at the same place, take away copies and triangles without area, turn triangles outward. What was done is told;
    /// holes of up to 64 edges are closed by triangles that meet nothing else, and other open meshes are refused.
    #[arg(long)]
    pub(super) repair: bool,
    #[command(flatten)]
    pub(super) output: OutputArgs,
    #[command(flatten)]
    pub(super) limits: LimitArgs,
}

#[derive(Debug, Args)]
pub(super) struct SolveArgs {
    /// The model document, in which `null` is unknown.
    pub(super) model: PathBuf,
    /// File for the model without unknowns. `-` is stdout, and the solutions are then summed up on stderr.
    #[arg(short, long = "output", value_name = "FILE")]
    pub(super) output: Option<PathBuf>,
    /// Value of a free parameter; may be given several times.
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = named_value)]
    pub(super) values: Vec<(String, f64)>,
    /// Print one JSON object with the solutions and the model, as `POST /v1/solve` answers.
    #[arg(long)]
    pub(super) json: bool,
    /// Most time, in seconds.
    #[arg(long, value_name = "SECONDS", value_parser = positive, default_value_t = 300.0, help_heading = "Limits")]
    pub(super) limit_seconds: f64,
}

#[derive(Debug, Args)]
#[group(skip)]
pub(super) struct AddressArgs {
    /// The model document.
    pub(super) model: PathBuf,
    /// An address: root cell, transitions, and in parentheses those that repeat without end, for example "0: 1 2 (0 3)".
    #[arg(long, value_name = "ADDRESS", required_unless_present = "near", conflicts_with_all = ["near", "within", "tolerance", "most"])]
    pub(super) at: Option<lacuna_kernel::attractor::Address>,
    /// A point in mm.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    pub(super) near: Option<[f64; 3]>,
    /// List cells as far as this, in mm; those that may hold the closest point of the shape when absent.
    #[arg(long, value_name = "MM", value_parser = distance)]
    pub(super) within: Option<f64>,
    /// Radius to which cells are refined, in mm; a thousandth of the shape's when absent.
    #[arg(long, value_name = "MM", value_parser = positive)]
    pub(super) tolerance: Option<f64>,
    /// Cells to list at most.
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u64).range(1..=MOST_CELLS_LISTED as u64))]
    pub(super) most: Option<u64>,
}

#[derive(Debug, Args)]
pub(super) struct RunArgs {
    /// The job document, or one of a batch: `{"lacuna": 1, "jobs": [{"name": ..., "job": ...}]}`.
    pub(super) job: PathBuf,
    /// Folder for the files; it is made if needed.
    #[arg(short = 'o', long = "output", value_name = "DIR")]
    pub(super) folder: PathBuf,
    #[command(flatten)]
    pub(super) limits: LimitArgs,
}

#[derive(Debug, Args)]
pub(super) struct ConvertArgs {
    /// An STL, 3MF, OBJ, PLY, OFF or VRML file; what it is, is found in it. `-` is stdin.
    pub(super) file: PathBuf,
    /// Files to write, each in the format of its ending. `-` is stdout.
    #[arg(value_name = "OUT", required = true)]
    pub(super) outputs: Vec<PathBuf>,
    /// Format of what goes to stdout.
    #[arg(long, value_name = "FORMAT")]
    pub(super) format: Option<String>,
    /// Make the mesh a solid first: join vertices at the same place, take away copies and triangles without area, turn triangles outward. Polygons become triangles where anything is done, which is told;
    /// holes of up to 64 edges are closed by triangles that meet nothing else, and other open meshes are refused.
    #[arg(long)]
    pub(super) repair: bool,
}

#[derive(Debug, Args)]
pub(super) struct LibraryArgs {
    /// The classic; all are listed when absent.
    pub(super) name: Option<String>,
    /// The document to write; stdout when absent.
    #[arg(short, long = "output", value_name = "MODEL", requires = "name")]
    pub(super) output: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(super) struct VerifyArgs {
    /// Folder with cases, at any depth.
    pub(super) folder: PathBuf,
    /// Print the report as JSON on stdout instead of a table.
    #[arg(long)]
    pub(super) json: bool,
    /// Also write a report that CI systems read.
    #[arg(long, value_name = "FILE")]
    pub(super) junit: Option<PathBuf>,
    /// Only cases whose path contains this text.
    #[arg(long, value_name = "TEXT")]
    pub(super) filter: Option<String>,
}

#[derive(Debug, Args)]
pub(super) struct BlessArgs {
    /// Folder with cases, at any depth.
    pub(super) folder: PathBuf,
    /// Why the results are right, or why they may be others than before.
    #[arg(long, value_name = "TEXT")]
    pub(super) reason: String,
    /// Only cases whose path contains this text.
    #[arg(long, value_name = "TEXT")]
    pub(super) filter: Option<String>,
    /// Also state in expected.toml that the result is within so many mm of a coarse mesh, which is written beside it: `[shape]`.
    #[arg(long, value_name = "MM", value_parser = positive)]
    pub(super) shape: Option<f64>,
    /// Also state the bytes of the result in this format, for results of this version: `[digest]`; several times for several formats.
    #[arg(long, value_name = "FORMAT")]
    pub(super) digest: Vec<String>,
    /// Also state that the work should take no more seconds than this: `[perf]`, which decides nothing unless the file says `gating = true`.
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    pub(super) perf: Option<f64>,
    /// Print what was done as JSON on stdout.
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Debug, Args)]
pub(super) struct DiffArgs {
    /// A certificate, what `run` or a service says of a job, a `blessed.json`, or a mesh file.
    pub(super) first: PathBuf,
    /// Another one of the same kind.
    pub(super) second: PathBuf,
    /// Of mesh files that are not the same bytes: how far apart their surfaces may be, in mm (Hausdorff distance).
    #[arg(long, value_name = "MM", value_parser = positive)]
    pub(super) within: Option<f64>,
    /// Print all members as JSON on stdout instead of a table.
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Debug, Args)]
pub(super) struct ServeArgs {
    /// File of settings (TOML), which go behind flags and environment.
    #[arg(long, value_name = "FILE")]
    pub(super) config: Option<PathBuf>,
    /// Address and port; port 0 takes a free one. An address beyond this machine needs LACUNA_API_KEYS.
    #[arg(long, value_name = "ADDRESS:PORT")]
    pub(super) bind: Option<String>,
    /// Data folder.
    #[arg(long, value_name = "DIR")]
    pub(super) data: Option<PathBuf>,
    /// Jobs that are done at the same time.
    #[arg(long, value_name = "COUNT")]
    pub(super) workers: Option<usize>,
    /// Threads that the jobs share; one per core when absent.
    #[arg(long, value_name = "COUNT")]
    pub(super) threads: Option<usize>,
    /// What this process does: `all`, `front` (answers) or `worker` (does jobs). The last two need LACUNA_DATABASE_URL and
    /// a bucket.
    #[arg(long, value_name = "ROLE", value_parser = role)]
    pub(super) role: Option<Role>,
    /// Bucket for documents and results that several processes share.
    #[arg(long, value_name = "s3://BUCKET/FOLDER")]
    pub(super) objects_url: Option<String>,
    /// Names beside those of this machine under which a service without keys answers, separated by commas.
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    pub(super) host_names: Vec<String>,
    /// Log as JSON.
    #[arg(long)]
    pub(super) log_json: bool,
}

fn role(text: &str) -> Result<Role, String> {
    text.parse().map_err(|()| "all, front or worker is expected".to_owned())
}

fn finite(text: &str) -> Result<f64, String> {
    text.parse::<f64>().ok().filter(|value| value.is_finite()).ok_or_else(|| "a number is expected".to_owned())
}

/// The name of a picture.
fn picture(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    let is_named = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("png"));
    if is_named { Ok(path) } else { Err("a picture is a PNG file; let its name end in .png".to_owned()) }
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("a positive number is expected".to_owned()),
    }
}

/// The value stands behind the last `=`: names may have one.
fn named_value(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.rsplit_once('=').filter(|(name, _)| !name.is_empty()).ok_or("NAME=VALUE is expected, for example a=0.25")?;
    match value.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok((name.to_owned(), value)),
        _ => Err(format!("{value:?} is not a finite number")),
    }
}

fn against(text: &str) -> Result<With, String> {
    if text == ITSELF {
        return Ok(With::Itself);
    }
    let (word, numbers) = text.split_once(':').ok_or("WHAT:NUMBERS is expected, for example plane:0,0,1,5, or self")?;
    let numbers: Option<Vec<f64>> =
        numbers.split(',').map(|word| word.trim().parse().ok().filter(|value: &f64| value.is_finite())).collect();
    let Some((_, count)) = PRIMITIVES.iter().find(|(known, _)| *known == word) else {
        let known = with::words().join(", ");
        return Err(format!("'{word}' is none of {known}"));
    };
    let found = numbers.and_then(|numbers| with::primitive(word, &numbers));
    found.map(With::Primitive).ok_or_else(|| format!("a {word} takes {count} numbers with commas between"))
}

fn distance(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value >= 0.0 => Ok(value),
        _ => Err("a distance of zero or more is expected".to_owned()),
    }
}

/// So many finite numbers with a character between.
fn numbers<const N: usize>(text: &str, between: char) -> Option<[f64; N]> {
    let numbers: Option<Vec<f64>> =
        text.split(between).map(|word| word.trim().parse().ok().filter(|value: &f64| value.is_finite())).collect();
    numbers.and_then(|numbers| numbers.try_into().ok())
}

fn point(text: &str) -> Result<[f64; 3], String> {
    numbers(text, ',').ok_or_else(|| "three numbers are expected, for example 1.5,-2,0".to_owned())
}

fn direction(text: &str) -> Result<[f64; 3], String> {
    let vector: Option<[f64; 3]> = numbers(text, ',').filter(|vector: &[f64; 3]| vector.iter().any(|part| *part != 0.0));
    vector.ok_or_else(|| "a vector with a length is expected, for example 1,1,0".to_owned())
}

fn cut_plane(text: &str) -> Result<[f64; 4], String> {
    let plane: Option<[f64; 4]> = numbers(text, ',').filter(|[x, y, z, _]| [x, y, z].iter().any(|part| **part != 0.0));
    plane.ok_or_else(|| "a normal with a length and an offset are expected, for example 0,0,1,5".to_owned())
}

fn volume(text: &str) -> Result<[f64; 3], String> {
    let volume: Option<[f64; 3]> = numbers(text, 'x').filter(|sides: &[f64; 3]| sides.iter().all(|side| *side > 0.0));
    volume.ok_or_else(|| "three positive lengths are expected, for example 200x200x180".to_owned())
}

fn axis_cut(text: &str) -> Result<(usize, f64), String> {
    let cut = text.split_once('=').and_then(|(name, offset)| {
        let axis = ["x", "y", "z"].iter().position(|axis| axis.eq_ignore_ascii_case(name.trim()))?;
        let [offset] = numbers(offset, ',')?;
        Some((axis, offset))
    });
    cut.ok_or_else(|| "an axis and an offset are expected, for example x=50".to_owned())
}

fn bytes(text: &str) -> Result<u64, String> {
    let (digits, shift) = match text.trim_end_matches(['b', 'B', 'i']) {
        text if text.ends_with(['k', 'K']) => (&text[..text.len() - 1], 10),
        text if text.ends_with(['m', 'M']) => (&text[..text.len() - 1], 20),
        text if text.ends_with(['g', 'G']) => (&text[..text.len() - 1], 30),
        text => (text, 0),
    };
    let number = digits.trim().parse::<u64>().ok().and_then(|number| number.checked_mul(1 << shift));
    number.ok_or_else(|| "a number of bytes is expected, for example 4294967296, 512M or 4G".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_grammar_is_consistent() {
        Cli::command().debug_assert();
    }

    /// The examples of the pages parse: a command's short options are what they say.
    #[test]
    fn the_commands_of_the_pages_parse() {
        let pages = [include_str!("../../README.md"), include_str!("../../../README.md")];
        let commands = pages.iter().flat_map(|page| page.lines()).filter_map(|line| line.strip_prefix("$ lacuna "));
        let mut count = 0;
        for command in commands {
            // Addresses are quoted; nothing else is.
            let mut words = vec!["lacuna".to_owned()];
            for (index, part) in command.split('"').enumerate() {
                let plain = index % 2 == 0;
                words.extend(if plain { part.split_whitespace().map(str::to_owned).collect() } else { vec![part.to_owned()] });
            }
            words.retain(|word| word != "&");
            assert!(Cli::try_parse_from(&words).is_ok(), "{command}");
            count += 1;
        }
        assert!(count > 10, "{count}");
    }

    #[test]
    fn named_values() {
        assert_eq!(named_value("a=-0.25"), Ok(("a".to_owned(), -0.25)));
        assert_eq!(named_value("b=c.0[1][2]=1e-3"), Ok(("b=c.0[1][2]".to_owned(), 1e-3)));
        for bad in ["a", "=1", "a=", "a=nan", "a=inf", "a=1e999", "a=1/4", "a=0,25"] {
            assert!(named_value(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn sizes_and_lengths() {
        assert_eq!(bytes("4G"), Ok(4 << 30));
        assert_eq!(bytes("512MiB"), Ok(512 << 20));
        assert_eq!(bytes("7"), Ok(7));
        assert!(bytes("-1").is_err() && bytes("99999999999999G").is_err());
        assert_eq!(point("1.5, -2,0"), Ok([1.5, -2.0, 0.0]));
        assert!(point("1,2").is_err() && point("1,2,nan").is_err() && distance("-1").is_err() && distance("0").is_ok());
        assert!(positive("0").is_err() && positive("nan").is_err() && positive("inf").is_err());
    }
}
