//! Finds or installs what the other commands need, asks for nothing, and does nothing when all is there.

mod display;
mod packages;
mod python;
mod rust;
mod vulkan;

pub use python::Python;

use crate::Error;

/// Everything that tests and conformance runs need.
///
/// # Errors
/// [`Error::Missing`], with the command that would help, for what could not be installed.
pub fn everything() -> Result<Python, Error> {
    rust::components()?;
    vulkan::with_validation()?;
    display::virtual_display()?;
    Python::find_or_install(&python::JUDGE)
}

/// A Vulkan loader and a driver, for rendering.
///
/// # Errors
/// [`Error::Missing`], with the command that would help.
pub fn rendering() -> Result<(), Error> {
    vulkan::with_driver()
}

/// The judge's Python environment.
///
/// # Errors
/// [`Error::Missing`], with the command that would help.
pub fn python() -> Result<Python, Error> {
    Python::find_or_install(&python::JUDGE)
}

/// The Python environment with the peers that decimation is compared with.
///
/// # Errors
/// [`Error::Missing`], with the command that would help.
pub fn peers() -> Result<Python, Error> {
    Python::find_or_install(&python::PEERS)
}
