//! Running other programs, and the places of this workspace.

use std::env;
use std::ffi::OsStr;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::thread;
use std::time::Instant;

use wait4::{ResUse, Wait4};

use crate::Error;

/// The workspace's root folder.
pub fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().unwrap_or(here).to_path_buf()
}

/// The folder that builds go to.
pub fn target() -> PathBuf {
    env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), |dir| root().join(dir))
}

/// The folder of real meshes beside this workspace, which need not be there.
pub fn data() -> PathBuf {
    root().join("../shared/data")
}

/// The cargo that runs this command.
pub fn cargo() -> Command {
    let mut command = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root());
    command
}

/// A program that this workspace built, `xfm` for example.
pub fn built(profile: &str, name: &str) -> PathBuf {
    target().join(profile).join(name).with_extension(env::consts::EXE_EXTENSION)
}

/// The command as one would type it.
pub fn display(command: &Command) -> String {
    let words = std::iter::once(command.get_program()).chain(command.get_args());
    let quote = |word: &OsStr| {
        let word = word.to_string_lossy();
        if word.contains(' ') { format!("'{word}'") } else { word.into_owned() }
    };
    words.map(quote).collect::<Vec<_>>().join(" ")
}

/// Runs a program with this command's own standard streams.
///
/// # Errors
/// When it cannot be started or does not succeed.
pub fn run(command: &mut Command) -> Result<(), Error> {
    eprintln!("$ {}", display(command));
    let status = command.status().map_err(start_error(command))?;
    if status.success() {
        Ok(())
    } else {
        Err(Error::Failed { command: display(command), status: status.to_string() })
    }
}

/// Runs a program and keeps what it writes, whether it succeeds or not.
///
/// # Errors
/// When it cannot be started.
pub fn capture(command: &mut Command) -> Result<Output, Error> {
    command.stdin(Stdio::null()).output().map_err(start_error(command))
}

/// Runs a program and returns its standard output; its standard error is passed on.
///
/// # Errors
/// When it cannot be started or does not succeed.
pub fn read(command: &mut Command) -> Result<String, Error> {
    eprintln!("$ {}", display(command));
    let output = capture(command.stderr(Stdio::inherit()))?;
    if output.status.success() {
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    } else {
        Err(Error::Failed { command: display(command), status: output.status.to_string() })
    }
}

/// What a program wrote and what it took, from its start to its end.
#[derive(Debug, Clone)]
pub struct Measured {
    /// How it ended.
    pub status: ExitStatus,
    /// Its standard output.
    pub stdout: String,
    /// Its standard error.
    pub stderr: String,
    /// Seconds by the clock.
    pub seconds: f64,
    /// Seconds of all processors together.
    pub cpu_seconds: f64,
    /// The most resident memory, in bytes.
    pub peak_rss: u64,
}

/// Runs a program and measures it, whether it succeeds or not.
///
/// # Errors
/// When it cannot be started or what it writes cannot be read.
pub fn measure(command: &mut Command) -> Result<Measured, Error> {
    let what = display(command);
    let broken = |source: io::Error| Error::Report { what: what.clone(), why: source.to_string() };
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let start = Instant::now();
    let mut child = command.spawn().map_err(start_error(command))?;
    let (stdout, stderr) = (child.stdout.take(), child.stderr.take());
    // Both at once: a full pipe would stop the program.
    let errors = thread::spawn(|| stderr.map_or_else(|| Ok(String::new()), io::read_to_string));
    let stdout = stdout.map_or_else(|| Ok(String::new()), io::read_to_string);
    let (status, cpu_seconds, peak_rss) = wait(&mut child).map_err(&broken)?;
    let seconds = start.elapsed().as_secs_f64();
    let stderr = errors.join().unwrap_or_else(|_| Ok(String::new()));
    Ok(Measured {
        status,
        stdout: stdout.map_err(&broken)?,
        stderr: stderr.map_err(&broken)?,
        seconds,
        cpu_seconds,
        peak_rss,
    })
}

/// Waits for a program's end; returns how it ended, its processor seconds and its most resident bytes.
///
/// # Errors
/// When the operating system refuses.
pub fn wait(child: &mut Child) -> io::Result<(ExitStatus, f64, u64)> {
    let ResUse { status, rusage } = child.wait4()?;
    Ok((status, (rusage.utime + rusage.stime).as_secs_f64(), rusage.maxrss))
}

/// Whether a program can be started and succeeds, silently.
pub fn succeeds(command: &mut Command) -> bool {
    capture(command).is_ok_and(|output| output.status.success())
}

/// Where a program lies on the `PATH`.
pub fn find_program(name: &str) -> Option<PathBuf> {
    let path = env::var_os("PATH")?;
    env::split_paths(&path).map(|folder| folder.join(name)).find(|file| file.is_file())
}

/// Reads the JSON that a program printed.
///
/// # Errors
/// [`Error::Report`] when it is not JSON.
pub fn parse_json(what: &str, text: &str) -> Result<serde_json::Value, Error> {
    serde_json::from_str(text)
        .map_err(|error| Error::Report { what: what.to_owned(), why: error.to_string() })
}

/// The error of a program that cannot be started.
pub fn start_error(command: &Command) -> impl FnOnce(io::Error) -> Error {
    let program = command.get_program().to_string_lossy().into_owned();
    move |source| Error::Start { program, source }
}
