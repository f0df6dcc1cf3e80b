//! The way in: an instance, a device and its queue.

use crate::error::Result;
use crate::gpu::{Device, Instance, Layouts, Wish};
use std::sync::Arc;

/// Which device draws.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum DeviceChoice {
    /// A graphics card where there is one, else what there is.
    #[default]
    Fastest,
    /// A driver that draws on the processor: the same picture on every machine.
    Software,
    /// By place in the loader's list of devices that can draw, from 0.
    Index(usize),
    /// The first whose name contains this, whatever the case.
    Name(String),
}

/// How to open a [`Context`].
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ContextOptions {
    /// Asks for the validation layer and collects what it says; without effect where it is not installed. Off unless told.
    pub validation: bool,
    /// Which device draws; the fastest unless told.
    pub device: DeviceChoice,
    /// Samples per pixel for smooth edges, at most: 1, 2, 4 or 8; as many as the device has. 4 unless told.
    pub max_samples: u32,
}

impl Default for ContextOptions {
    fn default() -> Self {
        Self { validation: false, device: DeviceChoice::Fastest, max_samples: 4 }
    }
}

/// A device, ready to draw. Cheap to clone: the clones are one.
///
/// What is made from a context keeps its device alive and may outlive it. Meshes and targets are drawn together only
/// within one context.
#[derive(Clone)]
pub struct Context {
    pub(crate) device: Arc<Device>,
    pub(crate) layouts: Arc<Layouts>,
    pub(crate) max_samples: u32,
}

impl Context {
    /// Finds a driver and opens a device.
    ///
    /// # Errors
    /// [`NoDriver`](crate::Error::NoDriver) where there is none, and how to get one;
    /// [`DeviceNotFound`](crate::Error::DeviceNotFound) where the one asked for is not among them.
    pub fn new(options: &ContextOptions) -> Result<Self> {
        let instance = Instance::new(options.validation)?;
        let wish = match &options.device {
            DeviceChoice::Fastest => Wish::Fastest,
            DeviceChoice::Software => Wish::Software,
            DeviceChoice::Index(index) => Wish::Index(*index),
            DeviceChoice::Name(name) => Wish::Name(name),
        };
        let device = Device::new(&instance, &wish)?;
        let layouts = Layouts::new(&device)?;
        Ok(Self { device, layouts, max_samples: options.max_samples })
    }

    /// The device's name, as its driver tells it.
    pub fn device_name(&self) -> &str {
        &self.device.name
    }

    /// Whether the device draws on the processor. There more than one sample per pixel costs more than twice the time,
    /// which a window that must keep up may want to save: see [`ContextOptions::max_samples`].
    pub fn is_software(&self) -> bool {
        self.device.software
    }

    /// The same device with so many samples per pixel at most, for the targets that are made from here on: 1, 2, 4 or 8.
    #[must_use]
    pub fn with_max_samples(&self, max_samples: u32) -> Self {
        Self { max_samples, ..self.clone() }
    }

    /// The longest side that a [`Texture`](crate::Texture) may have, in pixels.
    pub fn max_texture_side(&self) -> u32 {
        self.device.limits.max_image_dimension2_d
    }

    /// Whether the validation layer was asked for and is there.
    pub fn validates(&self) -> bool {
        self.device.instance.validates()
    }

    /// Every warning and error of the validation layer so far, the first thousand of them.
    pub fn validation_messages(&self) -> Vec<String> {
        self.device.instance.messages()
    }
}

impl std::fmt::Debug for Context {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Context").field("device", &self.device.name).finish_non_exhaustive()
    }
}
