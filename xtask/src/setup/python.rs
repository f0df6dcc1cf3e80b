//! Python environments under the target folder, with pinned packages.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::packages::{self, Names};
use crate::{Error, process};

const PYTHON: Names = Names {
    apt: &["python3", "python3-venv", "python3-pip"],
    dnf: &["python3", "python3-pip"],
    pacman: &["python", "python-pip"],
    zypper: &["python3", "python3-pip"],
    brew: &["python@3.13"],
};

/// What an environment is for and what is in it.
#[derive(Debug, Clone, Copy)]
pub struct Environment {
    /// What it is, in a message.
    what: &'static str,
    /// Its folder in the target folder.
    folder: &'static str,
    /// Pins, beside the programs that need them.
    requirements: &'static str,
    /// The modules that must be there.
    modules: &'static str,
    /// The oldest Python that the pins have wheels for.
    oldest: (u32, u32),
}

/// The judge of conformance.
pub const JUDGE: Environment = Environment {
    what: "the judge's Python environment",
    folder: "venv",
    requirements: "tests/conformance/requirements.txt",
    modules: "numpy, scipy, rtree, trimesh",
    oldest: (3, 9),
};

/// The peers to compare with; one that cannot be loaded misses the comparison.
pub const PEERS: Environment = Environment {
    what: "the peers' Python environment",
    folder: "venv-peers",
    requirements: "tests/compare/requirements.txt",
    modules: "numpy, trimesh",
    oldest: (3, 11),
};

/// A Python interpreter that has an environment's packages.
#[derive(Debug, Clone)]
pub struct Python {
    program: PathBuf,
    /// Where packages were put when there is no virtual environment.
    packages: Option<PathBuf>,
}

impl Python {
    /// The environment under the target folder, made first where it is missing or out of date.
    ///
    /// # Errors
    /// [`Error::Missing`] with the command that would help; [`Error::File`] when the folder cannot
    /// be written.
    pub fn find_or_install(environment: &Environment) -> Result<Self, Error> {
        let requirements = process::root().join(environment.requirements);
        let wanted = fs::read(&requirements).map_err(Error::file(&requirements))?;
        let folder = process::target().join(environment.folder);
        // Written last, so that it tells a whole environment from half of one.
        let stamp = folder.join("installed.txt");
        let virtual_one = Self::virtual_one(&folder);
        let plain_one = Self::plain_one(environment, &folder);
        if fs::read(&stamp).is_ok_and(|installed| installed == wanted) {
            for python in [Some(&virtual_one), plain_one.as_ref()].into_iter().flatten() {
                if python.works(environment) {
                    return Ok(python.clone());
                }
            }
        }
        eprintln!("setup: making {} in {}", environment.what, folder.display());
        if folder.exists() {
            fs::remove_dir_all(&folder).map_err(Error::file(&folder))?;
        }
        fs::create_dir_all(&folder).map_err(Error::file(&folder))?;
        let mut failure = None;
        for attempt in 0..2 {
            match Self::install(environment, &folder) {
                Ok(python) => {
                    fs::write(&stamp, &wanted).map_err(Error::file(&stamp))?;
                    return Ok(python);
                }
                Err(error) if attempt == 0 => {
                    eprintln!("setup: {error}");
                    packages::install("a Python with venv and pip", &PYTHON)?;
                }
                Err(error) => failure = Some(error),
            }
        }
        Err(Error::Missing {
            what: environment.what.into(),
            why: failure.map_or_else(String::new, |error| error.to_string()),
            remedy: format!(
                "python3 -m venv {folder} && {folder}/bin/pip install -r {requirements}",
                folder = folder.display(),
                requirements = environment.requirements
            ),
        })
    }

    /// The interpreter, ready for arguments.
    pub fn command(&self) -> Command {
        let mut command = Command::new(&self.program);
        // The source folder stays clean.
        command.current_dir(process::root()).env("PYTHONDONTWRITEBYTECODE", "1");
        if let Some(packages) = &self.packages {
            command.env("PYTHONPATH", packages);
        }
        command
    }

    fn virtual_one(folder: &Path) -> Self {
        Self { program: folder.join("bin/python"), packages: None }
    }

    fn plain_one(environment: &Environment, folder: &Path) -> Option<Self> {
        let program = system_python(environment.oldest)?;
        Some(Self { program, packages: Some(folder.join("packages")) })
    }

    fn works(&self, environment: &Environment) -> bool {
        process::succeeds(self.command().arg("-c").arg(format!("import {}", environment.modules)))
    }

    /// A virtual environment; where there cannot be one, packages in a folder of their own.
    fn install(environment: &Environment, folder: &Path) -> Result<Self, Error> {
        let (major, minor) = environment.oldest;
        let system = system_python(environment.oldest).ok_or_else(|| Error::Missing {
            what: format!("Python {major}.{minor} or newer"),
            why: "no such python3 on the PATH".into(),
            remedy: "your system's equivalent of: apt-get install python3".into(),
        })?;
        let pip = |python: &Path| {
            let mut command = Command::new(python);
            command.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]);
            command.arg("-r").arg(process::root().join(environment.requirements));
            command.stdout(std::io::stderr());
            command
        };
        let python = Self::virtual_one(folder);
        let made = process::run(
            Command::new(&system)
                .args(["-m", "venv", "--clear"])
                .arg(folder)
                .stdout(std::io::stderr()),
        );
        if made.is_ok() {
            process::run(&mut pip(&python.program))?;
        } else {
            let packages = folder.join("packages");
            process::run(pip(&system).arg("--target").arg(&packages))?;
            return Ok(Self { program: system, packages: Some(packages) });
        }
        if python.works(environment) {
            return Ok(python);
        }
        Err(Error::Missing {
            what: format!("a package of {}", environment.what),
            why: "it was installed but cannot be imported".into(),
            remedy: format!("{} -c 'import {}'", python.program.display(), environment.modules),
        })
    }
}

/// The first Python on the `PATH` that is new enough.
fn system_python((major, minor): (u32, u32)) -> Option<PathBuf> {
    let check = format!("import sys; sys.exit(sys.version_info < ({major}, {minor}))");
    ["python3", "python"]
        .iter()
        .filter_map(|name| process::find_program(name))
        .find(|program| process::succeeds(Command::new(program).args(["-c", &check])))
}
