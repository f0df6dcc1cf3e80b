//! What can go wrong.

use ash::vk;
use std::ops::Range;

/// Why something could not be drawn.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// There is no Vulkan loader, or no driver behind it.
    #[error(
        "no Vulkan driver was found ({reason}); install your graphics card's driver, or the software driver: \
         mesa-vulkan-drivers and libvulkan1 on Debian and Ubuntu, mesa-vulkan-drivers and vulkan-loader on Fedora, \
         vulkan-swrast and vulkan-icd-loader on Arch, molten-vk and vulkan-loader from Homebrew on macOS"
    )]
    NoDriver {
        /// What the loader said.
        reason: String,
    },
    /// The device asked for is not there.
    #[error("no Vulkan device matches {asked}; there are: {}", available.join(", "))]
    DeviceNotFound {
        /// The choice that failed, in words.
        asked: String,
        /// Names of the devices that could have been chosen.
        available: Vec<String>,
    },
    /// A device lacks something that drawing needs.
    #[error("the Vulkan device {device} lacks {missing}; choose another one or update its driver")]
    Unsupported {
        /// The device's name.
        device: String,
        /// What it lacks.
        missing: &'static str,
    },
    /// The device cannot show pictures in this window.
    #[error(
        "the Vulkan device {device} cannot present to this window; choose another one, for example in software"
    )]
    NotPresentable {
        /// The device's name.
        device: String,
    },
    /// Memory ran out.
    #[error("out of memory for {what} ({bytes} bytes)")]
    OutOfMemory {
        /// What the memory was for.
        what: &'static str,
        /// How much was asked for; 0 where Vulkan did not say.
        bytes: u64,
    },
    /// The device stopped working; everything made from its context is of no further use.
    #[error("the Vulkan device was lost; open a new context")]
    DeviceLost,
    /// The window's surface is gone; the device still works.
    #[error("the window's surface was lost; open a new window target")]
    SurfaceLost,
    /// The window did not give its handles away.
    #[error("the window has no handle to draw into")]
    WindowHandle(#[from] raw_window_handle::HandleError),
    /// A mesh is beyond what the device can address in one buffer.
    #[error("{bytes} bytes of {what} are more than the device's {limit}")]
    MeshTooLarge {
        /// Vertices or triangles.
        what: &'static str,
        /// What they need.
        bytes: u64,
        /// What the device can address.
        limit: u64,
    },
    /// A changed range reaches past the end of the array it belongs to.
    #[error("the changed {what} {}..{} are not within the {len} there are", range.start, range.end)]
    RangePastEnd {
        /// Vertices or triangles.
        what: &'static str,
        /// The range.
        range: Range<u32>,
        /// The array's length.
        len: usize,
    },
    /// Colours are given for some vertices and not for others.
    #[error("{colours} colours for {vertices} vertices; give one for each, or none")]
    ColourCount {
        /// Colours given.
        colours: usize,
        /// Vertices given.
        vertices: usize,
    },
    /// A picture of this size cannot be drawn.
    #[error(
        "a picture of {width} x {height} pixels cannot be drawn; both sides must be 1 to {limit}"
    )]
    PictureSize {
        /// Asked for, in pixels.
        width: u32,
        /// Asked for, in pixels.
        height: u32,
        /// The device's greatest side, in pixels.
        limit: u32,
    },
    /// Any other call that failed.
    #[error("{call} failed: {reason}")]
    Vulkan {
        /// The Vulkan function.
        call: &'static str,
        /// Vulkan's word for it.
        reason: String,
    },
}

/// A result with this crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Gives Vulkan's results the crate's errors.
pub(crate) trait Check<T> {
    /// Names the call that gave the result.
    fn check(self, call: &'static str) -> Result<T>;
}

impl<T> Check<T> for ash::prelude::VkResult<T> {
    fn check(self, call: &'static str) -> Result<T> {
        self.map_err(|result| match result {
            vk::Result::ERROR_DEVICE_LOST => Error::DeviceLost,
            vk::Result::ERROR_SURFACE_LOST_KHR => Error::SurfaceLost,
            vk::Result::ERROR_OUT_OF_HOST_MEMORY
            | vk::Result::ERROR_OUT_OF_DEVICE_MEMORY
            | vk::Result::ERROR_OUT_OF_POOL_MEMORY => Error::OutOfMemory { what: call, bytes: 0 },
            other => Error::Vulkan { call, reason: other.to_string() },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_driver_names_packages() {
        let text = Error::NoDriver { reason: "no loader".into() }.to_string();
        for word in ["mesa-vulkan-drivers", "vulkan-swrast", "molten-vk", "no loader"] {
            assert!(text.contains(word), "{text}");
        }
    }

    #[test]
    fn lost_things_are_told_apart() {
        let lost: Result<()> = Err(vk::Result::ERROR_DEVICE_LOST).check("vkQueueSubmit");
        assert!(matches!(lost, Err(Error::DeviceLost)));
        let gone: Result<()> = Err(vk::Result::ERROR_SURFACE_LOST_KHR).check("vkQueuePresentKHR");
        assert!(matches!(gone, Err(Error::SurfaceLost)));
    }
}
