//! Draws a mesh that changes a little every frame, through Vulkan.
