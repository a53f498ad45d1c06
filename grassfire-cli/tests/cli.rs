//! The command line from outside: help, usage errors, bad inputs, exit codes.

use std::path::Path;
use std::process::{Command, Output};

fn grassfire(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_grassfire"))
        .args(args)
        .env_remove("COLUMNS")
        .output()
        .expect("the program starts")
}

fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Exit 2, nothing on stdout, stderr ends with the two lines, and no folder appears.
fn refused(args: &[&str]) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let mut args = args.to_vec();
    let out_text = out.display().to_string();
    args.extend(["-o", &out_text]);
    let output = grassfire(&args);
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert_eq!(stdout(&output), "");
    assert!(!out.exists(), "a refused run must write nothing");
    stderr(&output)
}

fn file(folder: &Path, name: &str, bytes: &[u8]) -> String {
    let path = folder.join(name);
    std::fs::write(&path, bytes).expect("writes");
    path.display().to_string()
}

#[test]
fn help_names_the_commands() {
    let output = grassfire(&["--help"]);
    assert_eq!(output.status.code(), Some(0));
    insta::assert_snapshot!(stdout(&output), @r"
    From topology-optimization meshes to editable, checked CAD solids.

    Lengths are millimetres. Data goes to stdout, progress and messages to stderr.

    Usage: grassfire <COMMAND>

    Commands:
      reconstruct  Turns a mesh or a density into a STEP solid and a report
      optimize     Optimizes the topology of a project file
      run          Optimizes a project file, reconstructs the result and verifies it
      verify       Computes the stiffness of a finished solid under the loads of a project file
      check        Checks a project file and lists what its selections hold
      solidify     Computes how a solid freezes in sand: hot spots, feeding, Niyama's criterion
      mould        Looks at how a solid leaves its mould: undercuts, parting, draft, walls
      demo         Runs everything on a built-in example
      schema       Prints the JSON Schema of all options (the keys of --set)
      materials    Prints the library of materials as a TOML file, to copy and change
      faces        Lists the faces of a STEP file, as selections of a project file ask for them
      about        Prints the version, and with --cite the papers behind it
      completions  Prints a completion script for a shell
      man          Prints the manual page
      help         Print this message or the help of the given subcommand(s)

    Options:
      -h, --help
              Print help (see a summary with '-h')

      -V, --version
              Print version

    Exit codes:
      0    all well
      1    a check failed; the files are written
      2    bad input or usage; nothing is written
      3    a stage failed
      130  cancelled
    ");
}

#[test]
fn reconstruct_help_is_complete() {
    insta::assert_snapshot!(stdout(&grassfire(&["reconstruct", "-h"])), @r"
    Turns a mesh or a density into a STEP solid and a report

    Usage: grassfire reconstruct [OPTIONS] --output <DIR> <PART>

    Arguments:
      <PART>  Mesh (STL, OBJ, PLY, OFF, 3MF) or density (VTI, VTU, NPY)

    Options:
          --non-design <FILE>    Body that must be in the solid as given (STEP or STL); may be repeated
          --design-space <FILE>  Design space (STEP): faces of it that the part still follows are
                                 recognised as non-design
          --recognise <MODE>     What to do with bores and bosses recognised in the part
                                 (non_design.recognise) [possible values: off, list, auto]
          --skeleton <FILE>      Quad skeleton to use instead of our own (PLY or OBJ)
          --faces <MODE>         How quads are put together to faces (brep.faces) [possible values:
                                 exact, fewest, quads]
          --voxel <MM>           Edge of a voxel, mm (remesh.voxel)
          --crease-angle <DEG>   Flat faces whose border turns by at least this become exactly plane
                                 with sharp edges, degrees (flats.crease_angle)
          --quad-size <MM>       Edge of a skeleton quad, mm (skeleton.quad_size)
          --iso <VALUE>          Density at which material begins (read.threshold)
          --format <FORMAT>      Files to write besides part.step and part.stl; may be repeated or a
                                 comma list (files.formats) [possible values: step, brep, iges, 3mf,
                                 casting, pieces]
          --feeder <X,Y,Z>       Where a feeder stands, mm: sections grow towards it; may be repeated
                                 (feed.feeders)
          --growth <G>           How much sections grow towards the feeders, radius a length
                                 (feed.growth)
          --draw <DX,DY,DZ>      Draw direction of the mould: the finished part is looked at along it
                                 (mould.draw, feed.draw)
          --case <CASE>          Project file (TOML) whose loads tell which repair of undercuts is best
                                 (for mould.repair=best)
          --strict               Refuse a mesh that needs repair (repair.strict)
      -o, --output <DIR>         Folder for the results; made when missing
          --set <KEY=VALUE>      Sets any option, such as remesh.min_tunnel=0; may be repeated
          --threads <N>          Threads; 0 takes all cores
          --json                 Print report.json on stdout
      -q, --quiet                No progress, warnings or summary
      -v, --verbose              Say when each stage ends and how long it took
      -h, --help                 Print help (see more with '--help')

    Examples:
      grassfire reconstruct part.stl -o out
      grassfire reconstruct part.stl --non-design bores.step --voxel 0.8 -o out
      grassfire reconstruct density.vti --iso 0.4 --set remesh.min_tunnel=0 -o out --json
      grassfire reconstruct part.stl --draw 0,0,1 --set mould.repair=best --case case.toml -o out
    ");
}

#[test]
fn no_command_is_a_usage_error() {
    let output = grassfire(&[]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        stderr(&output).ends_with(
            "error: no command was given\nhint: grassfire reconstruct part.stl -o out\n"
        )
    );
}

#[test]
fn usage_errors_are_two_lines() {
    insta::assert_snapshot!(refused(&["reconstruct"]), @r"
    error: the following required arguments were not provided: <PART>
    hint: usage: grassfire reconstruct --output <DIR> <PART>
    ");
    insta::assert_snapshot!(refused(&["reconstruct", "part.stl", "--voxle", "1"]), @r"
    error: unexpected argument '--voxle' found
    hint: a similar argument exists: '--voxel'
    ");
    insta::assert_snapshot!(refused(&["reconstruct", "part.stl", "--voxel", "-1"]), @r"
    error: invalid value '-1' for '--voxel <MM>': must be above 0
    hint: `grassfire --help` shows the usage
    ");
    insta::assert_snapshot!(refused(&["reconstruct", "part.stl", "-q", "-v"]), @r"
    error: the argument '--quiet' cannot be used with '--verbose'
    hint: usage: grassfire reconstruct --output <DIR> --quiet <PART>
    ");
    insta::assert_snapshot!(refused(&["reconstrct", "part.stl"]), @r"
    error: unrecognized subcommand 'reconstrct'
    hint: a similar subcommand exists: 'reconstruct'
    ");
}

#[test]
fn unknown_setting_names_the_nearest() {
    insta::assert_snapshot!(refused(&["reconstruct", "part.stl", "--set", "remesh.voxle=1"]), @r"
    error: --set remesh.voxle: there is no such option
    hint: did you mean remesh.voxel?
    ");
    insta::assert_snapshot!(refused(&["reconstruct", "part.stl", "--set", "min_tunel=0"]), @r"
    error: --set min_tunel: there is no such option
    hint: did you mean remesh.min_tunnel?
    ");
    insta::assert_snapshot!(refused(&["reconstruct", "part.stl", "--set", "remesh.voxel"]), @r"
    error: --set remesh.voxel: expected KEY=VALUE
    hint: for example --set remesh.min_tunnel=0
    ");
    let text = refused(&["reconstruct", "part.stl", "--set", "remesh.voxel=thick"]);
    assert!(
        text.starts_with("error: --set remesh.voxel=thick: invalid type"),
        "{text}"
    );
}

#[test]
fn missing_and_empty_files_are_refused_in_one_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let missing = folder.path().join("missing.stl").display().to_string();
    let empty = file(folder.path(), "empty.stl", b"");
    for part in [missing, empty] {
        let text = refused(&["reconstruct", &part]);
        assert!(text.starts_with("error: "), "{text}");
        assert!(text.contains(&part), "{text}");
        assert!(
            text.lines()
                .all(|line| line.starts_with("error: ") || line.starts_with("hint: ")),
            "{text}"
        );
    }
}

#[test]
fn schema_is_json_with_the_agreed_keys() {
    let output = grassfire(&["schema"]);
    let schema: serde_json::Value = serde_json::from_str(&stdout(&output)).expect("valid JSON");
    for key in ["threads", "remesh", "skeleton", "report"] {
        assert!(schema["properties"].get(key).is_some(), "{key}");
    }
}

#[test]
fn about_cites() {
    let text = stdout(&grassfire(&["about", "--cite"]));
    assert!(text.contains("10.1017/pds.2023.302") && text.contains("Voxel cores"));
    assert!(!stdout(&grassfire(&["about"])).contains("doi.org"));
}

#[test]
fn completions_and_manual() {
    for shell in ["bash", "zsh", "fish"] {
        assert!(
            stdout(&grassfire(&["completions", shell])).contains("reconstruct"),
            "{shell}"
        );
    }
    assert!(stdout(&grassfire(&["man"])).starts_with(".ie"));
}

#[test]
fn output_has_no_colour_codes_when_piped() {
    let output = Command::new(env!("CARGO_BIN_EXE_grassfire"))
        .args(["reconstruct", "no such file.stl", "-o", "nowhere"])
        .env("NO_COLOR", "1")
        .output()
        .expect("the program starts");
    assert!(!stderr(&output).contains('\u{1b}'));
}
