//! The toolchain's formatter and linter.

use crate::{Error, process};
use std::process::Command;

/// Makes sure of `cargo fmt` and `cargo clippy`, which a minimal toolchain lacks.
///
/// # Errors
/// [`Error::Missing`] when one is not there and rustup cannot add it.
pub fn components() -> Result<(), Error> {
    for (subcommand, component) in [("fmt", "rustfmt"), ("clippy", "clippy")] {
        if process::succeeds(process::cargo().args([subcommand, "--version"])) {
            continue;
        }
        eprintln!("setup: cargo {subcommand} is missing; adding the component {component}");
        let mut command = Command::new("rustup");
        command.args(["component", "add", component]).stdout(std::io::stderr());
        process::run(command.current_dir(process::root())).map_err(|error| Error::Missing {
            what: format!("cargo {subcommand}"),
            why: error.to_string(),
            remedy: format!("rustup component add {component}"),
        })?;
    }
    Ok(())
}
