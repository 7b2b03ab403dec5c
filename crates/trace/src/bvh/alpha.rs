//! Which triangles let rays through their holes: alpha masks, decided where a ray meets them.

use dapple_scene::glam::Vec2;
use dapple_scene::{AlphaMode, Image, Material, Mesh, Scene, Texture};

/// What rays do that meet the back of a triangle whose material is not double-sided.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BackFaces {
    /// They are blocked, as at any front: what stands between a point and the sky shades it from either side. Points
    /// inside of bodies are found by it.
    #[default]
    Block,
    /// They pass, as for a viewer that does not draw backs.
    PassSingleSided,
}

/// Marks a triangle that needs no alpha test.
pub(crate) const OPAQUE: u32 = u32::MAX;
/// Marks a triangle that is all hole.
pub(crate) const HOLE: u32 = u32::MAX - 1;

/// Cutoff for [`AlphaMode::Blend`].
const BLEND_CUTOFF: f32 = 0.5;

/// Textured coordinates this many texels out are not looked up: the triangle is solid there.
const MAX_TEXEL: f32 = 1e9;

/// Materials with holes and the images they read (copied, so that queries need no scene).
#[derive(Clone, Debug, Default)]
pub(crate) struct AlphaMaterials {
    materials: Vec<AlphaMaterial>,
    /// Parallel to the scene's images; only those that are read are kept.
    images: Vec<Option<Image>>,
}

#[derive(Clone, Debug)]
struct AlphaMaterial {
    /// Alpha below is a hole; `None` for opaque materials.
    cutoff: Option<f32>,
    factor: f32,
    texture: Option<(Texture, u32)>,
}

/// Alpha of one mesh's triangles.
#[derive(Clone, Debug, Default)]
pub(crate) struct MeshAlpha {
    /// For each triangle [`OPAQUE`], [`HOLE`] or an index into `tested`; empty if all are opaque.
    of_triangle: Vec<u32>,
    tested: Vec<AlphaTriangle>,
    /// For each triangle whether rays pass it from behind; empty if none lets them.
    one_sided: Vec<bool>,
}

#[derive(Clone, Debug)]
struct AlphaTriangle {
    material: u32,
    /// Image coordinates at the corners.
    image_uv: [Vec2; 3],
    /// Vertex colour alpha at the corners.
    color: [f32; 3],
}

impl AlphaMaterials {
    pub(crate) fn new(scene: &Scene) -> AlphaMaterials {
        let mut images = vec![None; scene.images.len()];
        let materials = scene.materials.iter().map(|m| AlphaMaterial::new(scene, m, &mut images)).collect();
        AlphaMaterials { materials, images }
    }

    /// Whether a ray that meets the triangle with these corner weights is blocked by it.
    pub(crate) fn blocks(&self, mesh: &MeshAlpha, alpha: u32, weights: [f32; 3]) -> bool {
        if alpha == OPAQUE {
            return true;
        }
        let Some(triangle) = mesh.tested.get(alpha as usize) else { return false };
        let [a, b, c] = weights;
        let color = triangle.color[0] * a + triangle.color[1] * b + triangle.color[2] * c;
        let uv = triangle.image_uv[0] * a + triangle.image_uv[1] * b + triangle.image_uv[2] * c;
        let material = &self.materials[triangle.material as usize];
        material.cutoff.is_none_or(|cutoff| material.factor * color * self.texel(material, uv) >= cutoff)
    }

    fn texel(&self, material: &AlphaMaterial, uv: Vec2) -> f32 {
        let Some((texture, image)) = &material.texture else { return 1.0 };
        let Some(image) = self.images.get(*image as usize).and_then(Option::as_ref) else { return 1.0 };
        let (x, y) = (uv.x * image.width as f32, uv.y * image.height as f32);
        // Texel indices are whole numbers: beyond what they can count there is nothing to look up (NaN too).
        if !(x.abs() < MAX_TEXEL && y.abs() < MAX_TEXEL) {
            return 1.0;
        }
        texture.sample(image, uv).w
    }
}

impl AlphaMaterial {
    fn new(scene: &Scene, material: &Material, images: &mut [Option<Image>]) -> AlphaMaterial {
        let cutoff = match material.alpha_mode {
            AlphaMode::Opaque => None,
            AlphaMode::Mask { cutoff } => Some(cutoff),
            AlphaMode::Blend => Some(BLEND_CUTOFF),
        };
        let mut texture = None;
        if let (Some(_), Some(reference)) = (cutoff, &material.base_color_texture)
            && let Some(t) = scene.textures.get(reference.texture as usize)
            && let Some(image) = scene.images.get(t.image as usize)
            && !image.rgba8.is_empty()
            && image.rgba8.len() as u64 == u64::from(image.width) * u64::from(image.height)
        {
            images[t.image as usize].get_or_insert_with(|| image.clone());
            texture = Some((*t, t.image));
        }
        AlphaMaterial { cutoff, factor: material.base_color_factor.w, texture }
    }
}

impl MeshAlpha {
    pub(crate) fn new(
        scene: &Scene,
        mesh: &Mesh,
        materials: &AlphaMaterials,
        back_faces: BackFaces,
    ) -> MeshAlpha {
        let mut alpha = MeshAlpha::default();
        let is_single = |m: u32| scene.materials.get(m as usize).is_some_and(|m| !m.double_sided);
        if back_faces == BackFaces::PassSingleSided && mesh.parts.iter().any(|p| is_single(p.material)) {
            alpha.one_sided =
                (0..mesh.triangles.len()).map(|i| is_single(mesh.material_of(i as u32))).collect();
        }
        let has_holes = |m: u32| materials.materials.get(m as usize).is_some_and(|m| m.cutoff.is_some());
        if !mesh.parts.iter().any(|p| has_holes(p.material)) {
            return alpha;
        }
        alpha.of_triangle = vec![OPAQUE; mesh.triangles.len()];
        for part in mesh.parts.iter().filter(|p| has_holes(p.material)) {
            let first = (part.first_triangle as usize).min(mesh.triangles.len());
            let end = first.saturating_add(part.triangle_count as usize).min(mesh.triangles.len());
            for i in first..end {
                alpha.of_triangle[i] =
                    alpha.classify(scene, mesh, materials, part.material, mesh.triangles[i]);
            }
        }
        alpha
    }

    /// [`OPAQUE`], [`HOLE`] or an index into the tested triangles.
    pub(crate) fn of_triangle(&self, triangle: usize) -> u32 {
        self.of_triangle.get(triangle).copied().unwrap_or(OPAQUE)
    }

    /// Whether the triangle lets rays through from behind.
    pub(crate) fn passes_back(&self, triangle: usize) -> bool {
        self.one_sided.get(triangle).copied().unwrap_or(false)
    }

    /// Whether the triangle blocks whatever meets it.
    pub(crate) fn is_plain(&self, triangle: usize) -> bool {
        self.of_triangle(triangle) == OPAQUE && !self.passes_back(triangle)
    }

    fn classify(
        &mut self,
        scene: &Scene,
        mesh: &Mesh,
        materials: &AlphaMaterials,
        index: u32,
        corners: [u32; 3],
    ) -> u32 {
        let material = &materials.materials[index as usize];
        let Some(cutoff) = material.cutoff else { return OPAQUE };
        if material.texture.is_none() && mesh.colors.is_empty() {
            return if material.factor < cutoff { HOLE } else { OPAQUE };
        }
        let color = corners.map(|c| mesh.colors.get(c as usize).map_or(1.0, |c| c.w));
        let image_uv = corners.map(|c| match scene.materials[index as usize].base_color_texture {
            Some(t) => {
                let set = &mesh.uvs[usize::from(t.uv_set).min(1)];
                t.image_from_uv.transform_point2(set.get(c as usize).copied().unwrap_or(Vec2::ZERO))
            }
            None => Vec2::ZERO,
        });
        self.tested.push(AlphaTriangle { material: index, image_uv, color });
        (self.tested.len() - 1) as u32
    }
}
