//! `grassfire`: the command line.

mod about;
mod args;
mod case;
mod demo;
mod failure;
mod progress;
mod run;
mod settings;
mod summary;

use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{CommandFactory, Parser};
use grassfire::case::Case;
use grassfire::pipeline::ReconstructOptions;

use args::{Cli, Command, SchemaOf};
use failure::Failure;

fn main() -> ExitCode {
    let result = match Cli::try_parse() {
        Ok(cli) => dispatch(&cli.command),
        Err(error) => usage(&error),
    };
    match result {
        Ok(code) => ExitCode::from(code),
        Err(failure) => {
            failure.print();
            ExitCode::from(failure.code)
        }
    }
}

fn dispatch(command: &Command) -> Result<u8, Failure> {
    match command {
        Command::Reconstruct(args) => return run::reconstruct_command(args),
        Command::Solidify(args) => return run::solidify_command(args),
        Command::Mould(args) => return run::mould_command(args),
        Command::Demo(args) => return demo::command(args),
        Command::Optimize(args) => return case::optimize_command(args),
        Command::Run(args) => return case::run_command(args),
        Command::Verify(args) => return case::verify_command(args),
        Command::Check(args) => return case::check_command(args),
        Command::Schema { of } => run::print(&schema(*of)?),
        Command::Materials => run::print(grassfire::case::LIBRARY),
        Command::Faces { file } => run::print(&case::faces(file)?),
        Command::About(args) => run::print(&about::text(args.cite)),
        Command::Completions { shell } => {
            clap_complete::generate(
                *shell,
                &mut Cli::command(),
                "grassfire",
                &mut std::io::stdout().lock(),
            );
        }
        Command::Man => {
            let mut page = Vec::new();
            let written = clap_mangen::Man::new(Cli::command()).render(&mut page);
            written
                .map_err(|e| Failure::usage(format!("cannot make the manual page: {e}"), None))?;
            run::print(&String::from_utf8_lossy(&page));
        }
    }
    Ok(0)
}

fn schema(of: SchemaOf) -> Result<String, Failure> {
    let schema = match of {
        SchemaOf::Reconstruct => schemars::schema_for!(ReconstructOptions),
        SchemaOf::Case => schemars::schema_for!(Case),
    };
    let text = serde_json::to_string_pretty(&schema);
    text.map(|text| text + "\n")
        .map_err(|e| Failure::usage(format!("cannot write the schema: {e}"), None))
}

/// Help and version are answers; everything else that clap refuses is an error in our two lines.
fn usage(error: &clap::Error) -> Result<u8, Failure> {
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
            let _ = error.print();
            Ok(0)
        }
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            let _ = error.print();
            eprintln!();
            Err(Failure::usage(
                "no command was given",
                Some("grassfire reconstruct part.stl -o out".to_owned()),
            ))
        }
        _ => Err(failure::from_clap(error)),
    }
}
