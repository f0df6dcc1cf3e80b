//! Vulkan's objects as Rust values: the only place with `unsafe`.
//!
//! Three rules make the rest of the crate safe, and the `SAFETY` comments below lean on them:
//! - *Family.* Every object keeps its [`Device`] alive, every device its instance, and objects of different devices never
//!   meet: a target and a mesh check that they come from one context.
//! - *Alive.* What a submission uses is handed to [`Device::submit`] as a list of `Arc`s, which is let go only when the
//!   device has finished; an owner that keeps an object outside that list waits for its last submission before it
//!   lets go.
//! - *Alone.* What Vulkan wants synchronised from outside (command pools, mapped memory, swapchains) is reached through
//!   `&mut`, the queue through its mutex.

mod buffer;
mod commands;
mod debug;
mod device;
mod image;
mod instance;
mod pipeline;
mod sets;
mod surface;

pub(crate) use buffer::{Buffer, Memory};
pub(crate) use commands::{BufferCopy, CommandBuffer};
pub(crate) use device::{Device, Keep, Serial, Work};
pub(crate) use image::{Framebuffer, GpuImage};
pub(crate) use instance::{Instance, Wish};
pub(crate) use pipeline::{Cut, Pass, Pipelines, Usage};
pub(crate) use sets::{ArraySet, FrameSet, Layouts, MeshSet, TextureSet};
pub(crate) use surface::{Acquired, Surface, Swapchain};
