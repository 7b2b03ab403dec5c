//! For tests: a device that may be missing, and checks of shaders without a device.

use std::future::Future;
use std::pin::pin;
use std::task::{Context, Poll, Waker};

use crate::Gpu;
pub use naga;

/// A device, or `None` after saying so. With `REQUIRE_GPU=1` in the environment a missing device is a failure.
///
/// # Panics
/// If a device is required and there is none.
pub fn gpu_for_tests() -> Option<Gpu> {
    match block_on(Gpu::headless()) {
        Ok(gpu) => Some(gpu),
        Err(error) if std::env::var_os("REQUIRE_GPU").is_some_and(|value| value == "1") => {
            panic!("REQUIRE_GPU=1, but {error}")
        }
        Err(error) => {
            eprintln!("skipped: a graphics adapter, because {error}");
            None
        }
    }
}

/// Waits for a future of this crate: native ones are ready when they are polled.
pub fn block_on<T>(future: impl Future<Output = T>) -> T {
    let mut future = pin!(future);
    let mut context = Context::from_waker(Waker::noop());
    loop {
        if let Poll::Ready(value) = future.as_mut().poll(&mut context) {
            return value;
        }
        std::thread::yield_now();
    }
}

/// Parses and validates joined WGSL; the error names the line.
///
/// # Errors
/// The message that a compiler would give.
pub fn validate(wgsl: &str) -> Result<naga::Module, String> {
    let module = naga::front::wgsl::parse_str(wgsl).map_err(|e| e.emit_to_string(wgsl))?;
    let mut validator =
        naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::empty());
    validator.validate(&module).map_err(|e| e.emit_to_string(wgsl))?;
    Ok(module)
}

/// Translates one entry point to the GLSL of WebGL2, with its overrides at their defaults: what WebGL2 cannot do is an
/// error here.
///
/// # Errors
/// What the language lacks.
pub fn translate_to_webgl2(
    module: &naga::Module,
    stage: naga::ShaderStage,
    entry_point: &str,
) -> Result<String, String> {
    let mut validator =
        naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::empty());
    let info = validator.validate(module).map_err(|e| e.to_string())?;
    let constants = naga::back::PipelineConstants::default();
    let entry = Some((stage, entry_point));
    let (module, info) = naga::back::pipeline_constants::process_overrides(module, &info, entry, &constants)
        .map_err(|e| e.to_string())?;
    let options = naga::back::glsl::Options {
        version: naga::back::glsl::Version::Embedded { version: 300, is_webgl: true },
        ..Default::default()
    };
    let pipeline = naga::back::glsl::PipelineOptions {
        shader_stage: stage,
        entry_point: entry_point.into(),
        multiview: None,
    };
    let mut text = String::new();
    let bounds = naga::proc::BoundsCheckPolicies::default();
    naga::back::glsl::Writer::new(&mut text, &module, &info, &options, &pipeline, bounds)
        .and_then(|mut writer| writer.write())
        .map_err(|e| e.to_string())?;
    Ok(text)
}

/// Checks that a structure of a module is laid out like its Rust mirror: the same size, and each named member at the
/// same offset. Get the offsets by `std::mem::offset_of!`.
///
/// # Errors
/// What differs.
pub fn check_struct(
    module: &naga::Module,
    name: &str,
    size: usize,
    members: &[(&str, usize)],
) -> Result<(), String> {
    let found = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(name));
    let Some((_, naga::Type { inner: naga::TypeInner::Struct { members: declared, span }, .. })) = found
    else {
        return Err(format!("the module has no structure {name}"));
    };
    if *span as usize != size {
        return Err(format!("{name} has {span} bytes in WGSL and {size} in Rust"));
    }
    let names: Vec<&str> = declared.iter().filter_map(|m| m.name.as_deref()).collect();
    let mirrored: Vec<&str> = members.iter().map(|m| m.0).collect();
    if names != mirrored {
        return Err(format!("{name} has the members {names:?} in WGSL and {mirrored:?} in Rust"));
    }
    for (member, (name_in_rust, offset)) in declared.iter().zip(members) {
        if member.offset as usize != *offset {
            return Err(format!(
                "{name}.{name_in_rust} lies at {} in WGSL and {offset} in Rust",
                member.offset
            ));
        }
    }
    Ok(())
}
