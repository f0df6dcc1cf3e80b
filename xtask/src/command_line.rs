//! Arguments and their dispatch; each command lives in a file of its own.

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::{Error, generate};

/// Builds, tests, demonstrates and judges the whole project.
#[derive(Debug, Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask", version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Generate a deterministic test mesh of any size in constant memory.
    Gen(generate::Arguments),
}

/// Runs the command that the process was started with.
///
/// Exits with 0 when done, 1 after one `error:` line, 2 on wrong usage.
pub fn main() -> ExitCode {
    match run(Arguments::parse().command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(command: Command) -> Result<(), Error> {
    match command {
        Command::Gen(arguments) => generate::run(&arguments),
    }
}
