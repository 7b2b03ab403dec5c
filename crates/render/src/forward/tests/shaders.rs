//! Joined modules without a device: valid, laid out like their Rust mirrors, and within WebGL2.

use std::mem::offset_of;

use dapple_gpu::testing::{check_struct, naga::ShaderStage, translate_to_webgl2, validate};

use super::super::hidden::HiddenUniform;
use super::super::lookup::{Lookup, built_in};
use super::super::pipelines::{
    CLEAR_WGSL, DEFORM_WGSL, FRAME_WGSL, MATERIAL_WGSL, MATH_WGSL, caster_module, error_module,
    forward_module, geometry_module, hidden_module, points_module,
};
use super::super::uniforms::*;

/// A look-up that reads everything there is to read.
const GREEDY: &str = "fn lookup_visibility(s: LookupInput) -> f32 {
    return dot(s.position_rest + s.position_world, s.normal_rest + s.normal_world) * s.fade + f32(s.instance) + s.atlas.x;
}";

/// Name and offset of fields.
macro_rules! members {
    ($ty:ty: $($field:ident)*) => {
        [$((stringify!($field), offset_of!($ty, $field))),*]
    };
}

#[test]
fn every_module_is_valid_and_within_webgl2() {
    let mut lookups = built_in();
    lookups.push(Lookup { label: "greedy", wgsl: vec![GREEDY], needs_rest: true, layout: None });
    for lookup in &lookups {
        let module = validate(&forward_module(lookup)).unwrap_or_else(|e| panic!("{}: {e}", lookup.label));
        for (stage, entry) in [
            (ShaderStage::Vertex, "vertex_plain"),
            (ShaderStage::Vertex, "vertex_detailed"),
            (ShaderStage::Fragment, "fragment"),
        ] {
            translate_to_webgl2(&module, stage, entry)
                .unwrap_or_else(|e| panic!("{}, {entry}: {e}", lookup.label));
        }
    }
    let geometry = validate(&geometry_module()).unwrap();
    translate_to_webgl2(&geometry, ShaderStage::Fragment, "fragment").unwrap();
    // Only where samples of depths can be read: not in WebGL2.
    let hidden = validate(&hidden_module()).unwrap();
    let members = members!(HiddenUniform: whole part alpha is_independent seed samples first_sample leaves_first_out
        starts);
    check_struct(&hidden, "HiddenParams", size_of::<HiddenUniform>(), &members).unwrap();
    let clear = validate(CLEAR_WGSL).unwrap();
    translate_to_webgl2(&clear, ShaderStage::Vertex, "clear_vertex").unwrap();
    for (module, vertex, fragment) in [
        (caster_module(), vec!["caster_solid", "caster_masked"], "caster_holes"),
        (points_module(), vec!["point_vertex"], "point_fragment"),
        (error_module(), vec!["error_vertex"], "error_fragment"),
    ] {
        let module = validate(&module).unwrap();
        for entry in vertex {
            translate_to_webgl2(&module, ShaderStage::Vertex, entry).unwrap();
        }
        translate_to_webgl2(&module, ShaderStage::Fragment, fragment).unwrap();
    }
}

#[test]
fn uniforms_are_laid_out_as_in_the_shaders() {
    let module = validate(&forward_module(&built_in()[0])).unwrap();
    let frame = members!(FrameUniform: clip_from_relative eye_world view axis_world is_parallel ambient_sky
        exposure ambient_ground tone_curve fade specular light_count dim point_half point_half_m area_lights);
    check_struct(&module, "Frame", size_of::<FrameUniform>(), &frame).unwrap();
    let light = members!(LightUniform: position_world inverse_range_squared direction_world is_directional intensity
        first_face cone face_count pad);
    check_struct(&module, "Light", size_of::<LightUniform>(), &light).unwrap();
    let face = members!(FaceUniform: view_from_world extent resolution layer origin near far is_perspective pad_a
        pad_b pad_c);
    check_struct(&module, "Face", size_of::<FaceUniform>(), &face).unwrap();
    let lights = members!(LightsUniform: lights faces);
    check_struct(&module, "Lights", size_of::<LightsUniform>(), &lights).unwrap();
    let texture_use = members!(TextureUseUniform: linear offset uv_set pad);
    check_struct(&module, "TextureUse", size_of::<TextureUseUniform>(), &texture_use).unwrap();
    let material = members!(MaterialUniform: base_color emissive metallic roughness normal_scale cutoff flags
        base_color_use metallic_roughness_use normal_use emissive_use);
    check_struct(&module, "Material", size_of::<MaterialUniform>(), &material).unwrap();
    // WebGL2 guarantees 16 KiB in a block.
    const { assert!(size_of::<LightsUniform>() <= 16 << 10) };
}

#[test]
fn constants_are_the_same_on_both_sides() {
    let vertex = include_str!("../wgsl/vertex.wgsl");
    let light = include_str!("../wgsl/light.wgsl");
    let says = |file: &str, line: String| assert!(file.contains(&line), "{line}");
    says(DEFORM_WGSL, format!("const POSE_WIDTH: u32 = {POSE_WIDTH}u;"));
    says(DEFORM_WGSL, format!("const DEFORM_WIDTH: u32 = {DEFORM_WIDTH}u;"));
    says(DEFORM_WGSL, format!("const RIGID: u32 = {RIGID:#x}u;"));
    says(vertex, format!("const PAGE_TABLE_WIDTH: u32 = {PAGE_TABLE_WIDTH}u;"));
    says(vertex, format!("const NO_PAGE: u32 = {NO_PAGE:#x}u;"));
    says(
        vertex,
        format!("const TEXEL_FRACTION: f32 = {:?};", f32::from(dapple_store::charts::TEXEL_FRACTION)),
    );
    says(vertex, format!("const INSTANCE_STORED_TANGENTS: u32 = {INSTANCE_STORED_TANGENTS}u;"));
    says(vertex, format!("const INSTANCE_MIRRORED: u32 = {INSTANCE_MIRRORED}u;"));
    says(vertex, format!("const INSTANCE_REST_MIRRORED: u32 = {INSTANCE_REST_MIRRORED}u;"));
    says(vertex, format!("const INSTANCE_PER_VERTEX: u32 = {INSTANCE_PER_VERTEX}u;"));
    says(vertex, format!("const INSTANCE_BACK_PAGES_SHIFT: u32 = {INSTANCE_BACK_PAGES_SHIFT}u;"));
    says(MATERIAL_WGSL, format!("const MATERIAL_UNLIT: u32 = {MATERIAL_UNLIT}u;"));
    says(MATERIAL_WGSL, format!("const MATERIAL_NORMAL_MAP: u32 = {MATERIAL_NORMAL_MAP}u;"));
    says(FRAME_WGSL, format!("array<Light, {MAX_LIGHTS}>"));
    says(FRAME_WGSL, format!("array<Face, {MAX_FACES}>"));
    let (small, steep) = crate::shade::SHADOW_FILTER;
    says(light, format!("const NORMAL_OFFSET_TEXELS: vec2<f32> = vec2({:?}, {:?});", small.0, small.1));
    says(light, format!("const STEEPEST_TEXELS: f32 = {steep:?};"));
    assert!(MATH_WGSL.contains("fn unit_or"));
}
