//! A scene that was not glTF becomes it: what an OBJ file can say, no more.

use anyhow::{Context, Result};
use dapple_scene::glam::{Vec3, Vec4};
use dapple_scene::{AlphaMode, Image, Material, Mesh, Scene, TextureRef};
use serde_json::{Value, json};

use super::accessor::{Attribute, Component};
use super::document::{Document, ELEMENT_ARRAY_BUFFER, List};

const STRENGTH: &str = "KHR_materials_emissive_strength";

/// A scene of still meshes as a GLB.
pub(crate) fn to_glb(scene: &Scene) -> Result<Vec<u8>> {
    let version = env!("CARGO_PKG_VERSION");
    let asset = json!({"asset": {"version": "2.0", "generator": format!("dapple {version}")}, "scene": 0});
    let mut document = Document::open(asset.to_string().as_bytes())?;
    for image in &scene.images {
        let view = document.push_view(&png(image)?, None)?;
        let image = json!({"name": image.name, "mimeType": "image/png", "bufferView": view});
        document.push_value(List::Images, &image)?;
    }
    if !scene.textures.is_empty() {
        document.push_value(List::Samplers, &json!({"magFilter": 9729, "minFilter": 9987}))?;
    }
    for texture in &scene.textures {
        document.push_value(List::Textures, &json!({"sampler": 0, "source": texture.image}))?;
    }
    for material in &scene.materials {
        document.push_value(List::Materials, &material_json(material))?;
    }
    for mesh in &scene.meshes {
        push_mesh(&mut document, mesh)?;
    }
    for instance in &scene.instances {
        let name = &scene.nodes[instance.node as usize].name;
        document.push_value(List::Nodes, &json!({"name": name, "mesh": instance.mesh}))?;
    }
    let nodes: Vec<usize> = (0..document.len(List::Nodes)).collect();
    document.root_mut().set("scenes", &json!([{"name": scene.name, "nodes": nodes}]))?;
    if scene.materials.iter().any(|material| strength(material) > 1.0) {
        document.root_mut().set("extensionsUsed", &[STRENGTH])?;
    }
    Ok(document.to_glb("the converted scene")?.concat())
}

fn material_json(material: &Material) -> Value {
    let mut surface = json!({
        "baseColorFactor": material.base_color_factor.to_array(),
        "metallicFactor": material.metallic_factor,
        "roughnessFactor": material.roughness_factor,
    });
    let texture = |of: &TextureRef| json!({"index": of.texture});
    if let Some(of) = &material.base_color_texture {
        surface["baseColorTexture"] = texture(of);
    }
    let mut object = json!({"name": material.name, "pbrMetallicRoughness": surface});
    if let Some(of) = &material.emissive_texture {
        object["emissiveTexture"] = texture(of);
    }
    let strength = strength(material);
    if material.emissive_factor != Vec3::ZERO {
        object["emissiveFactor"] = json!((material.emissive_factor / strength).to_array());
    }
    if strength > 1.0 {
        object["extensions"] = json!({STRENGTH: {"emissiveStrength": strength}});
    }
    match material.alpha_mode {
        AlphaMode::Opaque => {}
        AlphaMode::Mask { cutoff } => {
            object["alphaMode"] = "MASK".into();
            object["alphaCutoff"] = cutoff.into();
        }
        AlphaMode::Blend => object["alphaMode"] = "BLEND".into(),
    }
    if material.double_sided {
        object["doubleSided"] = true.into();
    }
    object
}

/// What emission exceeds glTF's factor by.
fn strength(material: &Material) -> f32 {
    material.emissive_factor.max_element().max(1.0)
}

fn push_mesh(document: &mut Document, mesh: &Mesh) -> Result<()> {
    let mut attributes = serde_json::Map::new();
    let mut push = |document: &mut Document, name: &str, kind, values: Vec<f32>| -> Result<usize> {
        let bytes = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        let (name, component) = (name.to_owned(), Component::F32);
        let attribute = Attribute { name, kind, component, normalized: false, bytes };
        let accessor = document.push_attribute(&attribute)?;
        attributes.insert(attribute.name, accessor.into());
        Ok(accessor)
    };
    let vectors = |list: &[Vec3]| list.iter().flat_map(|v| v.to_array()).collect::<Vec<f32>>();
    let positions = push(document, "POSITION", "VEC3", vectors(&mesh.positions))?;
    push(document, "NORMAL", "VEC3", vectors(&mesh.normals))?;
    if !mesh.uvs[0].is_empty() {
        push(document, "TEXCOORD_0", "VEC2", mesh.uvs[0].iter().flat_map(|uv| uv.to_array()).collect())?;
    }
    if !mesh.colors.is_empty() {
        // Colours beyond white cannot be said in glTF.
        let color = |c: &Vec4| c.min(Vec4::ONE).to_array();
        push(document, "COLOR_0", "VEC4", mesh.colors.iter().flat_map(color).collect())?;
    }
    let mut accessor = document.object(List::Accessors, positions)?;
    let bounds = |pick: fn(Vec3, Vec3) -> Vec3| {
        mesh.positions.iter().copied().reduce(pick).unwrap_or(Vec3::ZERO).to_array()
    };
    accessor.set("min", &bounds(Vec3::min))?;
    accessor.set("max", &bounds(Vec3::max))?;
    document.put(List::Accessors, positions, &accessor)?;
    let mut primitives = Vec::new();
    for part in &mesh.parts {
        let first = part.first_triangle as usize;
        let corners = mesh.triangles[first..first + part.triangle_count as usize].as_flattened();
        let bytes: Vec<u8> = corners.iter().flat_map(|v| v.to_le_bytes()).collect();
        let view = document.push_view(&bytes, Some(ELEMENT_ARRAY_BUFFER))?;
        let indices = json!({
            "bufferView": view, "componentType": Component::U32.code(), "count": corners.len(), "type": "SCALAR",
        });
        let indices = document.push_value(List::Accessors, &indices)?;
        primitives.push(json!({"attributes": attributes, "indices": indices, "material": part.material}));
    }
    document.push_value(List::Meshes, &json!({"name": mesh.name, "primitives": primitives}))?;
    Ok(())
}

fn png(image: &Image) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    let is_opaque = image.rgba8.iter().all(|texel| texel[3] == 255);
    let (texels, color) = match is_opaque {
        true => (
            image.rgba8.iter().flat_map(|[r, g, b, _]| [*r, *g, *b]).collect(),
            image::ExtendedColorType::Rgb8,
        ),
        false => (image.rgba8.as_flattened().to_vec(), image::ExtendedColorType::Rgba8),
    };
    image::ImageEncoder::write_image(encoder, &texels, image.width, image.height, color)
        .with_context(|| format!("the image {} cannot be encoded", image.name))?;
    Ok(bytes)
}
