//! The command line from outside: help, usage errors, bad inputs, exit codes.

use std::path::Path;
use std::process::{Command, Output};

fn grassfire(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_grassfire")).args(args).output().expect("the program starts")
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
    insta::assert_snapshot!(stdout(&output), @"");
}

#[test]
fn reconstruct_help_is_complete() {
    insta::assert_snapshot!(stdout(&grassfire(&["reconstruct", "-h"])), @"");
}

#[test]
fn no_command_is_a_usage_error() {
    let output = grassfire(&[]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).ends_with("error: no command was given\nhint: grassfire reconstruct part.stl -o out\n"));
}

#[test]
fn usage_errors_are_two_lines() {
    insta::assert_snapshot!(refused(&["reconstruct"]), @"");
    insta::assert_snapshot!(refused(&["reconstruct", "part.stl", "--voxle", "1"]), @"");
    insta::assert_snapshot!(refused(&["reconstruct", "part.stl", "--voxel", "-1"]), @"");
    insta::assert_snapshot!(refused(&["reconstruct", "part.stl", "-q", "-v"]), @"");
    insta::assert_snapshot!(refused(&["reconstrct", "part.stl"]), @"");
}

#[test]
fn unknown_setting_names_the_nearest() {
    insta::assert_snapshot!(refused(&["reconstruct", "part.stl", "--set", "remesh.voxle=1"]), @"");
    insta::assert_snapshot!(refused(&["reconstruct", "part.stl", "--set", "min_tunel=0"]), @"");
    insta::assert_snapshot!(refused(&["reconstruct", "part.stl", "--set", "remesh.voxel"]), @"");
    let text = refused(&["reconstruct", "part.stl", "--set", "remesh.voxel=thick"]);
    assert!(text.starts_with("error: --set remesh.voxel=thick: invalid type"), "{text}");
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
        assert!(text.lines().all(|line| line.starts_with("error: ") || line.starts_with("hint: ")), "{text}");
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
        assert!(stdout(&grassfire(&["completions", shell])).contains("reconstruct"), "{shell}");
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
