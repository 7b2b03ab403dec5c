//! Shaders joined from files: WGSL takes declarations in any order, so joining is all there is.

/// One module of several files. Declarations may be in any order; each name must be declared once.
pub fn join(files: &[&str]) -> String {
    let mut module = String::with_capacity(files.iter().map(|file| file.len() + 1).sum());
    for file in files {
        module.push_str(file);
        module.push('\n');
    }
    module
}

/// Compiles joined WGSL.
pub fn shader_module(device: &wgpu::Device, label: &str, wgsl: &str) -> wgpu::ShaderModule {
    device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(label),
        source: wgpu::ShaderSource::Wgsl(wgsl.into()),
    })
}
