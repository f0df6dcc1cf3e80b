//! The loader, the instance, and the choice of a device.
#![allow(unsafe_code)]

use super::debug::{Messages, Messenger, messenger_info};
use crate::error::{Check, Error, Result};
use ash::{ext, khr, vk};
use std::ffi::{CStr, c_char};
use std::sync::Arc;

const VALIDATION: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Everything a window may need, if the loader knows it: no window has to exist when the context is made.
const WINDOW_EXTENSIONS: [&CStr; 7] = [
    khr::surface::NAME,
    khr::xlib_surface::NAME,
    khr::xcb_surface::NAME,
    khr::wayland_surface::NAME,
    khr::win32_surface::NAME,
    khr::android_surface::NAME,
    ext::metal_surface::NAME,
];

/// Which device to take.
pub(crate) enum Wish<'a> {
    Fastest,
    Software,
    Index(usize),
    Name(&'a str),
}

pub(crate) struct Instance {
    pub(super) entry: ash::Entry,
    pub(super) raw: ash::Instance,
    pub(super) surface: Option<khr::surface::Instance>,
    messenger: Option<Messenger>,
    // After the messenger, which points into it; boxed, so that it stays where it is.
    messages: Box<Messages>,
}

/// A device that could be used.
pub(super) struct Candidate {
    pub(super) raw: vk::PhysicalDevice,
    pub(super) name: String,
    pub(super) properties: vk::PhysicalDeviceProperties,
    pub(super) queue_family: u32,
}

impl Instance {
    pub(crate) fn new(validation: bool) -> Result<Arc<Self>> {
        // SAFETY: loading the system's Vulkan loader runs its initialisers, which is what they are for.
        let entry = unsafe { ash::Entry::load() }
            .map_err(|error| Error::NoDriver { reason: error.to_string() })?;
        // SAFETY: the entry is loaded.
        let version = unsafe { entry.try_enumerate_instance_version() }
            .check("vkEnumerateInstanceVersion")?
            .unwrap_or(vk::API_VERSION_1_0);
        if version < vk::API_VERSION_1_1 {
            return Err(Error::NoDriver { reason: "the loader only knows Vulkan 1.0".into() });
        }
        let validation = validation && has_validation(&entry)?;
        // SAFETY: the entry is loaded.
        let known = unsafe { entry.enumerate_instance_extension_properties(None) }
            .check("vkEnumerateInstanceExtensionProperties")?;
        let mut extensions: Vec<&CStr> =
            WINDOW_EXTENSIONS.into_iter().filter(|name| names(&known, name)).collect();
        let mut flags = vk::InstanceCreateFlags::empty();
        if names(&known, khr::portability_enumeration::NAME) {
            // Layered drivers, such as the one on macOS, hide otherwise.
            extensions.push(khr::portability_enumeration::NAME);
            flags |= vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR;
        }
        let mut layers: Vec<*const c_char> = Vec::new();
        if validation {
            layers.push(VALIDATION.as_ptr());
            extensions.push(ext::debug_utils::NAME);
        }
        let synchronisation = validation && layer_knows(&entry, ext::validation_features::NAME)?;
        if synchronisation {
            extensions.push(ext::validation_features::NAME);
        }
        let pointers: Vec<*const c_char> = extensions.iter().map(|name| name.as_ptr()).collect();
        let application = vk::ApplicationInfo::default()
            .application_name(c"vk-render")
            .engine_name(c"vk-render")
            .api_version(vk::API_VERSION_1_1);
        let messages = Box::new(Messages::default());
        let mut messenger_info = messenger_info(&messages);
        let checks = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features =
            vk::ValidationFeaturesEXT::default().enabled_validation_features(&checks);
        let mut info = vk::InstanceCreateInfo::default()
            .flags(flags)
            .application_info(&application)
            .enabled_layer_names(&layers)
            .enabled_extension_names(&pointers);
        if validation {
            info = info.push_next(&mut messenger_info);
        }
        if synchronisation {
            info = info.push_next(&mut features);
        }
        // SAFETY: layers and extensions were found above; all that `info` points to lives past the call.
        let raw = unsafe { entry.create_instance(&info, None) }.map_err(|result| match result {
            vk::Result::ERROR_INCOMPATIBLE_DRIVER => {
                Error::NoDriver { reason: "the loader found no driver".into() }
            }
            other => match Err::<(), _>(other).check("vkCreateInstance") {
                Err(error) => error,
                Ok(()) => Error::NoDriver { reason: other.to_string() },
            },
        })?;
        let surface = extensions
            .contains(&khr::surface::NAME)
            .then(|| khr::surface::Instance::new(&entry, &raw));
        // From here on the instance is cleaned up by its drop.
        let mut instance = Self { entry, raw, surface, messenger: None, messages };
        if validation {
            instance.messenger = Some(
                Messenger::new(&instance.entry, &instance.raw, &instance.messages)
                    .check("vkCreateDebugUtilsMessengerEXT")?,
            );
        }
        Ok(Arc::new(instance))
    }

    pub(crate) fn validates(&self) -> bool {
        self.messenger.is_some()
    }

    pub(crate) fn messages(&self) -> Vec<String> {
        self.messages.all()
    }

    /// The devices that can draw, in the loader's order.
    fn candidates(&self) -> Result<Vec<Candidate>> {
        // SAFETY: the instance is alive.
        let devices =
            unsafe { self.raw.enumerate_physical_devices() }.check("vkEnumeratePhysicalDevices")?;
        let mut candidates = Vec::new();
        for raw in devices {
            // SAFETY: the device comes from this instance.
            let properties = unsafe { self.raw.get_physical_device_properties(raw) };
            // SAFETY: as above.
            let families = unsafe { self.raw.get_physical_device_queue_family_properties(raw) };
            let draws = |family: &vk::QueueFamilyProperties| {
                family.queue_count > 0 && family.queue_flags.contains(vk::QueueFlags::GRAPHICS)
            };
            let family = families.iter().position(draws);
            let (Some(family), true) = (family, properties.api_version >= vk::API_VERSION_1_1)
            else {
                continue;
            };
            candidates.push(Candidate {
                raw,
                name: text(&properties.device_name),
                properties,
                queue_family: family as u32,
            });
        }
        Ok(candidates)
    }

    pub(super) fn choose(&self, wish: &Wish<'_>) -> Result<Candidate> {
        let mut candidates = self.candidates()?;
        let names: Vec<String> = candidates.iter().map(|c| c.name.clone()).collect();
        let speed = |c: &Candidate| match c.properties.device_type {
            vk::PhysicalDeviceType::DISCRETE_GPU => 0,
            vk::PhysicalDeviceType::INTEGRATED_GPU => 1,
            vk::PhysicalDeviceType::VIRTUAL_GPU => 2,
            vk::PhysicalDeviceType::CPU => 3,
            _ => 4,
        };
        let (found, asked) = match wish {
            Wish::Fastest => {
                let found = (0..candidates.len()).min_by_key(|&i| speed(&candidates[i]));
                (found, "Vulkan 1.1".to_owned())
            }
            Wish::Software => {
                (candidates.iter().position(|c| speed(c) == 3), "\"software\"".into())
            }
            Wish::Index(index) => {
                ((*index < candidates.len()).then_some(*index), format!("index {index}"))
            }
            Wish::Name(part) => {
                let low = part.to_lowercase();
                let found = names.iter().position(|name| name.to_lowercase().contains(&low));
                (found, format!("the name \"{part}\""))
            }
        };
        match found {
            Some(index) => Ok(candidates.swap_remove(index)),
            None if candidates.is_empty() => {
                Err(Error::NoDriver { reason: "no device speaks Vulkan 1.1".into() })
            }
            None => Err(Error::DeviceNotFound { asked, available: names }),
        }
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        if let Some(messenger) = &self.messenger {
            messenger.destroy();
        }
        // SAFETY: every device and surface holds an `Arc` of the instance, so none is left.
        unsafe { self.raw.destroy_instance(None) };
    }
}

fn has_validation(entry: &ash::Entry) -> Result<bool> {
    // SAFETY: the entry is loaded.
    let layers = unsafe { entry.enumerate_instance_layer_properties() }
        .check("vkEnumerateInstanceLayerProperties")?;
    Ok(layers.iter().any(|layer| layer.layer_name_as_c_str() == Ok(VALIDATION)))
}

fn layer_knows(entry: &ash::Entry, extension: &CStr) -> Result<bool> {
    // SAFETY: the entry is loaded, and the layer is present.
    let known = unsafe { entry.enumerate_instance_extension_properties(Some(VALIDATION)) }
        .check("vkEnumerateInstanceExtensionProperties")?;
    Ok(names(&known, extension))
}

pub(super) fn names(known: &[vk::ExtensionProperties], name: &CStr) -> bool {
    known.iter().any(|extension| extension.extension_name_as_c_str() == Ok(name))
}

fn text(chars: &[c_char]) -> String {
    let bytes: Vec<u8> = chars.iter().take_while(|&&c| c != 0).map(|&c| c as u8).collect();
    String::from_utf8_lossy(&bytes).into_owned()
}
