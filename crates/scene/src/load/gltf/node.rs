//! Nodes, skins, cameras, lights, and which of the nodes the scene shows.

use glam::{Affine3A, Mat4, Quat, Vec3};
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::camera::{Camera as SourceCamera, Type as CameraType};
use gltf::json::extensions::scene::khr_lights_punctual::{Light as SourceLight, Type as LightType};
use gltf::json::validation::Checked;
use gltf::json::{Index, Node as SourceNode, Skin as SourceSkin};
use serde_json::Value;

use super::accessor::Allowed;
use super::document::{Document, label, name_of};
use crate::load::LoadError;
use crate::load::context::{Context, is_usable};
use crate::load::finish::{Draft, Placement};
use crate::{
    Camera, EmitterShape, Light, LightKind, LocalTransform, Material, Node, Projection, Scene, Skin,
};

const MATRICES: Allowed = Allowed::new(&[Type::Mat4], &[ComponentType::F32]);

/// Reads everything that hangs on nodes into `draft`.
pub(super) fn read(document: &Document<'_>, draft: &mut Draft) -> Result<(), LoadError> {
    for (i, source) in document.root.cameras.iter().enumerate() {
        let projection = read_projection(document, source, &label("camera", i, &source.name))?;
        draft.scene.cameras.push(Camera { name: name_of("camera", i, &source.name), projection });
    }
    let lights: &[SourceLight] = document.root.as_ref();
    for (i, source) in lights.iter().enumerate() {
        draft.scene.lights.push(read_light(document, source, i)?);
    }
    for (i, source) in document.root.skins.iter().enumerate() {
        let skin = read_skin(document, source, i)?;
        draft.scene.skins.push(skin);
    }
    for (i, source) in document.root.nodes.iter().enumerate() {
        read_node(document, source, i, draft)?;
    }
    link_parents(document, draft)?;
    let shown = shown_nodes(document, draft)?;
    for (i, node) in draft.scene.nodes.iter_mut().enumerate() {
        if !shown[i] {
            (node.camera, node.light) = (None, None);
        }
    }
    draft.placements.retain(|placement| shown[placement.node as usize]);
    Ok(())
}

fn read_projection(
    document: &Document<'_>,
    source: &SourceCamera,
    at: &str,
) -> Result<Projection, LoadError> {
    let context = document.context;
    let missing = |property| LoadError::Missing { file: context.file(), at: at.to_owned(), property };
    let positive = |key: &str, value: f32, default: f32| {
        let value = document.number(at, key, value)?.abs();
        if value > 0.0 {
            return Ok(value);
        }
        context.warn(format!("{at}.{key} is 0; taken as {default}"));
        Ok::<f32, LoadError>(default)
    };
    match source.type_ {
        Checked::Valid(CameraType::Perspective) => {
            let lens = source.perspective.as_ref().ok_or_else(|| missing("perspective"))?;
            let mut yfov = positive("perspective.yfov", lens.yfov, 0.8)?;
            if yfov >= std::f32::consts::PI {
                context.warn(format!("{at}.perspective.yfov is not below π; taken as 3.1"));
                yfov = 3.1;
            }
            Ok(Projection::Perspective { yfov, near: positive("perspective.znear", lens.znear, 0.01)? })
        }
        Checked::Valid(CameraType::Orthographic) => {
            let lens = source.orthographic.as_ref().ok_or_else(|| missing("orthographic"))?;
            let half_height = positive("orthographic.ymag", lens.ymag, 1.0)?;
            let [near, mut far] =
                document.numbers(at, "orthographic.znear or zfar", [lens.znear, lens.zfar])?;
            if far <= near {
                far = near + near.abs().max(1.0) * 1000.0;
                context.warn(format!("{at}.orthographic.zfar is not beyond znear; taken as {far}"));
            }
            Ok(Projection::Orthographic { half_height, near, far })
        }
        Checked::Invalid => {
            Err(context.invalid(at, "type must be 'perspective' or 'orthographic'; export the file again"))
        }
    }
}

fn read_light(document: &Document<'_>, source: &SourceLight, index: usize) -> Result<Light, LoadError> {
    let at = label("light", index, &source.name);
    let kind = match source.type_ {
        Checked::Valid(LightType::Directional) => LightKind::Directional,
        Checked::Valid(LightType::Point) => LightKind::Point,
        Checked::Valid(LightType::Spot) => {
            let (right, quarter) = (std::f32::consts::FRAC_PI_2, std::f32::consts::FRAC_PI_4);
            let spot = source.spot.as_ref();
            let angles = spot.map_or([0.0, quarter], |s| [s.inner_cone_angle, s.outer_cone_angle]);
            let [inner, outer] = document.numbers(&at, "spot", angles)?;
            let outer_cone_angle = outer.clamp(1e-3, right);
            let inner_cone_angle = inner.clamp(0.0, outer_cone_angle - 5e-4);
            LightKind::Spot { inner_cone_angle, outer_cone_angle }
        }
        Checked::Invalid => {
            let problem = "type must be 'directional', 'point' or 'spot'; export the file again";
            return Err(document.context.invalid(at, problem));
        }
    };
    let intensity = document.number(&at, "intensity", source.intensity)?;
    if intensity < 0.0 {
        document.context.warn(format!("{at}: its intensity {intensity} is taken as 0"));
    }
    let range = source.range.map(|range| document.number(&at, "range", range)).transpose()?;
    Ok(Light {
        name: name_of("light", index, &source.name),
        color: Vec3::from(document.numbers(&at, "color", source.color)?).max(Vec3::ZERO),
        intensity: intensity.max(0.0),
        range: range.filter(|range| *range > 0.0),
        kind,
    })
}

fn read_skin(document: &Document<'_>, source: &SourceSkin, index: usize) -> Result<Skin, LoadError> {
    let context = document.context;
    let at = label("skin", index, &source.name);
    let joints = resolve_nodes(document, &source.joints, &at, "joints")?;
    if joints.is_empty() {
        return Err(LoadError::Missing { file: context.file(), at, property: "joints" });
    }
    document.resolve_optional(source.skeleton, "node", &at, "skeleton")?;
    let mut inverse_bind_matrices = vec![Affine3A::IDENTITY; joints.len()];
    if let Some(accessor) = source.inverse_bind_matrices {
        let matrices = document.elements(accessor, &at, "inverseBindMatrices", MATRICES)?;
        if matrices.count < joints.len() {
            let problem = format!("holds {} matrices for {} joints", matrices.count, joints.len());
            return Err(context.invalid(matrices.at.as_str(), format!("{problem}; export the file again")));
        }
        let mut projective = false;
        for (i, matrix) in inverse_bind_matrices.iter_mut().enumerate() {
            let columns = matrices.floats::<16>(i);
            if !columns.into_iter().all(is_usable) {
                return Err(context.not_finite(format!("{}, matrix {i},", matrices.at)));
            }
            projective |= !is_affine(&columns);
            *matrix = Affine3A::from_mat4(Mat4::from_cols_array(&columns));
        }
        if projective {
            context.warn(format!("{}: the last row of a matrix is not 0 0 0 1; taken as that", matrices.at));
        }
    }
    Ok(Skin { name: name_of("skin", index, &source.name), joints, inverse_bind_matrices })
}

/// Checks a list of references to nodes.
fn resolve_nodes(
    document: &Document<'_>,
    nodes: &[Index<SourceNode>],
    at: &str,
    key: &str,
) -> Result<Vec<u32>, LoadError> {
    let resolve = |(i, node): (usize, &Index<SourceNode>)| {
        let (node, count) = (node.value(), document.root.nodes.len());
        let place = || format!("{at}.{key}[{i}]");
        if node < count {
            Ok(node as u32)
        } else {
            Err(document.context.out_of_range(place(), "node", node as u64, count))
        }
    };
    nodes.iter().enumerate().map(resolve).collect()
}

fn is_affine(columns: &[f32; 16]) -> bool {
    (0..4).all(|c| (columns[4 * c + 3] - if c == 3 { 1.0 } else { 0.0 }).abs() < 1e-5)
}

fn read_node(
    document: &Document<'_>,
    source: &SourceNode,
    index: usize,
    draft: &mut Draft,
) -> Result<(), LoadError> {
    let context = document.context;
    let scene = &mut draft.scene;
    let at = label("node", index, &source.name);
    let light = source.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref());
    let light =
        document.resolve_optional(light.map(|l| l.light), "light", &at, "extensions.KHR_lights_punctual")?;
    let camera = document.resolve_optional(source.camera, "camera", &at, "camera")?;
    let mesh = document.resolve_optional(source.mesh, "mesh", &at, "mesh")?;
    let mut skin = document.resolve_optional(source.skin, "skin", &at, "skin")?;
    let mut morph_weights = source.weights.clone().unwrap_or_default();
    document.check_numbers(&at, "weights", &morph_weights)?;
    let targets = mesh.map_or(0, |mesh| scene.meshes[mesh].morph_targets.len());
    if !morph_weights.is_empty() && morph_weights.len() != targets {
        let n = morph_weights.len();
        context.warn(format!("{at} has {n} morph weights for {targets} morph targets; made to fit"));
        morph_weights.resize(targets, 0.0);
    }
    if let Some(mesh) = mesh {
        if skin.is_some() && scene.meshes[mesh].influences.is_empty() {
            context.warn(format!("{at}: its skin is ignored, as mesh {mesh} has no joint weights"));
            skin = None;
        }
        // Extras may be anything at all.
        let extras = source.extras.as_ref().and_then(|e| serde_json::from_str::<Value>(e.get()).ok());
        let flag = |key: &str| {
            let value = extras.as_ref().and_then(|extras| extras.get(key));
            if value.is_some_and(|value| !value.is_boolean()) {
                context.warn(format!("{at}: extras.{key} must be true or false; taken as true"));
            }
            value.and_then(Value::as_bool).unwrap_or(true)
        };
        let emitter = read_emitter(document, extras.as_ref(), &at);
        warn_of_emitter(context, scene, mesh, emitter, &at);
        draft.placements.push(Placement {
            node: index as u32,
            mesh: mesh as u32,
            skin: skin.map(|skin| skin as u32),
            casts: flag("casts"),
            receives: flag("receives"),
            emitter,
        });
    } else if skin.is_some() {
        context.warn(format!("{at} has a skin but no mesh; ignored"));
    }
    draft.children.push(resolve_nodes(document, source.children.as_deref().unwrap_or(&[]), &at, "children")?);
    draft.scene.nodes.push(Node {
        name: name_of("node", index, &source.name),
        parent: None,
        local: read_transform(document, source, &at)?,
        camera: camera.map(|camera| camera as u32),
        light: light.map(|light| light as u32),
        morph_weights,
    });
    draft.labels.push(at);
    Ok(())
}

/// What a node's mesh stands for as a light (`extras.light`).
fn read_emitter(document: &Document<'_>, extras: Option<&Value>, at: &str) -> EmitterShape {
    let Some(value) = extras.and_then(|extras| extras.get("light")) else { return EmitterShape::default() };
    let known = EmitterShape::NAMES.iter().find(|(name, _)| value.as_str() == Some(name));
    known.map_or_else(
        || {
            document.context.warn(format!(
                "{at}: extras.light must be triangles, sphere, disc or rectangle; taken as triangles"
            ));
            EmitterShape::default()
        },
        |(_, shape)| *shape,
    )
}

/// Tells of what stands for a light of a simple form and is none, or is made of several materials that emit: the first is the light's.
fn warn_of_emitter(context: &Context<'_>, scene: &Scene, mesh: usize, emitter: EmitterShape, at: &str) {
    if emitter == EmitterShape::Triangles {
        return;
    }
    let parts = scene.meshes[mesh].parts.iter().map(|part| part.material);
    let emits = |material: &Material| !material.unlit && material.emissive_factor != Vec3::ZERO;
    let mut emitting: Vec<u32> = parts.filter(|index| emits(&scene.materials[*index as usize])).collect();
    emitting.sort_unstable();
    emitting.dedup();
    match emitting.len() {
        0 => context
            .warn(format!("{at}: extras.light is of no use, as no material of its mesh emits (emissiveFactor, and not KHR_materials_unlit)")),
        1 => {}
        n => context.warn(format!(
            "{at}: extras.light makes one light of a mesh with {n} materials that emit; the first is what it shines with"
        )),
    }
}

fn read_transform(
    document: &Document<'_>,
    source: &SourceNode,
    at: &str,
) -> Result<LocalTransform, LoadError> {
    let context = document.context;
    let translation = document.numbers(at, "translation", source.translation.unwrap_or([0.0; 3]))?;
    let rotation = document.numbers(at, "rotation", source.rotation.unwrap_or_default().0)?;
    let scale = document.numbers(at, "scale", source.scale.unwrap_or([1.0; 3]))?;
    if let Some(columns) = source.matrix {
        document.check_numbers(at, "matrix", &columns)?;
        if source.translation.is_some() || source.rotation.is_some() || source.scale.is_some() {
            context.warn(format!(
                "{at} has both a matrix and translation, rotation or scale; the matrix is used"
            ));
        }
        let mut matrix = Mat4::from_cols_array(&columns);
        if !is_affine(&columns) {
            context.warn(format!("{at}: the last row of its matrix is not 0 0 0 1; taken as that"));
            matrix = Mat4::from(Affine3A::from_mat4(matrix));
        }
        return Ok(LocalTransform::Matrix(matrix));
    }
    let rotation = Quat::from_array(rotation);
    let length = rotation.length();
    if (length - 1.0).abs() > 1e-3 {
        context.warn(format!("{at}: its rotation is not a unit quaternion; normalized"));
    }
    let unit = rotation.normalize();
    Ok(LocalTransform::Trs {
        translation: Vec3::from(translation),
        rotation: if length > 0.0 && unit.is_finite() { unit } else { Quat::IDENTITY },
        scale: Vec3::from(scale),
    })
}

/// Sets the parent of each node; a node has at most one.
fn link_parents(document: &Document<'_>, draft: &mut Draft) -> Result<(), LoadError> {
    for (parent, children) in draft.children.iter().enumerate() {
        for &child in children {
            let slot = &mut draft.scene.nodes[child as usize].parent;
            if let Some(first) = *slot {
                if first == parent as u32 {
                    let (label, child) = (&draft.labels[parent], &draft.labels[child as usize]);
                    document.context.warn(format!("{label} lists its child {child} twice"));
                    continue;
                }
                return Err(LoadError::NodeTwoParents {
                    file: document.context.file(),
                    node: draft.labels[child as usize].clone(),
                    first: draft.labels[first as usize].clone(),
                    second: draft.labels[parent].clone(),
                });
            }
            *slot = Some(parent as u32);
        }
    }
    Ok(())
}

/// Whether each node is below a root of the default scene (or the first; without any scene all nodes are shown).
fn shown_nodes(document: &Document<'_>, draft: &Draft) -> Result<Vec<bool>, LoadError> {
    let count = draft.scene.nodes.len();
    let scenes = &document.root.scenes;
    if scenes.is_empty() {
        // Without any scenes, a default scene is a slip that hides nothing.
        if document.root.scene.is_some() {
            let message = "the file names a default scene but has no scenes; all nodes are shown";
            document.context.warn(message.to_owned());
        }
        return Ok(vec![true; count]);
    }
    let default = document.resolve_optional(document.root.scene, "scene", "the file", "scene")?;
    let mut roots = Vec::new();
    for (i, scene) in scenes.iter().enumerate() {
        let nodes = resolve_nodes(document, &scene.nodes, &label("scene", i, &scene.name), "nodes")?;
        if default.unwrap_or(0) == i {
            roots = nodes;
        }
    }
    let mut shown = vec![false; count];
    let mut stack = Vec::new();
    for root in roots {
        if draft.scene.nodes[root as usize].parent.is_some() {
            let label = &draft.labels[root as usize];
            document
                .context
                .warn(format!("{label} is a root of the scene and a child of another node; shown once"));
        }
        stack.push(root);
    }
    while let Some(node) = stack.pop() {
        if !std::mem::replace(&mut shown[node as usize], true) {
            stack.extend(&draft.children[node as usize]);
        }
    }
    Ok(shown)
}
