//! Which limits a device is asked for.

/// WebGL2's limits, raised to the adapter's where passes make use of more.
pub(crate) fn wanted(offered: &wgpu::Limits) -> wgpu::Limits {
    let least = wgpu::Limits::downlevel_webgl2_defaults();
    wgpu::Limits {
        max_texture_array_layers: offered.max_texture_array_layers.max(least.max_texture_array_layers),
        max_buffer_size: offered.max_buffer_size.max(least.max_buffer_size),
        max_storage_buffers_per_shader_stage: offered.max_storage_buffers_per_shader_stage,
        max_storage_buffer_binding_size: offered.max_storage_buffer_binding_size,
        min_storage_buffer_offset_alignment: offered.min_storage_buffer_offset_alignment,
        max_uniform_buffers_per_shader_stage: offered.max_uniform_buffers_per_shader_stage.min(12),
        max_buffers_and_acceleration_structures_per_shader_stage: offered
            .max_buffers_and_acceleration_structures_per_shader_stage,
        ..least
    }
    .using_resolution(offered.clone())
}

/// Which of the required limits the adapter does not offer; `None` if it offers all.
pub(crate) fn missing(required: &wgpu::Limits, offered: &wgpu::Limits) -> Option<String> {
    let mut missing = Vec::new();
    required.check_limits_with_fail_fn(offered, false, |name, needed, found| {
        missing.push(format!("{name} is {found}, {needed} needed"));
    });
    (!missing.is_empty()).then(|| missing.join("; "))
}
