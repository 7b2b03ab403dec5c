//! Writes a glTF 2.0 document and its buffer as one GLB: the ground that every built-in scene stands on.

mod binary;
mod mesh;
mod spec;
mod surface;

use std::collections::BTreeMap;

use glam::{Quat, Vec3};
use gltf_json as json;
use json::accessor::Type;
use json::extensions::scene::khr_lights_punctual as punctual;
use json::validation::Checked::Valid;
use json::validation::USize64;
use serde_json::value::RawValue;

use super::BuiltinError;
use super::shapes::Geometry;
use binary::{Bounds, flat3, pad};
pub use spec::{Emitter, Influences, LightSpec, MaterialSpec, NodeSpec, Track, rotation_y};

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

    fn use_extension(&mut self, name: &str) {
        if !self.root.extensions_used.iter().any(|e| e == name) {
            self.root.extensions_used.push(name.into());
        }
    }
}

fn node_extras(spec: &NodeSpec) -> json::Extras {
    let mut fields: Vec<String> = Vec::new();
    for (key, flag) in [("casts", spec.casts), ("receives", spec.receives)] {
        if !flag {
            fields.push(format!("\"{key}\":false"));
        }
    }
    if let Some(emitter) = spec.emitter {
        fields.push(format!("\"light\":\"{}\"", emitter.name()));
    }
    match fields.is_empty() {
        true => None,
        false => RawValue::from_string(format!("{{{}}}", fields.join(","))).ok(),
    }
}

fn id<T>(index: json::Index<T>) -> u32 {
    index.value() as u32
}
