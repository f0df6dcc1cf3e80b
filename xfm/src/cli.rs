//! The command line as a whole: parse it, run the command, turn the outcome into an exit code.

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::commands::{build, decimate, diff, extract, fly, info, verify};
use crate::report::say;
use crate::{Error, interrupt, mapped, one_line};

/// Meshes of any size: decimate; build view-dependent ones, inspect, check, extract, compare, fly
///
/// Messages, progress and reports go to standard error; --json reports go to standard output. Exit codes: 0 done, 1 failed
/// (with one `error:` line), 2 wrong usage, 130 interrupted.
#[derive(Debug, Parser)]
#[command(name = "xfm", version, subcommand_required = true, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Decimate(decimate::DecimateArgs),
    Build(build::BuildArgs),
    Info(info::InfoArgs),
    Verify(verify::VerifyArgs),
    Extract(extract::ExtractArgs),
    Diff(diff::DiffArgs),
    Fly(fly::FlyArgs),
}

/// Runs the command line `args`, whose first element is the program's name.
///
/// Everything it has to say goes to the standard streams; what it returns is the exit code for the process: 0 done,
/// 1 failed, 2 wrong usage, 130 interrupted.
pub fn run(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    let cli = match Cli::try_parse_from(args) {
        Ok(cli) => cli,
        Err(usage) => {
            // Where neither help nor complaint can be written, the exit code still tells.
            return match usage.print() {
                Ok(()) | Err(_) => ExitCode::from(usage.exit_code() as u8),
            };
        }
    };
    interrupt::install();
    mapped::install();
    match dispatch(&cli.command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // Whatever a loop broken off by Ctrl-C complains about, Ctrl-C is the reason.
            let error = match error {
                Error::InterruptedKept { .. } => error,
                _ if interrupt::is_requested() => Error::Interrupted,
                _ => error,
            };
            say(&format!("error: {}", one_line(&error)));
            ExitCode::from(error.exit_code())
        }
    }
}

fn dispatch(command: &Command) -> Result<(), Error> {
    match command {
        Command::Decimate(args) => decimate::run(args),
        Command::Build(args) => build::run(args),
        Command::Info(args) => info::run(args),
        Command::Verify(args) => verify::run(args),
        Command::Extract(args) => extract::run(args),
        Command::Diff(args) => diff::run(args),
        Command::Fly(args) => fly::run(args),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn every_command_has_worked_examples() {
        for command in Cli::command().get_subcommands() {
            let help = command.get_after_help().map(ToString::to_string).unwrap_or_default();
            let example = format!("xfm {} ", command.get_name());
            assert!(help.contains(&example), "`{}` has no example", command.get_name());
        }
    }
}
