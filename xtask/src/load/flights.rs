//! The flights, and what is done to the file they go over.

use std::fs::{self, File, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread;
use std::time::Duration;

use serde_json::Value;

use super::judge;
use crate::{Error, process};

/// Threads that load, where there are some.
pub const LOADERS: u32 = 2;
/// Frames from one check to the next.
const CHECK_EVERY: u32 = 30;
/// Bits that are turned over in a damaged file.
const FLIPPED: u64 = 40;

/// What becomes of the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    Whole,
    /// Some bits are turned over.
    Damaged,
    /// After a quarter of the flight it loses its second half.
    CutShort,
}

/// One way of flying.
#[derive(Debug, Clone, Copy)]
pub struct Flight {
    pub name: &'static str,
    /// As a share of the time asked for.
    pub part: f64,
    pub loaders: u32,
    pub read_delay_ms: u32,
    /// Frames per second; 0 for as many as there can be: faster than blocks can be loaded, so that views need not settle.
    pub fps: u32,
    pub fate: Fate,
}

/// What came of a flight.
#[derive(Debug, Clone)]
pub struct Flown {
    pub name: &'static str,
    /// What `xfm fly` reported; null where it failed.
    pub report: Value,
    /// What did not hold.
    pub verdict: Option<String>,
}

/// All of them, in turn.
pub fn all() -> [Flight; 5] {
    let usual = Flight {
        name: "loaders",
        part: 1.0,
        loaders: LOADERS,
        read_delay_ms: 2,
        fps: 60,
        fate: Fate::Whole,
    };
    let short = Flight { part: 0.25, ..usual };
    [
        usual,
        Flight { name: "no loaders", loaders: 0, read_delay_ms: 1, ..short },
        Flight { name: "full speed", read_delay_ms: 0, fps: 0, ..short },
        Flight { name: "damaged", fate: Fate::Damaged, ..short },
        Flight { name: "cut short", fate: Fate::CutShort, ..short },
    ]
}

impl Flight {
    /// Flies for this part of the time, and judges.
    pub fn fly(
        &self,
        xfm: &Path,
        model: &Path,
        seconds: f64,
        quota: &str,
        seed: u64,
    ) -> Result<Flown, Error> {
        let seconds = self.part * seconds;
        let file = self.prepare(model)?;
        let mut command = Command::new(xfm);
        command.arg("fly").arg(&file).args(["--jumps", "--json", "--soft-quota", quota]);
        command.args(["--hard-quota", quota, "--seconds", &seconds.to_string()]);
        command.args(["--seed", &seed.to_string(), "--loaders", &self.loaders.to_string()]);
        command.args(["--read-delay", &self.read_delay_ms.to_string()]);
        command.args(["--fps", &self.fps.to_string()]);
        command.arg(format!("--validate={CHECK_EVERY}"));
        eprintln!("$ {}", process::display(&command));
        let cut = (self.fate == Fate::CutShort).then(|| {
            let (file, after) = (file.clone(), Duration::from_secs_f64(seconds / 4.0));
            thread::spawn(move || {
                thread::sleep(after);
                cut_short(&file)
            })
        });
        let output = process::capture(&mut command)?;
        if let Some(Err(error)) = cut.and_then(|cut| cut.join().ok()) {
            return Err(error);
        }
        if file != model {
            fs::remove_file(&file).map_err(Error::file(&file))?;
        }
        let (report, verdict) = if output.status.success() {
            let report = process::parse_json("fly", &String::from_utf8_lossy(&output.stdout))?;
            let verdict = judge::verdict(self, &report);
            (report, verdict)
        } else {
            let told = String::from_utf8_lossy(&output.stderr).trim().to_owned();
            let told = if told.is_empty() { output.status.to_string() } else { told };
            (Value::Null, Some(told))
        };
        Ok(Flown { name: self.name, report, verdict })
    }

    /// The file to fly over: the model, or a copy that may suffer.
    fn prepare(&self, model: &Path) -> Result<PathBuf, Error> {
        if self.fate == Fate::Whole {
            return Ok(model.to_owned());
        }
        let folder = process::target().join("load");
        let copy = folder.join(self.name.replace(' ', "-")).with_extension("xfm");
        fs::copy(model, &copy).map_err(Error::file(&copy))?;
        if self.fate == Fate::Damaged {
            damage(&copy)?;
        }
        Ok(copy)
    }
}

/// Turns bits over, evenly spread over the pages: these are all but the first and the last of a file.
fn damage(path: &Path) -> Result<(), Error> {
    let failed = || Error::file(path);
    let mut file = OpenOptions::new().read(true).write(true).open(path).map_err(failed())?;
    let length = file.metadata().map_err(failed())?.len();
    for index in 0..FLIPPED {
        let place = length / 10 + length * 8 / 10 * index / FLIPPED;
        let mut byte = [0];
        file.seek(SeekFrom::Start(place))
            .and_then(|_| file.read_exact(&mut byte))
            .map_err(failed())?;
        byte[0] ^= 1 << (index % 8);
        file.seek(SeekFrom::Start(place)).and_then(|_| file.write_all(&byte)).map_err(failed())?;
    }
    Ok(())
}

fn cut_short(path: &Path) -> Result<(), Error> {
    let file = File::options().write(true).open(path).map_err(Error::file(path))?;
    let length = file.metadata().map_err(Error::file(path))?.len();
    file.set_len(length / 2).map_err(Error::file(path))
}
