//! The candidates: each a list of full-screen passes, the last of them the main pass.

use dapple_gpu::wgpu;
use dapple_render::psao::TableTextures;
use dapple_render::psao::atlas::VisibilityAtlas;
use dapple_render::psao::cells::{self, PointCells};
use dapple_render::psao::hash::{self, PointHash};

use crate::fullscreen::{
    Bindings, FRAGMENTS_WGSL, Fragments, Pass, TARGET_FORMAT, main_wgsl, render_texture, table_bindings,
    texture_entry, view,
};
use crate::view::View;

/// Passes and where each draws to.
pub(crate) struct Candidate {
    pub(crate) name: &'static str,
    steps: Vec<(Pass, wgpu::TextureView)>,
}

impl Candidate {
    fn main(
        name: &'static str,
        frame: &Fragments,
        wgsl: &[&str],
        expression: &str,
        groups: &[Bindings<'_>],
    ) -> Self {
        let main = main_wgsl(expression);
        let files = [&[FRAGMENTS_WGSL], wgsl, &[main.as_str()]].concat();
        let pass = frame.pass(name, &files, "main", groups, TARGET_FORMAT);
        Candidate { name, steps: vec![(pass, view(&frame.target))] }
    }

    pub(crate) fn record(&self, frame: &Fragments, encoder: &mut wgpu::CommandEncoder) {
        for (pass, target) in &self.steps {
            frame.record(encoder, pass, target);
        }
    }

    /// What its main pass shows.
    pub(crate) fn visibility(&self, frame: &Fragments) -> Vec<f32> {
        let mut encoder = frame.gpu.device.create_command_encoder(&Default::default());
        self.record(frame, &mut encoder);
        frame.gpu.queue.submit([encoder.finish()]);
        self.steps.last().map_or_else(Vec::new, |(pass, _)| frame.run(pass))
    }
}

/// The main pass without any look-up.
pub(crate) fn base(frame: &Fragments) -> Candidate {
    Candidate::main("base", frame, &[], "1.0", &[])
}

/// 16 taps, two passes of blur, and one fetch in the main pass.
pub(crate) fn ssao(frame: &Fragments, seen: &View, radius_m: f32) -> Candidate {
    let gpu = &frame.gpu;
    let (depth, normal) = seen.depth_and_normal(gpu);
    let made = || render_texture(gpu, frame.width, frame.height, wgpu::TextureFormat::R8Unorm);
    let (first, second) = (made(), made());
    let [fx, fy] = seen.focal();
    let constants = format!(
        "const FOCAL = vec2f({fx:?}, {fy:?}); const SIZE = vec2f({}.0, {}.0); const RADIUS_M = {radius_m:?};",
        frame.width, frame.height
    );
    let shader = include_str!("ssao.wgsl").replace("    TAPS\n", &taps());
    let files = [FRAGMENTS_WGSL, &constants, &shader];
    let (depth, normal) = (view(&depth), view(&normal));
    let (ao, blurred) = (view(&first), view(&second));
    let format = wgpu::TextureFormat::R8Unorm;
    let steps = vec![
        (frame.pass("ssao", &files, "ssao", &[textures(&[(0, &depth), (1, &normal)])], format), ao.clone()),
        (
            frame.pass("blur x", &files, "blur_x", &[textures(&[(0, &depth), (2, &ao)])], format),
            blurred.clone(),
        ),
        (
            frame.pass("blur y", &files, "blur_y", &[textures(&[(0, &depth), (2, &blurred)])], format),
            ao.clone(),
        ),
    ];
    let fetch = "@group(1) @binding(0) var occlusion: texture_2d<f32>;";
    let mut candidate = Candidate::main(
        "ssao",
        frame,
        &[fetch],
        "textureLoad(occlusion, vec2i(at.xy), 0).x",
        &[textures(&[(0, &ao)])],
    );
    candidate.steps.splice(0..0, steps);
    candidate
}

fn textures<'a>(textures: &[(u32, &'a wgpu::TextureView)]) -> Bindings<'a> {
    let slot = |binding| texture_entry(binding, wgpu::TextureSampleType::Float { filterable: false });
    textures
        .iter()
        .map(|&(binding, v)| (binding, (slot(binding), wgpu::BindingResource::TextureView(v))))
        .collect()
}

/// The calls of 16 taps, written out as shaders have them: a spiral in the hemisphere, dense near the surface.
fn taps() -> String {
    let tap = |i: u32| {
        let turn = i as f32 * 2.399_963;
        let height = (i as f32 + 0.5) / 16.0;
        let across = (1.0 - height * height).sqrt();
        let scale = 0.1 + 0.9 * ((i * 7 % 16) as f32 / 15.0).powi(2);
        let [x, y, z] = [turn.cos() * across, turn.sin() * across, height].map(|v| v * scale);
        format!("    blocked += ssao_tap(vec3f({x:?}, {y:?}, {z:?}), frame, position);\n")
    };
    (0..16).map(tap).collect()
}

/// One bilinear fetch of old and new.
pub(crate) fn atlas(frame: &Fragments, atlas: &VisibilityAtlas) -> Candidate {
    let gpu = &frame.gpu;
    let side = atlas.side();
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("atlas"),
        // One layer more than needed where there is one: WebGL2 would take a single layer for a plain texture.
        size: wgpu::Extent3d { width: side, height: side, depth_or_array_layers: atlas.layers().max(2) },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rg8Unorm,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    for layer in 0..atlas.layers() {
        gpu.queue.write_texture(
            wgpu::TexelCopyTextureInfo {
                texture: &texture,
                mip_level: 0,
                origin: wgpu::Origin3d { x: 0, y: 0, z: layer },
                aspect: wgpu::TextureAspect::All,
            },
            atlas.texels(layer).as_flattened(),
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(side * 2), rows_per_image: None },
            wgpu::Extent3d { width: side, height: side, depth_or_array_layers: 1 },
        );
    }
    let layers = texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..Default::default()
    });
    let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
        mag_filter: wgpu::FilterMode::Linear,
        min_filter: wgpu::FilterMode::Linear,
        ..Default::default()
    });
    let mut texture_slot = texture_entry(0, wgpu::TextureSampleType::Float { filterable: true });
    if let wgpu::BindingType::Texture { view_dimension, .. } = &mut texture_slot.ty {
        *view_dimension = wgpu::TextureViewDimension::D2Array;
    }
    let sampler_slot = wgpu::BindGroupLayoutEntry {
        binding: 1,
        ty: wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering),
        ..texture_slot
    };
    let group = Bindings::from([
        (0, (texture_slot, wgpu::BindingResource::TextureView(&layers))),
        (1, (sampler_slot, wgpu::BindingResource::Sampler(&sampler))),
    ]);
    let wgsl = "
        @group(1) @binding(0) var atlas: texture_2d_array<f32>;
        @group(1) @binding(1) var atlas_sampler: sampler;
        fn atlas_visibility(at: vec4f) -> f32 {
            var values = vec2f(1.0);
            if at.z > -0.5 {
                let side = vec2f(textureDimensions(atlas));
                values = textureSampleLevel(atlas, atlas_sampler, at.xy / side, i32(round(at.z)), 0.0).xy;
            } else if at.z < -1.5 {
                values = at.xy;
            }
            return mix(values.x, values.y, at.w);
        }";
    Candidate::main("atlas", frame, &[wgsl], "atlas_visibility(f.chart)", &[group])
}

/// The paper's hash table.
pub(crate) fn paper(frame: &Fragments, points: &mut PointHash) -> Candidate {
    let tables = points.make_textures(&frame.gpu.device).expect("the tables fit");
    points.upload(&frame.gpu.queue, &tables);
    look_up("paper", frame, &tables, hash::WGSL, "hash_visibility", 0)
}

/// Moving least squares a fragment.
pub(crate) fn direct(frame: &Fragments, points: &mut PointCells) -> Candidate {
    let tables = points.make_textures(&frame.gpu.device).expect("the tables fit");
    points.upload(&frame.gpu.queue, &tables);
    look_up("direct", frame, &tables, cells::WGSL, "cells_visibility", 3)
}

fn look_up(
    name: &'static str,
    frame: &Fragments,
    tables: &TableTextures,
    wgsl: &str,
    function: &str,
    binding: u32,
) -> Candidate {
    let groups = [Bindings::new(), Bindings::new(), table_bindings(tables, binding)];
    let call = format!("{function}(f.instance, f.position_rest, f.normal_rest)");
    Candidate::main(name, frame, &[wgsl], &call, &groups)
}
