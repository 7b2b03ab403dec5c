//! Meshes: primitives joined, strips and fans unrolled, only the vertices in use kept.

use glam::{Vec2, Vec3, Vec4};
use gltf::json::accessor::{Accessor, ComponentType, Type};
use gltf::json::mesh::{Mesh as Source, Mode, Primitive, Semantic};
use gltf::json::{Index, validation::Checked};

use super::accessor::{Allowed, Elements};
use super::document::{Document, label, name_of};
use crate::load::context::is_usable;
use crate::load::{LoadError, MeshOrigin, accumulate, normals};
use crate::{Material, Mesh, MorphTarget, Scene, SkinInfluences};

use ComponentType::{F32, I8, I16, U8, U16, U32};

const POSITION: Allowed = Allowed::new(&[Type::Vec3], &[F32, I8, U8, I16, U16]);
const NORMAL: Allowed = Allowed::new(&[Type::Vec3], &[F32, I8, I16]);
const TANGENT: Allowed = Allowed::new(&[Type::Vec4], &[F32, I8, I16]);
const TEXCOORD: Allowed = Allowed::new(&[Type::Vec2], &[F32, I8, U8, I16, U16]);
const COLOR: Allowed = Allowed::new(&[Type::Vec3, Type::Vec4], &[F32, U8, U16]);
const JOINTS: Allowed = Allowed::new(&[Type::Vec4], &[U8, U16]);
const WEIGHTS: Allowed = Allowed::new(&[Type::Vec4], &[F32, U8, U16]);
const INDICES: Allowed = Allowed::new(&[Type::Scalar], &[U8, U16, U32]);

/// Reads all meshes into `scene`, and adds a default material if one is needed. Tells where the meshes' parts come from.
pub(super) fn read(document: &Document<'_>, scene: &mut Scene) -> Result<Vec<MeshOrigin>, LoadError> {
    let default_material = scene.materials.len() as u32;
    let mut origins = Vec::with_capacity(document.root.meshes.len());
    for (i, source) in document.root.meshes.iter().enumerate() {
        let (mesh, origin) = read_mesh(document, source, i, default_material)?;
        scene.meshes.push(mesh);
        origins.push(origin);
    }
    let uses_default = |mesh: &Mesh| mesh.parts.iter().any(|part| part.material == default_material);
    if scene.meshes.iter().any(uses_default) || (scene.materials.is_empty() && !scene.meshes.is_empty()) {
        scene.materials.push(Material { name: "default".to_owned(), ..Material::default() });
    }
    Ok(origins)
}

fn read_mesh(
    document: &Document<'_>,
    source: &Source,
    index: usize,
    default_material: u32,
) -> Result<(Mesh, MeshOrigin), LoadError> {
    let context = document.context;
    let at = label("mesh", index, &source.name);
    let mut origin = MeshOrigin::default();
    let mut mesh = Mesh { name: name_of("mesh", index, &source.name), ..Mesh::default() };
    let mut target_counts = Vec::new();
    for (p, primitive) in source.primitives.iter().enumerate() {
        let at = format!("{at}.primitives[{p}]");
        let material = document
            .resolve_optional(primitive.material, "material", &at, "material")?
            .map_or(default_material, |material| material as u32);
        let Some((piece, vertices)) = (Reader { document, primitive, at: &at }).piece()? else { continue };
        origin.primitives.push(p as u32);
        origin.vertices.extend(vertices);
        target_counts.push(piece.morph_targets.len());
        accumulate::append(context, &at, &mut mesh, piece, material)?;
    }
    if target_counts.windows(2).any(|pair| pair[0] != pair[1]) {
        context.warn(format!(
            "{at}: its primitives have different numbers of morph targets; missing ones stay still"
        ));
    }
    let mended = accumulate::normalize_weights(&mut mesh.influences);
    if mended > 0 {
        context.warn(format!(
            "{at}: joint weights of {mended} vertices were zero, negative or not finite; mended"
        ));
    }
    let mut weights = source.weights.clone().unwrap_or_default();
    document.check_numbers(&at, "weights", &weights)?;
    if !weights.is_empty() && weights.len() != mesh.morph_targets.len() {
        let targets = mesh.morph_targets.len();
        context.warn(format!(
            "{at} has {} morph weights for {targets} morph targets; made to fit",
            weights.len()
        ));
    }
    weights.resize(mesh.morph_targets.len(), 0.0);
    mesh.morph_weights = weights;
    Ok((mesh, origin))
}

fn vertex_bytes(mesh: &Mesh) -> u64 {
    let full = |is_full: bool, bytes: u64| if is_full { bytes } else { 0 };
    24 + full(!mesh.tangents.is_empty(), 16)
        + mesh.uvs.iter().map(|uvs| full(!uvs.is_empty(), 8)).sum::<u64>()
        + full(!mesh.colors.is_empty(), 16)
        + 24 * (mesh.influences.len() + mesh.morph_targets.len()) as u64
}

/// The vertices that triangles refer to, ascending, and the triangles in terms of them.
fn used_vertices(count: usize, mut triangles: Vec<[u32; 3]>) -> (Vec<u32>, Vec<[u32; 3]>) {
    let corners = 3 * triangles.len();
    if count <= 8 * corners + 65536 {
        let mut new_index = vec![u32::MAX; count];
        for &v in triangles.iter().flatten() {
            new_index[v as usize] = 0;
        }
        let mut used = Vec::with_capacity(count.min(corners));
        for (v, new) in new_index.iter_mut().enumerate() {
            if *new == 0 {
                *new = used.len() as u32;
                used.push(v as u32);
            }
        }
        for v in triangles.iter_mut().flatten() {
            *v = new_index[*v as usize];
        }
        (used, triangles)
    } else {
        // A claimed count far above what is used must not cost memory.
        let mut used: Vec<u32> = triangles.iter().flatten().copied().collect();
        used.sort_unstable();
        used.dedup();
        for v in triangles.iter_mut().flatten() {
            *v = used.binary_search(v).unwrap_or(0) as u32;
        }
        (used, triangles)
    }
}

/// Reads one primitive.
struct Reader<'a> {
    document: &'a Document<'a>,
    primitive: &'a Primitive,
    at: &'a str,
}

impl Reader<'_> {
    /// The triangles of the primitive and the accessor element of each vertex, or `None` (with a warning) if there is
    /// nothing to draw.
    fn piece(&self) -> Result<Option<(Mesh, Vec<u32>)>, LoadError> {
        let (context, at) = (self.document.context, self.at);
        let mode = match self.primitive.mode {
            Checked::Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) => mode,
            Checked::Valid(_) => {
                context.warn(format!("{at}: points and lines are left out"));
                return Ok(None);
            }
            Checked::Invalid => {
                return Err(context.invalid(at, "its mode does not exist; export the file again"));
            }
        };
        let Some(positions) = self.attribute(Semantic::Positions, POSITION, None)? else {
            context.warn(format!("{at}: left out, as it has no POSITION"));
            return Ok(None);
        };
        let triangles = self.triangles(mode, &positions)?;
        if triangles.is_empty() {
            context.warn(format!("{at}: left out, as it has no triangles"));
            return Ok(None);
        }
        let (mut used, triangles) = used_vertices(positions.count, triangles);
        let mut piece = self.vertices(&positions, &used)?;
        piece.triangles = triangles;
        if piece.normals.is_empty() {
            // glTF: flat normals, and tangents are to be ignored.
            let corners = 3 * piece.triangles.len() as u64;
            context.charge(at, corners, vertex_bytes(&piece) + 16)?;
            used = piece.triangles.iter().flatten().map(|&v| used[v as usize]).collect();
            piece = accumulate::unshare(piece);
            normals::set_flat(&mut piece);
        } else {
            let mended = normals::mend(&mut piece);
            if mended > 0 {
                context.warn(format!(
                    "{at}: {mended} normals were zero or not finite; taken from the faces instead"
                ));
            }
            self.mend_tangents(&mut piece);
        }
        Ok(Some((piece, used)))
    }

    fn attribute(
        &self,
        semantic: Semantic,
        allowed: Allowed,
        count: Option<usize>,
    ) -> Result<Option<Elements<'_>>, LoadError> {
        let key = format!("attributes.{}", semantic.to_string());
        let accessor = self.primitive.attributes.get(&Checked::Valid(semantic)).copied();
        self.optional_elements(&key, accessor, allowed, count)
    }

    fn optional_elements(
        &self,
        key: &str,
        accessor: Option<Index<Accessor>>,
        allowed: Allowed,
        count: Option<usize>,
    ) -> Result<Option<Elements<'_>>, LoadError> {
        let Some(accessor) = accessor else { return Ok(None) };
        let elements = self.document.elements(accessor, self.at, key, allowed)?;
        if let Some(count) = count
            && elements.count != count
        {
            let problem =
                format!("has {} elements for {count} vertices; export the file again", elements.count);
            return Err(self.document.context.invalid(elements.at.as_str(), problem));
        }
        Ok(Some(elements))
    }

    fn triangles(&self, mode: Mode, positions: &Elements<'_>) -> Result<Vec<[u32; 3]>, LoadError> {
        let context = self.document.context;
        let vertices = positions.count;
        let indices = self.optional_elements("indices", self.primitive.indices, INDICES, None)?;
        let count = indices.as_ref().map_or(vertices, |indices| indices.count);
        context.charge(self.at, count as u64, 16)?;
        let corners: Vec<u32> = match &indices {
            Some(indices) => (0..count).map(|i| indices.uint(i, 0)).collect(),
            None => {
                let count = u32::try_from(count)
                    .map_err(|_| context.invalid(self.at, "has more than 2^32 vertices; split it"))?;
                (0..count).collect()
            }
        };
        if let Some(i) = corners.iter().position(|&v| v as usize >= vertices) {
            let at = indices.map_or(String::new(), |indices| format!("{}, element {i},", indices.at));
            return Err(context.out_of_range(at, "vertex", u64::from(corners[i]), vertices));
        }
        let n = corners.len();
        Ok(match mode {
            Mode::TriangleStrip => (0..n.saturating_sub(2))
                .map(|i| [corners[i], corners[i + 1 + i % 2], corners[i + 2 - i % 2]])
                .filter(|[a, b, c]| a != b && b != c && c != a)
                .collect(),
            Mode::TriangleFan => {
                (0..n.saturating_sub(2)).map(|i| [corners[i + 1], corners[i + 2], corners[0]]).collect()
            }
            _ => {
                if !n.is_multiple_of(3) {
                    let at = self.at;
                    context.warn(format!(
                        "{at}: {n} corners are not whole triangles; the last {} are left out",
                        n % 3
                    ));
                }
                corners.as_chunks::<3>().0.to_vec()
            }
        })
    }

    fn vertices(&self, positions: &Elements<'_>, used: &[u32]) -> Result<Mesh, LoadError> {
        let context = self.document.context;
        let count = Some(positions.count);
        let mut mesh = Mesh { positions: self.vectors(positions, used)?, ..Mesh::default() };
        if let Some(normals) = self.attribute(Semantic::Normals, NORMAL, count)? {
            self.charge(used, 12)?;
            mesh.normals = used.iter().map(|&v| Vec3::from(normals.floats::<3>(v as usize))).collect();
            if let Some(tangents) = self.attribute(Semantic::Tangents, TANGENT, count)? {
                self.charge(used, 16)?;
                mesh.tangents = used.iter().map(|&v| Vec4::from(tangents.floats::<4>(v as usize))).collect();
            }
        }
        for (list, set) in mesh.uvs.iter_mut().zip(0..) {
            if let Some(uvs) = self.attribute(Semantic::TexCoords(set), TEXCOORD, count)? {
                self.charge(used, 8)?;
                *list = used.iter().map(|&v| Vec2::from(uvs.floats::<2>(v as usize))).collect();
                let bad = list.iter_mut().filter(|uv| !uv.to_array().into_iter().all(is_usable));
                let bad = bad.map(|uv| *uv = Vec2::ZERO).count();
                if bad > 0 {
                    context.warn(format!("{}: {bad} texture coordinates are not finite; set to 0", uvs.at));
                }
            }
        }
        if let Some(colors) = self.attribute(Semantic::Colors(0), COLOR, count)? {
            self.charge(used, 16)?;
            let color = |v: &u32| {
                let [r, g, b, a] = colors.floats::<4>(*v as usize);
                let (largest, a) = (colors.integer_scale(), if colors.width == 4 { a } else { f32::NAN });
                let clean = |x: f32| if is_usable(x) { (x / largest).max(0.0) } else { 1.0 };
                Vec4::new(clean(r), clean(g), clean(b), clean(a))
            };
            mesh.colors = used.iter().map(color).collect();
        }
        mesh.influences = self.influences(used, count)?;
        for (i, target) in self.primitive.targets.iter().flatten().enumerate() {
            let mut morph = MorphTarget::default();
            let key = format!("targets[{i}].POSITION");
            if let Some(offsets) = self.optional_elements(&key, target.positions, POSITION, count)? {
                morph.positions = self.vectors(&offsets, used)?;
            }
            let key = format!("targets[{i}].NORMAL");
            let normals = target.normals.filter(|_| !mesh.normals.is_empty());
            if let Some(offsets) = self.optional_elements(&key, normals, NORMAL, count)? {
                morph.normals = self.vectors(&offsets, used)?;
            }
            mesh.morph_targets.push(morph);
        }
        Ok(mesh)
    }

    /// Positions or displacements, which must be finite.
    fn vectors(&self, elements: &Elements<'_>, used: &[u32]) -> Result<Vec<Vec3>, LoadError> {
        self.charge(used, 12)?;
        let vector = |&v: &u32| {
            let vector = elements.floats::<3>(v as usize);
            if vector.into_iter().all(is_usable) {
                Ok(Vec3::from(vector))
            } else {
                Err(self.document.context.not_finite(format!("{}, element {v},", elements.at)))
            }
        };
        used.iter().map(vector).collect()
    }

    fn influences(&self, used: &[u32], count: Option<usize>) -> Result<Vec<SkinInfluences>, LoadError> {
        let mut sets = Vec::new();
        loop {
            let set = sets.len() as u32;
            let joints = self.attribute(Semantic::Joints(set), JOINTS, count)?;
            let weights = self.attribute(Semantic::Weights(set), WEIGHTS, count)?;
            match (joints, weights) {
                (Some(joints), Some(weights)) => {
                    self.charge(used, 24)?;
                    let scale = weights.integer_scale();
                    sets.push(SkinInfluences {
                        joints: used
                            .iter()
                            .map(|&v| std::array::from_fn(|c| joints.uint(v as usize, c) as u16))
                            .collect(),
                        weights: used
                            .iter()
                            .map(|&v| weights.floats(v as usize).map(|w| w / scale))
                            .collect(),
                    });
                }
                (None, None) => return Ok(sets),
                (Some(_), None) | (None, Some(_)) => {
                    let problem =
                        format!("JOINTS_{set} and WEIGHTS_{set} must come together; export the file again");
                    return Err(self.document.context.invalid(self.at, problem));
                }
            }
        }
    }

    fn mend_tangents(&self, piece: &mut Mesh) {
        let mut bad = 0;
        for (tangent, normal) in piece.tangents.iter_mut().zip(&piece.normals) {
            match tangent.truncate().try_normalize().filter(|t| t.is_finite()) {
                Some(unit) => *tangent = unit.extend(if tangent.w < 0.0 { -1.0 } else { 1.0 }),
                None => {
                    bad += 1;
                    *tangent = normals::any_tangent(*normal);
                }
            }
        }
        if bad > 0 {
            let at = self.at;
            self.document.context.warn(format!("{at}: {bad} tangents were zero or not finite; replaced"));
        }
    }

    fn charge(&self, used: &[u32], bytes_per_vertex: u64) -> Result<(), LoadError> {
        self.document.context.charge(self.at, used.len() as u64, bytes_per_vertex)
    }
}
