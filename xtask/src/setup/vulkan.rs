//! A Vulkan loader, a driver that needs no GPU, and the validation layers.
//!
//! What is there is told from the manifests in the places where loaders look for them; nothing is
//! loaded, so a broken driver shows only when it is used.

use std::env;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use super::packages::{self, Names};
use crate::{Error, process};

const DRIVER: Names = Names {
    apt: &["libvulkan1", "mesa-vulkan-drivers"],
    dnf: &["vulkan-loader", "mesa-vulkan-drivers"],
    pacman: &["vulkan-icd-loader", "vulkan-swrast"],
    zypper: &["libvulkan1", "libvulkan_lvp"],
    brew: &["vulkan-loader", "molten-vk"],
};

const VALIDATION: Names = Names {
    apt: &["vulkan-validationlayers"],
    dnf: &["vulkan-validation-layers"],
    pacman: &["vulkan-validation-layers"],
    zypper: &["vulkan-validationlayers"],
    brew: &["vulkan-validationlayers"],
};

/// Makes sure of a loader and a driver.
///
/// # Errors
/// [`Error::Missing`] when either could not be installed.
pub fn with_driver() -> Result<(), Error> {
    let drivers = manifests("icd.d", &["VK_DRIVER_FILES", "VK_ICD_FILENAMES"]);
    // A driver named by hand is somebody's choice; otherwise one that runs everywhere is wanted.
    let named = env::var_os("VK_DRIVER_FILES").or_else(|| env::var_os("VK_ICD_FILENAMES"));
    let runs_everywhere = drivers.iter().any(|d| {
        ["lvp", "lavapipe", "swiftshader", "MoltenVK"]
            .iter()
            .any(|name| file_name(d).contains(name))
    });
    if has_loader() && (runs_everywhere || (named.is_some() && !drivers.is_empty())) {
        return Ok(());
    }
    match packages::install("a Vulkan loader with a software driver", &DRIVER) {
        Err(error) if has_loader() && !drivers.is_empty() => {
            eprintln!("setup: {error}; going on with the driver in {}", drivers[0].display());
            Ok(())
        }
        other => other,
    }
}

/// Makes sure of a loader, a driver and the validation layers.
///
/// # Errors
/// [`Error::Missing`] when one of them could not be installed.
pub fn with_validation() -> Result<(), Error> {
    with_driver()?;
    let layers = manifests("explicit_layer.d", &["VK_LAYER_PATH", "VK_ADD_LAYER_PATH"]);
    if layers.iter().any(|layer| file_name(layer) == "VkLayer_khronos_validation.json") {
        return Ok(());
    }
    packages::install("the Vulkan validation layers", &VALIDATION)
}

fn file_name(path: &Path) -> &str {
    path.file_name().and_then(OsStr::to_str).unwrap_or_default()
}

/// The manifests in the standard places and in those that environment variables name.
fn manifests(kind: &str, variables: &[&str]) -> Vec<PathBuf> {
    let mut places: Vec<PathBuf> = variables
        .iter()
        .filter_map(env::var_os)
        .flat_map(|value| env::split_paths(&value).collect::<Vec<_>>())
        .collect();
    let mut data_folders: Vec<PathBuf> = [
        "/etc",
        "/usr/local/etc",
        "/usr/local/share",
        "/usr/share",
        "/opt/homebrew/etc",
        "/opt/homebrew/share",
    ]
    .map(PathBuf::from)
    .into();
    data_folders.extend(
        ["XDG_DATA_DIRS", "XDG_CONFIG_DIRS", "XDG_DATA_HOME"]
            .iter()
            .filter_map(env::var_os)
            .flat_map(|value| env::split_paths(&value).collect::<Vec<_>>()),
    );
    if let Some(home) = env::var_os("HOME") {
        data_folders.push(Path::new(&home).join(".local/share"));
    }
    places.extend(data_folders.iter().map(|folder| folder.join("vulkan").join(kind)));
    places.iter().flat_map(|place| json_files(place)).collect()
}

/// A manifest itself, or those in a folder; none where nothing can be read.
fn json_files(place: &Path) -> Vec<PathBuf> {
    if place.is_file() {
        return vec![place.to_path_buf()];
    }
    let Ok(entries) = fs::read_dir(place) else { return Vec::new() };
    let mut files: Vec<PathBuf> = entries
        .filter_map(|entry| entry.ok().map(|e| e.path()))
        .filter(|path| path.extension() == Some(OsStr::new("json")))
        .collect();
    files.sort();
    files
}

fn has_loader() -> bool {
    const NAMES: [&str; 3] = ["libvulkan.so.1", "libvulkan.1.dylib", "libvulkan.dylib"];
    let mut folders: Vec<PathBuf> = ["LD_LIBRARY_PATH", "DYLD_FALLBACK_LIBRARY_PATH"]
        .iter()
        .filter_map(env::var_os)
        .flat_map(|value| env::split_paths(&value).collect::<Vec<_>>())
        .collect();
    let standard =
        ["/usr/lib", "/usr/lib64", "/lib", "/lib64", "/usr/local/lib", "/opt/homebrew/lib"];
    folders.extend(standard.map(PathBuf::from));
    folders.extend(
        ["/usr/lib", "/lib"]
            .map(|base| PathBuf::from(format!("{base}/{}-linux-gnu", env::consts::ARCH))),
    );
    let lies_in = |folder: &PathBuf| NAMES.iter().any(|name| folder.join(name).exists());
    folders.iter().any(lies_in)
        || ["ldconfig", "/sbin/ldconfig"].iter().any(|program| {
            process::capture(Command::new(program).arg("-p"))
                .is_ok_and(|out| String::from_utf8_lossy(&out.stdout).contains(NAMES[0]))
        })
}
