//! What the validation layer says, collected.
#![allow(unsafe_code)]

use ash::{ext, vk};
use std::ffi::{CStr, c_void};
use std::sync::{Mutex, PoisonError};

/// Beyond this many messages, one more says no more than the first ones did.
const MOST: usize = 1000;

#[derive(Default)]
pub(super) struct Messages(Mutex<Vec<String>>);

impl Messages {
    pub(super) fn all(&self) -> Vec<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn add(&self, message: String) {
        let mut messages = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if messages.len() < MOST {
            messages.push(message);
        }
    }
}

/// How to be told. `messages` must stay where it is, alive, for as long as what is made from this.
pub(super) fn messenger_info(messages: &Messages) -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
    // GENERAL is left out: that is the loader's talk about drivers that do not concern us.
    vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(
            vk::DebugUtilsMessageSeverityFlagsEXT::ERROR
                | vk::DebugUtilsMessageSeverityFlagsEXT::WARNING,
        )
        .message_type(
            vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION
                | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE,
        )
        .pfn_user_callback(Some(collect))
        .user_data(std::ptr::from_ref(messages).cast_mut().cast::<c_void>())
}

unsafe extern "system" fn collect(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: `user` is what `messenger_info` gave, a `Messages` that the instance owns and outlives the messenger.
    let messages = unsafe { user.cast::<Messages>().as_ref() };
    // SAFETY: Vulkan passes a valid structure or null for the time of this call.
    let data = unsafe { data.as_ref() };
    if let (Some(messages), Some(data)) = (messages, data)
        && !data.p_message.is_null()
    {
        // SAFETY: the message is a string that ends with a zero byte, by the extension's contract.
        let text = unsafe { CStr::from_ptr(data.p_message) };
        messages.add(text.to_string_lossy().into_owned());
    }
    vk::FALSE
}

/// The registration; gone with the instance.
pub(super) struct Messenger {
    functions: ext::debug_utils::Instance,
    raw: vk::DebugUtilsMessengerEXT,
}

impl Messenger {
    pub(super) fn new(
        entry: &ash::Entry,
        instance: &ash::Instance,
        messages: &Messages,
    ) -> ash::prelude::VkResult<Self> {
        let functions = ext::debug_utils::Instance::new(entry, instance);
        let info = messenger_info(messages);
        // SAFETY: the instance was made with the extension; `info` is whole.
        let raw = unsafe { functions.create_debug_utils_messenger(&info, None) }?;
        Ok(Self { functions, raw })
    }

    /// To be called once, before the instance goes.
    pub(super) fn destroy(&self) {
        // SAFETY: made in `new`, destroyed once, by the instance's drop, before the instance itself.
        unsafe { self.functions.destroy_debug_utils_messenger(self.raw, None) };
    }
}
