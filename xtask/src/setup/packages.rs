//! The operating system's package manager, whichever there is.

use std::process::Command;

use crate::{Error, process};

/// Names of the same packages in each manager's words.
#[derive(Debug, Clone, Copy)]
pub struct Names {
    /// Debian, Ubuntu.
    pub apt: &'static [&'static str],
    /// Fedora, RHEL.
    pub dnf: &'static [&'static str],
    /// Arch.
    pub pacman: &'static [&'static str],
    /// openSUSE.
    pub zypper: &'static [&'static str],
    /// macOS.
    pub brew: &'static [&'static str],
}

/// A package manager: its program, its arguments for an update and for an installation.
struct Manager {
    program: &'static str,
    update: &'static [&'static str],
    install: &'static [&'static str],
    needs_root: bool,
    names: fn(&Names) -> &'static [&'static str],
}

const MANAGERS: [Manager; 5] = [
    Manager {
        program: "apt-get",
        update: &["update", "-q"],
        install: &["install", "-y", "-q", "--no-install-recommends"],
        needs_root: true,
        names: |names| names.apt,
    },
    Manager {
        program: "dnf",
        update: &["makecache", "-q"],
        install: &["install", "-y", "-q"],
        needs_root: true,
        names: |names| names.dnf,
    },
    Manager {
        program: "pacman",
        update: &["-Sy", "--noconfirm"],
        install: &["-S", "--noconfirm", "--needed"],
        needs_root: true,
        names: |names| names.pacman,
    },
    Manager {
        program: "zypper",
        update: &["--non-interactive", "refresh"],
        install: &["--non-interactive", "install"],
        needs_root: true,
        names: |names| names.zypper,
    },
    Manager {
        program: "brew",
        update: &["update", "--quiet"],
        install: &["install", "--quiet"],
        needs_root: false,
        names: |names| names.brew,
    },
];

/// Installs packages.
///
/// # Errors
/// [`Error::Missing`] names `what` and the command to type when it cannot be done without asking.
pub fn install(what: &str, names: &Names) -> Result<(), Error> {
    let Some(manager) = MANAGERS.iter().find(|m| process::find_program(m.program).is_some()) else {
        return Err(Error::Missing {
            what: what.to_owned(),
            why: "no package manager that is known here".to_owned(),
            remedy: format!("your system's equivalent of: apt-get install {}", names.apt.join(" ")),
        });
    };
    let packages = (manager.names)(names);
    eprintln!(
        "setup: {what} is missing; installing {} with {}",
        packages.join(" "),
        manager.program
    );
    // Lists may be absent or stale: an installation that fails is tried again after an update.
    let installed = manager.run(manager.install, packages).is_ok()
        || (manager.run(manager.update, &[]).is_ok()
            && manager.run(manager.install, packages).is_ok());
    if installed {
        return Ok(());
    }
    Err(Error::Missing {
        what: what.to_owned(),
        why: format!("{} failed", manager.program),
        remedy: format!(
            "{sudo}{program} {update} && {sudo}{program} {install} {packages}",
            sudo = if manager.needs_root { "sudo " } else { "" },
            program = manager.program,
            update = manager.update.join(" "),
            install = manager.install.join(" "),
            packages = packages.join(" "),
        ),
    })
}

impl Manager {
    fn run(&self, arguments: &[&str], packages: &[&str]) -> Result<(), Error> {
        let mut command = if self.needs_root && !is_root() {
            // Without a password or not at all: there may be no one to ask.
            let mut sudo = Command::new("sudo");
            sudo.args(["-n", "env", "DEBIAN_FRONTEND=noninteractive", self.program]);
            sudo
        } else {
            let mut plain = Command::new(self.program);
            plain.env("DEBIAN_FRONTEND", "noninteractive");
            plain
        };
        // Standard output is for the commands' results.
        command.args(arguments).args(packages).stdout(std::io::stderr());
        process::run(&mut command)
    }
}

fn is_root() -> bool {
    process::capture(Command::new("id").arg("-u"))
        .is_ok_and(|output| output.stdout.trim_ascii() == b"0")
}
