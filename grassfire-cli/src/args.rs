//! The command line.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;

/// From topology-optimization meshes to editable, checked CAD solids.
///
/// Lengths are millimetres. Data goes to stdout, progress and messages to stderr.
#[derive(Debug, Parser)]
#[command(name = "grassfire", version, after_help = EXIT_CODES, max_term_width = 100)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

const EXIT_CODES: &str = "\
Exit codes:
  0    all well
  1    a check failed; the files are written
  2    bad input or usage; nothing is written
  3    a stage failed
  130  cancelled";

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Turns a mesh or a density into a STEP solid and a report
    #[command(after_help = RECONSTRUCT_EXAMPLES)]
    Reconstruct(Box<ReconstructArgs>),
    /// Optimizes the topology of a project file
    Optimize(Box<CaseArgs>),
    /// Optimizes a project file, reconstructs the result and verifies it
    Run(Box<ChainArgs>),
    /// Computes the stiffness of a finished solid under the loads of a project file
    #[command(after_help = VERIFY_EXAMPLES)]
    Verify(Box<VerifyArgs>),
    /// Checks a project file and lists what its selections hold
    Check(Box<CheckArgs>),
    /// Computes how a solid freezes in sand: hot spots, feeding, Niyama's criterion
    #[command(after_help = SOLIDIFY_EXAMPLES)]
    Solidify(SolidifyArgs),
    /// Looks at how a solid leaves its mould: undercuts, parting, draft, walls
    #[command(after_help = MOULD_EXAMPLES)]
    Mould(MouldArgs),
    /// Runs everything on a built-in example
    Demo(DemoArgs),
    /// Prints the JSON Schema of all options (the keys of --set)
    Schema {
        /// Of which command
        #[arg(value_enum, default_value = "reconstruct")]
        of: SchemaOf,
    },
    /// Prints the library of materials as a TOML file, to copy and change
    Materials,
    /// Lists the faces of a STEP file, as selections of a project file ask for them
    Faces {
        /// STEP file
        file: PathBuf,
    },
    /// Prints the version, and with --cite the papers behind it
    About(AboutArgs),
    /// Prints a completion script for a shell
    Completions {
        /// The shell
        shell: Shell,
    },
    /// Prints the manual page
    Man,
}

const RECONSTRUCT_EXAMPLES: &str = "\
Examples:
  grassfire reconstruct part.stl -o out
  grassfire reconstruct part.stl --non-design bores.step --voxel 0.8 -o out
  grassfire reconstruct density.vti --iso 0.4 --set remesh.min_tunnel=0 -o out --json
  grassfire reconstruct part.stl --draw 0,0,1 --set mould.repair=best --case case.toml -o out";

const SOLIDIFY_EXAMPLES: &str = "\
Examples:
  grassfire solidify part.stl -o out --set solidify.material=a356
  grassfire solidify part.step --feeder 112,0,15 --set solidify.feeder_diameter=40 -o out";

/// Arguments of `solidify`.
#[derive(Debug, Args)]
pub struct SolidifyArgs {
    /// The solid: a mesh or STEP
    #[arg(value_name = "SOLID")]
    pub part: PathBuf,
    /// Where a feeder stands, mm; may be repeated (solidify.feeders)
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true)]
    pub feeder: Vec<[f64; 3]>,
    /// Folder for the results; made when missing
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// What all runs share.
    #[command(flatten)]
    pub run: RunArgs,
}

const MOULD_EXAMPLES: &str = "\
Examples:
  grassfire mould part.stl --draw 0,0,1 -o out
  grassfire mould part.step -o out                    the best draw direction is looked for
  grassfire mould proposal.stl --draw 0,0,1 --set mould.repair=fill -o out";

/// Arguments of `mould`.
#[derive(Debug, Args)]
pub struct MouldArgs {
    /// The solid: a mesh or STEP
    #[arg(value_name = "SOLID")]
    pub part: PathBuf,
    /// Draw direction; without it the best is looked for (mould.draw)
    #[arg(long, value_name = "DX,DY,DZ", value_parser = vector, allow_hyphen_values = true)]
    pub draw: Option<[f64; 3]>,
    /// Folder for the results; made when missing
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// What all runs share.
    #[command(flatten)]
    pub run: RunArgs,
}

/// Arguments of `reconstruct`.
#[derive(Debug, Args)]
pub struct ReconstructArgs {
    /// Mesh (STL, OBJ, PLY, OFF, 3MF) or density (VTI, VTU, NPY)
    #[arg(value_name = "PART")]
    pub part: PathBuf,
    /// Body that must be in the solid as given (STEP or STL); may be repeated
    #[arg(long, value_name = "FILE")]
    pub non_design: Vec<PathBuf>,
    /// Design space (STEP): faces of it that the part still follows are recognised as non-design
    #[arg(long, value_name = "FILE")]
    pub design_space: Option<PathBuf>,
    /// What to do with bores and bosses recognised in the part (non_design.recognise)
    #[arg(long, value_enum, value_name = "MODE")]
    pub recognise: Option<Recognise>,
    /// Quad skeleton to use instead of our own (PLY or OBJ)
    #[arg(long, value_name = "FILE")]
    pub skeleton: Option<PathBuf>,
    /// How quads are put together to faces (brep.faces)
    #[arg(long, value_enum, value_name = "MODE")]
    pub faces: Option<Faces>,
    /// Edge of a voxel, mm (remesh.voxel)
    #[arg(long, value_name = "MM", value_parser = positive, allow_negative_numbers = true)]
    pub voxel: Option<f64>,
    /// Flat faces whose border turns by at least this become exactly plane with sharp edges, degrees (flats.crease_angle)
    #[arg(long, value_name = "DEG", value_parser = positive, allow_negative_numbers = true)]
    pub crease_angle: Option<f64>,
    /// Edge of a skeleton quad, mm (skeleton.quad_size)
    #[arg(long, value_name = "MM", value_parser = positive, allow_negative_numbers = true)]
    pub quad_size: Option<f64>,
    /// Density at which material begins (read.threshold)
    #[arg(long, value_name = "VALUE", value_parser = finite, allow_negative_numbers = true)]
    pub iso: Option<f64>,
    /// Files to write besides part.step and part.stl; may be repeated or a comma list (files.formats)
    #[arg(long, value_enum, value_name = "FORMAT", value_delimiter = ',')]
    pub format: Vec<FileFormat>,
    /// Where a feeder stands, mm: sections grow towards it; may be repeated (feed.feeders)
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true)]
    pub feeder: Vec<[f64; 3]>,
    /// How much sections grow towards the feeders, radius a length (feed.growth)
    #[arg(long, value_name = "G", value_parser = finite, allow_negative_numbers = true)]
    pub growth: Option<f64>,
    /// Draw direction of the mould: the finished part is looked at along it (mould.draw, feed.draw)
    #[arg(long, value_name = "DX,DY,DZ", value_parser = vector, allow_hyphen_values = true)]
    pub draw: Option<[f64; 3]>,
    /// Project file (TOML) whose loads tell which repair of undercuts is best (for mould.repair=best)
    #[arg(long, value_name = "CASE")]
    pub case: Option<PathBuf>,
    /// Refuse a mesh that needs repair (repair.strict)
    #[arg(long)]
    pub strict: bool,
    /// Folder for the results; made when missing
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// What all runs share.
    #[command(flatten)]
    pub run: RunArgs,
}

/// Whose options the schema describes.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum SchemaOf {
    /// The options of `reconstruct`
    Reconstruct,
    /// The project file
    Case,
}

/// Arguments of `optimize`.
#[derive(Debug, Args)]
pub struct CaseArgs {
    /// Project file (TOML)
    #[arg(value_name = "CASE")]
    pub case: PathBuf,
    /// Folder for the results; made when missing
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Go on from the state that an earlier run saved there (optimize.save_every)
    #[arg(long)]
    pub resume: bool,
    /// What all runs share.
    #[command(flatten)]
    pub run: RunArgs,
}

/// Arguments of `run`.
#[derive(Debug, Args)]
pub struct ChainArgs {
    /// Project file (TOML)
    #[arg(value_name = "CASE")]
    pub case: PathBuf,
    /// The last stage
    #[arg(long, value_enum, value_name = "STAGE", default_value = "verify")]
    pub to: ChainEnd,
    /// Folder for the results; made when missing [default: out/ and the name of the project file or of its folder]
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// What all runs share.
    #[command(flatten)]
    pub run: RunArgs,
}

/// Where `run` ends.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum ChainEnd {
    /// After the optimization
    Optimize,
    /// After the reconstruction
    Reconstruct,
    /// After the proof of stiffness
    Verify,
}

const VERIFY_EXAMPLES: &str = "\
Examples:
  grassfire verify part.step --case case.toml -o out
  grassfire verify part.step --case case.toml --proposal opt/density.vti -o out
  grassfire verify case.toml -o out                   the part.step and density.vti in out
  grassfire verify case.toml -o out --solver ccx      on tetrahedra too, beside CalculiX";

/// Arguments of `verify`.
#[derive(Debug, Args)]
pub struct VerifyArgs {
    /// The solid (a closed mesh or STEP); or the project file, whose part.step (else part.stl) lies in DIR
    #[arg(value_name = "SOLID|CASE")]
    pub input: PathBuf,
    /// Project file (TOML) with material, supports and loads
    #[arg(long, value_name = "CASE")]
    pub case: Option<PathBuf>,
    /// The density.vti of `optimize` on the same project file: its full voxels are loaded too
    #[arg(long, value_name = "FILE")]
    pub proposal: Option<PathBuf>,
    /// Verify on body-fitted ten-node tetrahedra too (needs gmsh)
    #[arg(long)]
    pub tetrahedra: bool,
    /// Who solves the tetrahedra: grassfire alone, or CalculiX too, with a comparison (needs ccx)
    #[arg(long, value_enum, value_name = "SOLVER", default_value = "own")]
    pub solver: TetSolver,
    /// Folder for the results; made when missing
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// What all runs share.
    #[command(flatten)]
    pub run: RunArgs,
}

/// Who solves the tetrahedra.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum TetSolver {
    /// grassfire
    Own,
    /// grassfire and CalculiX
    Ccx,
}

/// Arguments of `check`.
#[derive(Debug, Args)]
pub struct CheckArgs {
    /// Project file (TOML)
    #[arg(value_name = "CASE")]
    pub case: PathBuf,
    /// Folder for pictures of what the selections hold; made when missing
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// What all runs share.
    #[command(flatten)]
    pub run: RunArgs,
}

/// What is done with recognised non-design bodies.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum Recognise {
    /// Look for nothing
    Off,
    /// List them in the report
    List,
    /// List them; without --non-design, unite them with the part
    Auto,
}

/// A file of the finished part.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum FileFormat {
    /// part.step: AP242 with names and colours, always written
    Step,
    /// part.brep: OpenCASCADE's own format
    Brep,
    /// part.igs: IGES 5.3
    Iges,
    /// part.3mf: closed triangles with unit and names
    #[value(name = "3mf")]
    ThreeMf,
    /// casting.step: the part with its feeders and their necks as bodies (needs --feeder)
    Casting,
    /// pieces/: the fitted body and each non-design body as STEP, for tools/freecad_tree.py
    Pieces,
}

/// How many faces the solid gets.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum Faces {
    /// As few as there are without changing the surface
    Exact,
    /// Fewer, by a coarser control mesh; the surface moves by half a voxel at most (brep.tolerance)
    Fewest,
    /// One a quad
    Quads,
}

/// Arguments of `demo`.
#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Which example
    #[arg(value_enum)]
    pub example: Example,
    /// The light wishbone of the paper's geometry II on voxels of 1.875 mm: some ten minutes instead of one
    #[arg(long)]
    pub fine: bool,
    /// The paper's variants I to IV, free and drawn, as optimized and edited for casting, side by side: some ten minutes
    #[arg(long, conflicts_with = "fine")]
    pub all: bool,
    /// Folder for the results [default: out/EXAMPLE]
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// What all runs share.
    #[command(flatten)]
    pub run: RunArgs,
}

/// The built-in examples.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum Example {
    /// A suspension wishbone with two bushing eyes and a ball-joint boss
    Wishbone,
}

/// Arguments of `about`.
#[derive(Debug, Args)]
pub struct AboutArgs {
    /// List the papers whose methods are used
    #[arg(long)]
    pub cite: bool,
}

/// What all runs share.
#[derive(Debug, Args)]
pub struct RunArgs {
    /// Sets any option, such as remesh.min_tunnel=0; may be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Threads; 0 takes all cores
    #[arg(long, value_name = "N")]
    pub threads: Option<usize>,
    /// Print report.json on stdout
    #[arg(long)]
    pub json: bool,
    /// No progress, warnings or summary
    #[arg(short, long, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Say when each stage ends and how long it took
    #[arg(short, long)]
    pub verbose: bool,
}

fn finite(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if value.is_finite() {
        Ok(value)
    } else {
        Err("must be finite".to_owned())
    }
}

fn vector(text: &str) -> Result<[f64; 3], String> {
    let parts: Vec<f64> = text
        .split(',')
        .map(|part| finite(part.trim()))
        .collect::<Result<_, _>>()?;
    <[f64; 3]>::try_from(parts).map_err(|_| "three numbers with commas wanted".to_owned())
}

fn positive(text: &str) -> Result<f64, String> {
    let value = finite(text)?;
    if value > 0.0 {
        Ok(value)
    } else {
        Err("must be above 0".to_owned())
    }
}
