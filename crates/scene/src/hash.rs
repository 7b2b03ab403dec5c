//! One number for the content of a scene, by which server and client know that they hold the same.

use glam::{Affine2, Affine3A, Vec2, Vec3, Vec4};

use crate::{
    AlphaMode, Animation, ChannelTarget, Filter, Interpolation, LightKind, LocalTransform, Material, Mesh,
    Projection, Scene, SceneHash, Texture, TextureRef, Wrap,
};

/// Changes whenever the serialisation below does.
const FORMAT: &[u8] = b"dapple scene 1";

impl Scene {
    /// The BLAKE3 hash of the scene's content: every number as little-endian bits, every list with its length, in the
    /// order of the fields. Names and warnings do not count.
    pub fn hash(&self) -> SceneHash {
        let mut h = Writer(blake3::Hasher::new());
        h.0.update(FORMAT);
        h.list(&self.nodes, |h, node| {
            h.option(node.parent);
            match node.local {
                LocalTransform::Trs { translation, rotation, scale } => {
                    h.byte(0);
                    h.vec3(translation);
                    h.floats(&rotation.to_array());
                    h.vec3(scale);
                }
                LocalTransform::Matrix(matrix) => {
                    h.byte(1);
                    h.floats(&matrix.to_cols_array());
                }
            }
            h.option(node.camera);
            h.option(node.light);
            h.float_list(&node.morph_weights);
        });
        h.list(&self.meshes, Writer::mesh);
        h.list(&self.instances, |h, instance| {
            h.uint(instance.node);
            h.uint(instance.mesh);
            h.option(instance.skin);
            // Beside flags, so that scenes without shapes of lights and without spares hash as they did before there were any.
            h.byte(u8::from(instance.casts) | (instance.emitter as u8) << 1);
            h.byte(u8::from(instance.receives) | u8::from(instance.spare) << 1);
            h.floats(&instance.rest_from_mesh.to_cols_array());
        });
        h.list(&self.skins, |h, skin| {
            h.list(&skin.joints, |h, joint| h.uint(*joint));
            h.list(&skin.inverse_bind_matrices, |h, matrix| h.affine3(matrix));
        });
        h.list(&self.materials, Writer::material);
        h.list(&self.textures, |h, texture| h.texture(texture));
        h.list(&self.images, |h, image| {
            h.uint(image.width);
            h.uint(image.height);
            h.length(image.rgba8.len());
            h.0.update(bytemuck::cast_slice(&image.rgba8));
        });
        h.list(&self.lights, |h, light| {
            h.vec3(light.color);
            h.float(light.intensity);
            h.float(light.range.unwrap_or(f32::INFINITY));
            match light.kind {
                LightKind::Directional => h.byte(0),
                LightKind::Point => h.byte(1),
                LightKind::Spot { inner_cone_angle, outer_cone_angle } => {
                    h.byte(2);
                    h.floats(&[inner_cone_angle, outer_cone_angle]);
                }
            }
        });
        h.list(&self.cameras, |h, camera| match camera.projection {
            Projection::Perspective { yfov, near } => {
                h.byte(0);
                h.floats(&[yfov, near]);
            }
            Projection::Orthographic { half_height, near, far } => {
                h.byte(1);
                h.floats(&[half_height, near, far]);
            }
        });
        h.list(&self.animations, Writer::animation);
        h.option(self.active_animation);
        SceneHash(*h.0.finalize().as_bytes())
    }
}

struct Writer(blake3::Hasher);

impl Writer {
    fn byte(&mut self, x: u8) {
        self.0.update(&[x]);
    }

    fn uint(&mut self, x: u32) {
        self.0.update(&x.to_le_bytes());
    }

    fn length(&mut self, n: usize) {
        self.0.update(&(n as u64).to_le_bytes());
    }

    fn float(&mut self, x: f32) {
        self.uint(x.to_bits());
    }

    fn floats(&mut self, xs: &[f32]) {
        for x in xs {
            self.float(*x);
        }
    }

    fn float_list(&mut self, xs: &[f32]) {
        self.list(xs, |h, x| h.float(*x));
    }

    fn option(&mut self, x: Option<u32>) {
        self.byte(u8::from(x.is_some()));
        self.uint(x.unwrap_or(0));
    }

    fn vec2(&mut self, v: Vec2) {
        self.floats(&v.to_array());
    }

    fn vec3(&mut self, v: Vec3) {
        self.floats(&v.to_array());
    }

    fn vec4(&mut self, v: Vec4) {
        self.floats(&v.to_array());
    }

    fn affine2(&mut self, a: &Affine2) {
        self.floats(&a.to_cols_array());
    }

    fn affine3(&mut self, a: &Affine3A) {
        self.floats(&a.to_cols_array());
    }

    fn list<T>(&mut self, items: &[T], write: impl Fn(&mut Self, &T)) {
        self.length(items.len());
        for item in items {
            write(self, item);
        }
    }

    fn mesh(&mut self, mesh: &Mesh) {
        self.list(&mesh.positions, |h, v| h.vec3(*v));
        self.list(&mesh.normals, |h, v| h.vec3(*v));
        self.list(&mesh.tangents, |h, v| h.vec4(*v));
        for uvs in &mesh.uvs {
            self.list(uvs, |h, v| h.vec2(*v));
        }
        self.list(&mesh.colors, |h, v| h.vec4(*v));
        self.list(&mesh.influences, |h, set| {
            h.list(&set.joints, |h, joints| joints.iter().for_each(|j| h.uint(u32::from(*j))));
            h.list(&set.weights, |h, weights| h.floats(weights));
        });
        self.list(&mesh.morph_targets, |h, target| {
            h.list(&target.positions, |h, v| h.vec3(*v));
            h.list(&target.normals, |h, v| h.vec3(*v));
        });
        self.float_list(&mesh.morph_weights);
        self.list(&mesh.triangles, |h, triangle| triangle.iter().for_each(|v| h.uint(*v)));
        self.list(&mesh.parts, |h, part| {
            h.uint(part.first_triangle);
            h.uint(part.triangle_count);
            h.uint(part.material);
        });
    }

    fn material(&mut self, material: &Material) {
        self.vec4(material.base_color_factor);
        self.texture_ref(material.base_color_texture.as_ref());
        self.floats(&[material.metallic_factor, material.roughness_factor]);
        self.texture_ref(material.metallic_roughness_texture.as_ref());
        self.texture_ref(material.normal_texture.as_ref().map(|normal| &normal.texture));
        self.float(material.normal_texture.map_or(1.0, |normal| normal.scale));
        self.texture_ref(material.occlusion_texture.as_ref());
        self.vec3(material.emissive_factor);
        self.texture_ref(material.emissive_texture.as_ref());
        match material.alpha_mode {
            AlphaMode::Opaque => self.byte(0),
            AlphaMode::Mask { cutoff } => {
                self.byte(1);
                self.float(cutoff);
            }
            AlphaMode::Blend => self.byte(2),
        }
        self.byte(u8::from(material.double_sided));
        self.byte(u8::from(material.unlit));
    }

    fn texture_ref(&mut self, reference: Option<&TextureRef>) {
        self.option(reference.map(|reference| reference.texture));
        if let Some(reference) = reference {
            self.byte(reference.uv_set);
            self.affine2(&reference.image_from_uv);
        }
    }

    fn texture(&mut self, texture: &Texture) {
        let wrap = |wrap| match wrap {
            Wrap::Repeat => 0,
            Wrap::Mirror => 1,
            Wrap::Clamp => 2,
        };
        self.uint(texture.image);
        self.byte(wrap(texture.wrap_u));
        self.byte(wrap(texture.wrap_v));
        self.byte(match texture.filter {
            Filter::Nearest => 0,
            Filter::Linear => 1,
        });
    }

    fn animation(&mut self, animation: &Animation) {
        self.list(&animation.channels, |h, channel| {
            h.uint(channel.node);
            h.byte(match channel.target {
                ChannelTarget::Translation => 0,
                ChannelTarget::Rotation => 1,
                ChannelTarget::Scale => 2,
                ChannelTarget::MorphWeights => 3,
            });
            h.byte(match channel.interpolation {
                Interpolation::Step => 0,
                Interpolation::Linear => 1,
                Interpolation::CubicSpline => 2,
            });
            h.float_list(&channel.times);
            h.float_list(&channel.values);
        });
    }
}
