//! What a place on a mesh looks like: texture coordinates and opacity.

use glam::{Vec2, Vec4};

use crate::{AlphaMode, Mesh, Scene, TextureRef};

impl Mesh {
    /// Interpolated texture coordinates of set 0 or 1 (zero where the mesh has none); `barycentrics` are the weights of vertices 1 and 2.
    pub fn uv(&self, set: u8, triangle: u32, barycentrics: [f32; 2]) -> Vec2 {
        match self.uvs.get(usize::from(set)) {
            Some(uvs) if !uvs.is_empty() => {
                let [a, b, c] = self.triangles[triangle as usize].map(|v| uvs[v as usize]);
                a + (b - a) * barycentrics[0] + (c - a) * barycentrics[1]
            }
            _ => Vec2::ZERO,
        }
    }

    /// Interpolated linear vertex colour (white where the mesh has none).
    pub fn color(&self, triangle: u32, barycentrics: [f32; 2]) -> Vec4 {
        if self.colors.is_empty() {
            return Vec4::ONE;
        }
        let [a, b, c] = self.triangles[triangle as usize].map(|v| self.colors[v as usize]);
        a + (b - a) * barycentrics[0] + (c - a) * barycentrics[1]
    }

    /// The material of one triangle.
    pub fn material_of(&self, triangle: u32) -> u32 {
        let part = self.parts.partition_point(|p| p.first_triangle <= triangle).saturating_sub(1);
        self.parts[part].material
    }
}

impl Scene {
    /// A texture's value where a vertex coordinate lies, channels 0 … 1 as stored in the image.
    pub fn sample(&self, texture: &TextureRef, uv: Vec2) -> Vec4 {
        let sampler = &self.textures[texture.texture as usize];
        sampler.sample(&self.images[sampler.image as usize], texture.image_from_uv.transform_point2(uv))
    }

    /// Whether a part of a mesh is seen from both sides.
    pub fn is_two_sided(&self, mesh: &Mesh) -> bool {
        mesh.parts.iter().any(|part| self.materials[part.material as usize].double_sided)
    }

    /// Whether a place on a mesh is cut out by its material's alpha: below the cutoff of a mask, or
    /// below 0.5 of a blended material. Such places neither block rays, nor are drawn, nor carry points.
    pub fn is_hole(&self, mesh: &Mesh, triangle: u32, barycentrics: [f32; 2]) -> bool {
        let material = &self.materials[mesh.material_of(triangle) as usize];
        let cutoff = match material.alpha_mode {
            AlphaMode::Opaque => return false,
            AlphaMode::Mask { cutoff } => cutoff,
            AlphaMode::Blend => 0.5,
        };
        let mut alpha = material.base_color_factor.w * mesh.color(triangle, barycentrics).w;
        if let Some(texture) = &material.base_color_texture {
            alpha *= self.sample(texture, mesh.uv(texture.uv_set, triangle, barycentrics)).w;
        }
        alpha < cutoff
    }

    /// For each instance, whether the active animation moves or bends it.
    pub fn moving_instances(&self) -> Vec<bool> {
        let Some(animation) = self.active_animation.map(|i| &self.animations[i as usize]) else {
            return vec![false; self.instances.len()];
        };
        let mut moves = vec![false; self.nodes.len()];
        let mut bends = vec![false; self.nodes.len()];
        for channel in &animation.channels {
            match channel.target {
                crate::ChannelTarget::MorphWeights => bends[channel.node as usize] = true,
                _ => moves[channel.node as usize] = true,
            }
        }
        // Parents come first, so one pass hands motion down.
        for (index, node) in self.nodes.iter().enumerate() {
            if node.parent.is_some_and(|p| moves[p as usize]) {
                moves[index] = true;
            }
        }
        let instance_moves = |instance: &crate::Instance| match instance.skin {
            Some(skin) => self.skins[skin as usize].joints.iter().any(|&j| moves[j as usize]),
            None => moves[instance.node as usize] || bends[instance.node as usize],
        };
        self.instances
            .iter()
            .map(|i| instance_moves(i) || (i.skin.is_some() && bends[i.node as usize]))
            .collect()
    }
}
