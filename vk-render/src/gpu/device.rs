//! The device and its one queue: who submitted what, and what is finished.
#![allow(unsafe_code)]

use super::instance::{Instance, Wish, names};
use crate::error::{Check, Error, Result};
use ash::{khr, vk};
use std::any::Any;
use std::collections::VecDeque;
use std::ffi::CStr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Counts submissions; a later one has a higher number. 0 is always finished.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Serial(u64);

/// Something that must live until a submission is finished.
pub(crate) type Keep = Arc<dyn Any + Send + Sync>;

/// What to submit.
#[derive(Default)]
pub(crate) struct Work {
    pub(crate) commands: vk::CommandBuffer,
    /// Waited for before colour is written.
    pub(crate) wait: Option<vk::Semaphore>,
    pub(crate) signal: Option<vk::Semaphore>,
    pub(crate) keep: Vec<Keep>,
}

pub(crate) struct Device {
    pub(super) raw: ash::Device,
    pub(super) physical: vk::PhysicalDevice,
    pub(super) swapchains: Option<khr::swapchain::Device>,
    pub(super) cache: vk::PipelineCache,
    pub(super) memory: vk::PhysicalDeviceMemoryProperties,
    pub(super) queue_family: u32,
    pub(crate) name: String,
    /// Whether it draws on the processor.
    pub(crate) software: bool,
    pub(crate) limits: vk::PhysicalDeviceLimits,
    pub(crate) depth_format: vk::Format,
    /// The highest index a triangle may hold.
    pub(crate) max_index: u32,
    queue: Mutex<Queue>,
    // Last: the device goes before its instance.
    pub(crate) instance: Arc<Instance>,
}

struct Queue {
    raw: vk::Queue,
    submitted: u64,
    finished: u64,
    pending: VecDeque<Pending>,
    idle_fences: Vec<vk::Fence>,
}

struct Pending {
    serial: u64,
    fence: vk::Fence,
    /// Held, not read: dropped when the submission is finished.
    _keep: Vec<Keep>,
}

impl Device {
    pub(crate) fn new(instance: &Arc<Instance>, wish: &Wish<'_>) -> Result<Arc<Self>> {
        let candidate = instance.choose(wish)?;
        let physical = candidate.raw;
        // SAFETY: the physical device comes from this instance, here and below.
        let known = unsafe { instance.raw.enumerate_device_extension_properties(physical) }
            .check("vkEnumerateDeviceExtensionProperties")?;
        // SAFETY: as above.
        let features = unsafe { instance.raw.get_physical_device_features(physical) };
        // SAFETY: as above.
        let memory = unsafe { instance.raw.get_physical_device_memory_properties(physical) };
        let depth_format = depth_format(instance, physical).ok_or(Error::Unsupported {
            device: candidate.name.clone(),
            missing: "depth images",
        })?;

        let wanted = [khr::swapchain::NAME, khr::portability_subset::NAME];
        let mut extensions: Vec<&CStr> =
            wanted.into_iter().filter(|name| names(&known, name)).collect();
        if instance.surface.is_none() {
            extensions.retain(|name| *name != khr::swapchain::NAME);
        }
        let pointers: Vec<_> = extensions.iter().map(|name| name.as_ptr()).collect();
        let wide = features.full_draw_index_uint32 == vk::TRUE;
        let enabled = vk::PhysicalDeviceFeatures::default()
            // A wrong index in a caller's triangle reads something of the buffer, never beyond it.
            .robust_buffer_access(true)
            .full_draw_index_uint32(wide);
        let priorities = [1.0];
        let queues = [vk::DeviceQueueCreateInfo::default()
            .queue_family_index(candidate.queue_family)
            .queue_priorities(&priorities)];
        let info = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&pointers)
            .enabled_features(&enabled);
        // SAFETY: extensions and features were found above (robust access is always there).
        let raw =
            unsafe { instance.raw.create_device(physical, &info, None) }.check("vkCreateDevice")?;
        // SAFETY: the family and its first queue were asked for above.
        let queue = unsafe { raw.get_device_queue(candidate.queue_family, 0) };
        let swapchains = extensions
            .contains(&khr::swapchain::NAME)
            .then(|| khr::swapchain::Device::new(&instance.raw, &raw));
        let limits = candidate.properties.limits;
        let mut device = Self {
            raw,
            physical,
            swapchains,
            cache: vk::PipelineCache::null(),
            memory,
            queue_family: candidate.queue_family,
            name: candidate.name,
            software: candidate.properties.device_type == vk::PhysicalDeviceType::CPU,
            depth_format,
            max_index: if wide { u32::MAX - 1 } else { limits.max_draw_indexed_index_value },
            limits,
            queue: Mutex::new(Queue {
                raw: queue,
                submitted: 0,
                finished: 0,
                pending: VecDeque::new(),
                idle_fences: Vec::new(),
            }),
            instance: Arc::clone(instance),
        };
        let info = vk::PipelineCacheCreateInfo::default();
        // SAFETY: the device is alive; the cache goes in its drop.
        device.cache = unsafe { device.raw.create_pipeline_cache(&info, None) }
            .check("vkCreatePipelineCache")?;
        Ok(Arc::new(device))
    }

    /// As many samples per pixel as asked for, or as the device has.
    pub(crate) fn samples(&self, at_most: u32) -> vk::SampleCountFlags {
        let both = self.limits.framebuffer_color_sample_counts
            & self.limits.framebuffer_depth_sample_counts;
        [vk::SampleCountFlags::TYPE_8, vk::SampleCountFlags::TYPE_4, vk::SampleCountFlags::TYPE_2]
            .into_iter()
            .find(|count| count.as_raw() <= at_most && both.contains(*count))
            .unwrap_or(vk::SampleCountFlags::TYPE_1)
    }

    fn queue(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn submit(&self, work: Work) -> Result<Serial> {
        let mut queue = self.queue();
        self.reap(&mut queue)?;
        let fence = match queue.idle_fences.pop() {
            Some(fence) => fence,
            // SAFETY: the device is alive; the fence goes in its drop at the latest.
            None => unsafe { self.raw.create_fence(&vk::FenceCreateInfo::default(), None) }
                .check("vkCreateFence")?,
        };
        let commands = [work.commands];
        let waits: Vec<vk::Semaphore> = work.wait.into_iter().collect();
        let stages = vec![vk::PipelineStageFlags::COLOR_ATTACHMENT_OUTPUT; waits.len()];
        let signals: Vec<vk::Semaphore> = work.signal.into_iter().collect();
        let info = [vk::SubmitInfo::default()
            .command_buffers(&commands)
            .wait_semaphores(&waits)
            .wait_dst_stage_mask(&stages)
            .signal_semaphores(&signals)];
        // SAFETY: the queue is locked; the fence is unsignalled and unused; what the commands use is kept below (Alive).
        let result = unsafe { self.raw.queue_submit(queue.raw, &info, fence) };
        if let Err(error) = result.check("vkQueueSubmit") {
            queue.idle_fences.push(fence);
            return Err(error);
        }
        queue.submitted += 1;
        let serial = queue.submitted;
        queue.pending.push_back(Pending { serial, fence, _keep: work.keep });
        Ok(Serial(serial))
    }

    /// Presents, which is a use of the queue too. `true` where the swapchain no longer fits its window.
    pub(super) fn present(&self, info: &vk::PresentInfoKHR<'_>) -> ash::prelude::VkResult<bool> {
        let Some(swapchains) = &self.swapchains else {
            return Err(vk::Result::ERROR_EXTENSION_NOT_PRESENT);
        };
        let queue = self.queue();
        // SAFETY: the queue is locked, and the caller holds the swapchain by `&mut`.
        unsafe { swapchains.queue_present(queue.raw, info) }
    }

    /// Waits until a submission and all before it are finished, then lets go of what they kept.
    pub(crate) fn wait(&self, serial: Serial) -> Result<()> {
        let mut queue = self.queue();
        while queue.finished < serial.0 {
            let target = queue.pending.iter().rev().find(|pending| pending.serial <= serial.0);
            let Some(fence) = target.map(|pending| pending.fence) else { break };
            // SAFETY: the fence belongs to this device and to a submission, and is not reset while the queue is locked.
            let result = unsafe { self.raw.wait_for_fences(&[fence], true, u64::MAX) };
            if let Err(error) = result.check("vkWaitForFences") {
                self.give_up(&mut queue);
                return Err(error);
            }
            self.reap(&mut queue)?;
        }
        Ok(())
    }

    /// Whether a submission is finished, without waiting for it.
    pub(crate) fn is_finished(&self, serial: Serial) -> Result<bool> {
        let mut queue = self.queue();
        if queue.finished < serial.0 {
            self.reap(&mut queue)?;
        }
        Ok(queue.finished >= serial.0)
    }

    /// Waits for everything, presentation included.
    pub(crate) fn wait_idle(&self) -> Result<()> {
        let mut queue = self.queue();
        // SAFETY: the queue is locked.
        let result = unsafe { self.raw.queue_wait_idle(queue.raw) };
        if let Err(error) = result.check("vkQueueWaitIdle") {
            self.give_up(&mut queue);
            return Err(error);
        }
        self.reap(&mut queue)
    }

    /// Lets go of what finished submissions kept.
    fn reap(&self, queue: &mut Queue) -> Result<()> {
        while let Some(first) = queue.pending.front() {
            // SAFETY: the fence belongs to this device.
            let result = unsafe { self.raw.get_fence_status(first.fence) };
            match result.check("vkGetFenceStatus") {
                Ok(false) => break,
                Ok(true) => {}
                Err(error) => {
                    self.give_up(queue);
                    return Err(error);
                }
            }
            let Some(pending) = queue.pending.pop_front() else { break };
            queue.finished = pending.serial;
            // SAFETY: the fence is signalled, so no submission uses it any more.
            match unsafe { self.raw.reset_fences(&[pending.fence]) } {
                Ok(()) => queue.idle_fences.push(pending.fence),
                // SAFETY: as above; a fence that cannot be reset is of no more use.
                Err(_) => unsafe { self.raw.destroy_fence(pending.fence, None) },
            }
        }
        Ok(())
    }

    /// After a loss nothing runs any more, so nothing has to be waited for.
    fn give_up(&self, queue: &mut Queue) {
        // SAFETY: the queue is locked; on a lost device this returns at once.
        match unsafe { self.raw.device_wait_idle() } {
            Ok(()) | Err(vk::Result::ERROR_DEVICE_LOST) => {}
            // It may still run: better to keep everything than to take it away.
            Err(_) => return,
        }
        queue.finished = queue.submitted;
        for pending in queue.pending.drain(..) {
            // SAFETY: nothing runs any more, see above.
            unsafe { self.raw.destroy_fence(pending.fence, None) };
        }
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        let queue = self.queue.get_mut().unwrap_or_else(PoisonError::into_inner);
        // What is pending keeps the device alive, so nothing is, save what keeps nothing.
        for fence in queue.idle_fences.drain(..).chain(queue.pending.drain(..).map(|p| p.fence)) {
            // SAFETY: every submitter waits for its submissions before it lets go of the device.
            unsafe { self.raw.destroy_fence(fence, None) };
        }
        // SAFETY: pipelines, the cache's users, hold an `Arc` of the device, so none is left.
        unsafe { self.raw.destroy_pipeline_cache(self.cache, None) };
        // SAFETY: the same holds for every other object of the device.
        unsafe { self.raw.destroy_device(None) };
    }
}

fn depth_format(instance: &Instance, physical: vk::PhysicalDevice) -> Option<vk::Format> {
    // Floating point first: reversed depth gains nothing from integers.
    [vk::Format::D32_SFLOAT, vk::Format::X8_D24_UNORM_PACK32, vk::Format::D16_UNORM]
        .into_iter()
        .find(|&format| {
            // SAFETY: the physical device comes from this instance.
            let properties =
                unsafe { instance.raw.get_physical_device_format_properties(physical, format) };
            properties
                .optimal_tiling_features
                .contains(vk::FormatFeatureFlags::DEPTH_STENCIL_ATTACHMENT)
        })
}
