//! Writes a glTF 2.0 document and its buffer as one GLB: the ground that every built-in scene stands on.

mod spec;

use std::collections::BTreeMap;
use std::io::Cursor;

use glam::{Mat4, Quat, Vec3};
use gltf_json as json;
use image::ImageEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use json::accessor::{ComponentType, GenericComponentType, Type};
use json::extensions::scene::khr_lights_punctual as punctual;
use json::validation::Checked::Valid;
use json::validation::USize64;
use serde_json::value::RawValue;

use super::BuiltinError;
use super::shapes::Geometry;
pub use spec::{Influences, LightSpec, MaterialSpec, NodeSpec, Track, rotation_y};

/// A material in the document.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MaterialId(u32);

/// A texture in the document.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TextureId(u32);

/// A mesh in the document.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeshId(u32);

/// A node in the document.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NodeId(u32);

/// A camera in the document.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CameraId(u32);

/// A light in the document.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LightId(u32);

/// A skin in the document.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SkinId(u32);

/// An animation in the document.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AnimationId(u32);

/// Collects a glTF document. Nodes, meshes and the like are written in the order of the calls, so equal calls give equal bytes.
#[derive(Debug, Default)]
pub struct GlbBuilder {
    root: json::Root,
    bin: Vec<u8>,
    roots: Vec<json::Index<json::Node>>,
    time_accessors: BTreeMap<Vec<u8>, u32>,
    samplers: BTreeMap<bool, u32>,
}

impl GlbBuilder {
    /// An empty document.
    pub fn new() -> GlbBuilder {
        let mut builder = GlbBuilder::default();
        builder.root.asset.generator = Some("dapple built-in scenes".into());
        builder
    }

    /// Adds an image of `width × height` RGBA texels, rows from the top, embedded as PNG and repeated outside 0 … 1;
    /// `nearest` turns bilinear filtering off.
    ///
    /// # Errors
    /// [`BuiltinError::Png`] if `rgba8` is not `4 × width × height` bytes.
    pub fn texture(
        &mut self,
        name: &str,
        [width, height]: [u32; 2],
        rgba8: &[u8],
        nearest: bool,
    ) -> Result<TextureId, BuiltinError> {
        let mut png = Vec::new();
        if rgba8.len() as u64 != 4 * u64::from(width) * u64::from(height) {
            return Err(BuiltinError::Png {
                name: name.into(),
                reason: format!("{} bytes for {width} × {height} RGBA texels", rgba8.len()),
            });
        }
        PngEncoder::new_with_quality(Cursor::new(&mut png), CompressionType::Default, FilterType::Adaptive)
            .write_image(rgba8, width, height, image::ExtendedColorType::Rgba8)
            .map_err(|e| BuiltinError::Png { name: name.into(), reason: e.to_string() })?;
        let view = self.push_view(&png, None);
        let source = self.root.push(json::Image {
            buffer_view: Some(view),
            mime_type: Some(json::image::MimeType("image/png".into())),
            name: Some(name.into()),
            uri: None,
            extensions: None,
            extras: None,
        });
        let sampler = self.sampler(nearest);
        let texture = self.root.push(json::Texture {
            name: Some(name.into()),
            sampler: Some(sampler),
            source,
            extensions: None,
            extras: None,
        });
        Ok(TextureId(id(texture)))
    }

    /// Adds a material.
    pub fn material(&mut self, name: &str, spec: &MaterialSpec) -> MaterialId {
        let peak = spec.emissive.max_element();
        let strength = (peak > 1.0).then(|| {
            self.use_extension("KHR_materials_emissive_strength");
            json::extensions::material::EmissiveStrength {
                emissive_strength: json::extensions::material::EmissiveStrengthFactor(peak),
            }
        });
        let material = json::Material {
            name: Some(name.into()),
            alpha_mode: Valid(match spec.alpha_cutoff {
                Some(_) => json::material::AlphaMode::Mask,
                None => json::material::AlphaMode::Opaque,
            }),
            alpha_cutoff: spec.alpha_cutoff.map(json::material::AlphaCutoff),
            double_sided: spec.double_sided,
            pbr_metallic_roughness: json::material::PbrMetallicRoughness {
                base_color_factor: json::material::PbrBaseColorFactor(spec.base_color.to_array()),
                base_color_texture: spec.texture.map(|t| json::texture::Info {
                    index: json::Index::new(t.0),
                    tex_coord: 0,
                    extensions: None,
                    extras: None,
                }),
                metallic_factor: json::material::StrengthFactor(spec.metallic),
                roughness_factor: json::material::StrengthFactor(spec.roughness),
                ..Default::default()
            },
            emissive_factor: json::material::EmissiveFactor((spec.emissive / peak.max(1.0)).to_array()),
            extensions: strength.map(|emissive_strength| json::extensions::material::Material {
                emissive_strength: Some(emissive_strength),
                ..Default::default()
            }),
            ..Default::default()
        };
        MaterialId(id(self.root.push(material)))
    }

    /// Adds a rigid mesh: one primitive for each geometry that is not empty. Indices are 16 bits wide where they fit.
    pub fn mesh(&mut self, name: &str, parts: &[(&Geometry, MaterialId)]) -> MeshId {
        self.push_mesh(name, parts.iter().map(|&(g, m)| (g, m, None)))
    }

    /// Adds a mesh of one primitive that a skin deforms; `influences` has one entry a vertex.
    pub fn skinned_mesh(
        &mut self,
        name: &str,
        geometry: &Geometry,
        material: MaterialId,
        influences: Influences<'_>,
    ) -> MeshId {
        self.push_mesh(name, std::iter::once((geometry, material, Some(influences))))
    }

    /// Adds a skin: joint nodes and the matrices that bring mesh space to each joint's space in the bind pose.
    pub fn skin(&mut self, name: &str, joints: &[NodeId], inverse_bind: &[Mat4]) -> SkinId {
        let columns: Vec<f32> = inverse_bind.iter().flat_map(|m| m.to_cols_array()).collect();
        let matrices = self.push_floats(&columns, Type::Mat4, Bounds::No, None);
        let skin = json::Skin {
            inverse_bind_matrices: Some(matrices),
            joints: joints.iter().map(|j| json::Index::new(j.0)).collect(),
            name: Some(name.into()),
            skeleton: None,
            extensions: None,
            extras: None,
        };
        SkinId(id(self.root.push(skin)))
    }

    /// Adds a perspective camera: vertical field of view in radians, near plane in metres, no far plane.
    pub fn camera(&mut self, name: &str, yfov: f32, near: f32) -> CameraId {
        let camera = json::Camera {
            name: Some(name.into()),
            orthographic: None,
            perspective: Some(json::camera::Perspective {
                aspect_ratio: None,
                yfov,
                zfar: None,
                znear: near,
                extensions: None,
                extras: None,
            }),
            type_: Valid(json::camera::Type::Perspective),
            extensions: None,
            extras: None,
        };
        CameraId(id(self.root.push(camera)))
    }

    /// Adds a punctual light.
    pub fn light(&mut self, name: &str, spec: &LightSpec) -> LightId {
        self.use_extension("KHR_lights_punctual");
        let (type_, spot) = match spec.kind {
            crate::LightKind::Directional => (punctual::Type::Directional, None),
            crate::LightKind::Point => (punctual::Type::Point, None),
            crate::LightKind::Spot { inner_cone_angle, outer_cone_angle } => {
                (punctual::Type::Spot, Some(punctual::Spot { inner_cone_angle, outer_cone_angle }))
            }
        };
        let light = punctual::Light {
            color: spec.color.to_array(),
            extensions: None,
            extras: None,
            intensity: spec.intensity,
            name: Some(name.into()),
            range: spec.range,
            spot,
            type_: Valid(type_),
        };
        LightId(id(self.root.push(light)))
    }

    /// Adds a node. Parents must be added before their children.
    pub fn node(&mut self, name: &str, spec: &NodeSpec) -> NodeId {
        let node = json::Node {
            name: Some(name.into()),
            mesh: spec.mesh.map(|m| json::Index::new(m.0)),
            skin: spec.skin.map(|s| json::Index::new(s.0)),
            camera: spec.camera.map(|c| json::Index::new(c.0)),
            translation: (spec.translation != Vec3::ZERO).then(|| spec.translation.to_array()),
            rotation: (spec.rotation != Quat::IDENTITY)
                .then(|| json::scene::UnitQuaternion(spec.rotation.to_array())),
            scale: (spec.scale != Vec3::ONE).then(|| spec.scale.to_array()),
            extensions: spec.light.map(|l| json::extensions::scene::Node {
                khr_lights_punctual: Some(punctual::KhrLightsPunctual { light: json::Index::new(l.0) }),
                ..Default::default()
            }),
            extras: node_extras(spec),
            ..Default::default()
        };
        let index = self.root.push(node);
        match spec.parent {
            Some(parent) => {
                self.root.nodes[parent.0 as usize].children.get_or_insert_with(Vec::new).push(index)
            }
            None => self.roots.push(index),
        }
        NodeId(id(index))
    }

    /// Adds an animation without channels.
    pub fn animation(&mut self, name: &str) -> AnimationId {
        let animation = json::Animation {
            name: Some(name.into()),
            channels: Vec::new(),
            samplers: Vec::new(),
            extensions: None,
            extras: None,
        };
        AnimationId(id(self.root.push(animation)))
    }

    /// Adds a channel: `times` in seconds, strictly increasing, as many as the track has values.
    /// `stepped` holds each value until the next key; otherwise values are interpolated linearly (rotations spherically).
    pub fn channel(
        &mut self,
        animation: AnimationId,
        node: NodeId,
        times: &[f32],
        track: Track<'_>,
        stepped: bool,
    ) {
        let input = self.time_accessor(times);
        let (property, output) = match track {
            Track::Translation(v) => (
                json::animation::Property::Translation,
                self.push_floats(flat3(v), Type::Vec3, Bounds::No, None),
            ),
            Track::Rotation(q) => {
                let xyzw: Vec<f32> = q.iter().flat_map(|q| q.to_array()).collect();
                (json::animation::Property::Rotation, self.push_floats(&xyzw, Type::Vec4, Bounds::No, None))
            }
            Track::Scale(v) => {
                (json::animation::Property::Scale, self.push_floats(flat3(v), Type::Vec3, Bounds::No, None))
            }
        };
        let animation = &mut self.root.animations[animation.0 as usize];
        let sampler = json::Index::push(
            &mut animation.samplers,
            json::animation::Sampler {
                input,
                interpolation: Valid(match stepped {
                    true => json::animation::Interpolation::Step,
                    false => json::animation::Interpolation::Linear,
                }),
                output,
                extensions: None,
                extras: None,
            },
        );
        animation.channels.push(json::animation::Channel {
            sampler,
            target: json::animation::Target {
                node: json::Index::new(node.0),
                path: Valid(property),
                extensions: None,
                extras: None,
            },
            extensions: None,
            extras: None,
        });
    }

    /// The document as one GLB.
    ///
    /// # Errors
    /// [`BuiltinError::Write`] if the document cannot be serialised.
    pub fn finish(mut self) -> Result<Vec<u8>, BuiltinError> {
        let scene = self.root.push(json::Scene {
            name: None,
            nodes: std::mem::take(&mut self.roots),
            extensions: None,
            extras: None,
        });
        self.root.scene = Some(scene);
        pad(&mut self.bin, 0);
        self.root.push(json::Buffer {
            byte_length: USize64::from(self.bin.len()),
            name: None,
            uri: None,
            extensions: None,
            extras: None,
        });
        let mut text = json::serialize::to_vec(&self.root).map_err(|e| BuiltinError::Write(e.to_string()))?;
        pad(&mut text, b' ');
        let total = 12 + 8 + text.len() + 8 + self.bin.len();
        let size = |n: usize| {
            u32::try_from(n)
                .map_err(|_| BuiltinError::Write(format!("{n} bytes do not fit into one GLB (4 GiB)")))
        };
        let mut glb = Vec::with_capacity(total);
        glb.extend_from_slice(b"glTF");
        for word in [2, size(total)?, size(text.len())?] {
            glb.extend_from_slice(&word.to_le_bytes());
        }
        glb.extend_from_slice(b"JSON");
        glb.extend_from_slice(&text);
        glb.extend_from_slice(&size(self.bin.len())?.to_le_bytes());
        glb.extend_from_slice(b"BIN\0");
        glb.extend_from_slice(&self.bin);
        Ok(glb)
    }

    fn push_mesh<'a>(
        &mut self,
        name: &str,
        parts: impl Iterator<Item = (&'a Geometry, MaterialId, Option<Influences<'a>>)>,
    ) -> MeshId {
        let target = Some(json::buffer::Target::ArrayBuffer);
        let mut primitives = Vec::new();
        for (geometry, material, influences) in parts {
            if geometry.triangles.is_empty() {
                continue;
            }
            let mut attributes = BTreeMap::new();
            let positions = self.push_floats(flat3(&geometry.positions), Type::Vec3, Bounds::Yes, target);
            attributes.insert(Valid(json::mesh::Semantic::Positions), positions);
            let normals = self.push_floats(flat3(&geometry.normals), Type::Vec3, Bounds::No, target);
            attributes.insert(Valid(json::mesh::Semantic::Normals), normals);
            let uvs: &[f32] = bytemuck::cast_slice(&geometry.uvs);
            let uvs = self.push_floats(uvs, Type::Vec2, Bounds::No, target);
            attributes.insert(Valid(json::mesh::Semantic::TexCoords(0)), uvs);
            if let Some(Influences { joints, weights }) = influences {
                let bytes: Vec<u8> = joints.iter().flatten().flat_map(|j| j.to_le_bytes()).collect();
                let view = self.push_view(&bytes, target);
                let joints = self.push_accessor(view, joints.len(), ComponentType::U16, Type::Vec4, None);
                attributes.insert(Valid(json::mesh::Semantic::Joints(0)), joints);
                let weights: Vec<f32> = weights.iter().flatten().copied().collect();
                let weights = self.push_floats(&weights, Type::Vec4, Bounds::No, target);
                attributes.insert(Valid(json::mesh::Semantic::Weights(0)), weights);
            }
            let indices = self.push_indices(geometry);
            primitives.push(json::mesh::Primitive {
                attributes,
                extensions: None,
                extras: None,
                indices: Some(indices),
                material: Some(json::Index::new(material.0)),
                mode: Valid(json::mesh::Mode::Triangles),
                targets: None,
            });
        }
        let mesh =
            json::Mesh { name: Some(name.into()), primitives, weights: None, extensions: None, extras: None };
        MeshId(id(self.root.push(mesh)))
    }

    fn push_indices(&mut self, geometry: &Geometry) -> json::Index<json::Accessor> {
        let flat = geometry.triangles.iter().flatten().copied();
        // 65535 itself is a primitive restart, which glTF forbids.
        let (bytes, component): (Vec<u8>, _) = if geometry.positions.len() < 65536 {
            (flat.flat_map(|i| (i as u16).to_le_bytes()).collect(), ComponentType::U16)
        } else {
            (flat.flat_map(|i| i.to_le_bytes()).collect(), ComponentType::U32)
        };
        let view = self.push_view(&bytes, Some(json::buffer::Target::ElementArrayBuffer));
        self.push_accessor(view, 3 * geometry.triangles.len(), component, Type::Scalar, None)
    }

    fn time_accessor(&mut self, times: &[f32]) -> json::Index<json::Accessor> {
        // Channels sampled at the same times share the accessor.
        let key: Vec<u8> = times.iter().flat_map(|t| t.to_le_bytes()).collect();
        if let Some(&accessor) = self.time_accessors.get(&key) {
            return json::Index::new(accessor);
        }
        let accessor = self.push_floats(times, Type::Scalar, Bounds::Yes, None);
        self.time_accessors.insert(key, id(accessor));
        accessor
    }

    fn sampler(&mut self, nearest: bool) -> json::Index<json::texture::Sampler> {
        if let Some(&sampler) = self.samplers.get(&nearest) {
            return json::Index::new(sampler);
        }
        use json::texture::{MagFilter, MinFilter, Sampler};
        let (mag, min) = match nearest {
            true => (MagFilter::Nearest, MinFilter::Nearest),
            false => (MagFilter::Linear, MinFilter::LinearMipmapLinear),
        };
        let sampler =
            Sampler { mag_filter: Some(Valid(mag)), min_filter: Some(Valid(min)), ..Sampler::default() };
        let sampler = self.root.push(sampler);
        self.samplers.insert(nearest, id(sampler));
        sampler
    }

    fn use_extension(&mut self, name: &str) {
        if !self.root.extensions_used.iter().any(|e| e == name) {
            self.root.extensions_used.push(name.into());
        }
    }

    fn push_view(
        &mut self,
        bytes: &[u8],
        target: Option<json::buffer::Target>,
    ) -> json::Index<json::buffer::View> {
        pad(&mut self.bin, 0);
        let byte_offset = self.bin.len();
        self.bin.extend_from_slice(bytes);
        self.root.push(json::buffer::View {
            buffer: json::Index::new(0),
            byte_length: USize64::from(bytes.len()),
            byte_offset: Some(USize64::from(byte_offset)),
            byte_stride: None,
            name: None,
            target: target.map(Valid),
            extensions: None,
            extras: None,
        })
    }

    fn push_floats(
        &mut self,
        values: &[f32],
        type_: Type,
        bounds: Bounds,
        target: Option<json::buffer::Target>,
    ) -> json::Index<json::Accessor> {
        let width = type_.multiplicity();
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let view = self.push_view(&bytes, target);
        let bounds = matches!(bounds, Bounds::Yes).then(|| {
            let fold = |start: f32, pick: fn(f32, f32) -> f32| -> json::Value {
                (0..width)
                    .map(|c| values.iter().skip(c).step_by(width).copied().fold(start, pick))
                    .collect::<Vec<f32>>()
                    .into()
            };
            (fold(f32::INFINITY, f32::min), fold(f32::NEG_INFINITY, f32::max))
        });
        self.push_accessor(view, values.len() / width, ComponentType::F32, type_, bounds)
    }

    fn push_accessor(
        &mut self,
        view: json::Index<json::buffer::View>,
        count: usize,
        component: ComponentType,
        type_: Type,
        bounds: Option<(json::Value, json::Value)>,
    ) -> json::Index<json::Accessor> {
        let (min, max) = bounds.unzip();
        self.root.push(json::Accessor {
            buffer_view: Some(view),
            byte_offset: None,
            count: USize64::from(count),
            component_type: Valid(GenericComponentType(component)),
            type_: Valid(type_),
            min,
            max,
            name: None,
            normalized: false,
            sparse: None,
            extensions: None,
            extras: None,
        })
    }
}

/// Whether an accessor states its smallest and largest values.
#[derive(Clone, Copy)]
enum Bounds {
    Yes,
    No,
}

fn node_extras(spec: &NodeSpec) -> json::Extras {
    let text = match (spec.casts, spec.receives) {
        (true, true) => return None,
        (false, true) => r#"{"casts":false}"#,
        (true, false) => r#"{"receives":false}"#,
        (false, false) => r#"{"casts":false,"receives":false}"#,
    };
    RawValue::from_string(text.into()).ok()
}

fn id<T>(index: json::Index<T>) -> u32 {
    index.value() as u32
}

fn flat3(v: &[Vec3]) -> &[f32] {
    bytemuck::cast_slice(v)
}

fn pad(bytes: &mut Vec<u8>, with: u8) {
    while !bytes.len().is_multiple_of(4) {
        bytes.push(with);
    }
}
