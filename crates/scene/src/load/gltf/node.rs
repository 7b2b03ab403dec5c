//! Nodes, skins, cameras, lights, and which of the nodes the scene shows.

use glam::{Affine3A, Mat4, Quat, Vec3};

use super::accessor::{Allowed, Component};
use super::document::Document;
use super::json::Object;
use crate::load::LoadError;
use crate::load::context::is_usable;
use crate::load::finish::{Draft, Placement};
use crate::{Camera, Light, LightKind, LocalTransform, Node, Projection, Skin};

const MATRICES: Allowed = Allowed::new(&["MAT4"], &[Component::F32]);

/// Reads everything that hangs on nodes into `draft`.
pub(super) fn read(document: &Document<'_>, draft: &mut Draft) -> Result<(), LoadError> {
    for (i, object) in document.cameras.iter().enumerate() {
        let projection = read_projection(object)?;
        draft.scene.cameras.push(Camera { name: object.name("camera", i)?, projection });
    }
    if let Some(extension) = document.root.extension("KHR_lights_punctual")? {
        for (i, object) in extension.entities("lights", "light")?.iter().enumerate() {
            draft.scene.lights.push(read_light(object, i)?);
        }
    }
    for (i, object) in document.skins.iter().enumerate() {
        let skin = read_skin(document, object, i)?;
        draft.scene.skins.push(skin);
    }
    for (i, object) in document.nodes.iter().enumerate() {
        read_node(document, object, i, draft)?;
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

fn read_projection(object: &Object<'_>) -> Result<Projection, LoadError> {
    let context = object.context;
    let positive = |lens: &Object<'_>, key: &'static str, default: f32| {
        let value = lens.number(key)?.ok_or_else(|| lens.missing(key))?.abs();
        if value > 0.0 {
            return Ok(value);
        }
        context.warn(format!("{} is 0; taken as {default}", lens.at_key(key)));
        Ok::<f32, LoadError>(default)
    };
    match object.string("type")? {
        Some("perspective") => {
            let lens = object.object("perspective")?.ok_or_else(|| object.missing("perspective"))?;
            let mut yfov = positive(&lens, "yfov", 0.8)?;
            if yfov >= std::f32::consts::PI {
                context.warn(format!("{} is not below π; taken as 3.1", lens.at_key("yfov")));
                yfov = 3.1;
            }
            Ok(Projection::Perspective { yfov, near: positive(&lens, "znear", 0.01)? })
        }
        Some("orthographic") => {
            let lens = object.object("orthographic")?.ok_or_else(|| object.missing("orthographic"))?;
            let half_height = positive(&lens, "ymag", 1.0)?;
            let near = lens.number("znear")?.ok_or_else(|| lens.missing("znear"))?;
            let mut far = lens.number("zfar")?.ok_or_else(|| lens.missing("zfar"))?;
            if far <= near {
                far = near + near.abs().max(1.0) * 1000.0;
                context.warn(format!("{} is not beyond znear; taken as {far}", lens.at_key("zfar")));
            }
            Ok(Projection::Orthographic { half_height, near, far })
        }
        Some(_) => Err(object.invalid("type must be 'perspective' or 'orthographic'; export the file again")),
        None => Err(object.missing("type")),
    }
}

fn read_light(object: &Object<'_>, index: usize) -> Result<Light, LoadError> {
    let kind = match object.string("type")? {
        Some("directional") => LightKind::Directional,
        Some("point") => LightKind::Point,
        Some("spot") => {
            let (inner, outer) = match object.object("spot")? {
                Some(spot) => (spot.number("innerConeAngle")?, spot.number("outerConeAngle")?),
                None => (None, None),
            };
            let (right, quarter) = (std::f32::consts::FRAC_PI_2, std::f32::consts::FRAC_PI_4);
            let outer_cone_angle = outer.unwrap_or(quarter).clamp(1e-3, right);
            let inner_cone_angle = inner.unwrap_or(0.0).clamp(0.0, outer_cone_angle - 5e-4);
            LightKind::Spot { inner_cone_angle, outer_cone_angle }
        }
        Some(_) => {
            return Err(
                object.invalid("type must be 'directional', 'point' or 'spot'; export the file again")
            );
        }
        None => return Err(object.missing("type")),
    };
    let intensity = object.number("intensity")?.unwrap_or(1.0);
    if intensity < 0.0 {
        object.context.warn(format!("{}: its intensity {intensity} is taken as 0", object.at));
    }
    Ok(Light {
        name: object.name("light", index)?,
        color: Vec3::from(object.numbers::<3>("color")?.unwrap_or([1.0; 3])).max(Vec3::ZERO),
        intensity: intensity.max(0.0),
        range: object.number("range")?.filter(|range| *range > 0.0),
        kind,
    })
}

fn read_skin(document: &Document<'_>, object: &Object<'_>, index: usize) -> Result<Skin, LoadError> {
    let context = document.context;
    let joints = object.indices("joints", "node", document.nodes.len())?;
    if joints.is_empty() {
        return Err(object.missing("joints"));
    }
    object.index("skeleton", "node", document.nodes.len())?;
    let mut inverse_bind_matrices = vec![Affine3A::IDENTITY; joints.len()];
    if let Some(accessor) = object.index("inverseBindMatrices", "accessor", document.accessors.len())? {
        let matrices = document.elements(accessor, object.at_key("inverseBindMatrices"), MATRICES)?;
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
    Ok(Skin { name: object.name("skin", index)?, joints, inverse_bind_matrices })
}

fn is_affine(columns: &[f32; 16]) -> bool {
    (0..4).all(|c| (columns[4 * c + 3] - if c == 3 { 1.0 } else { 0.0 }).abs() < 1e-5)
}

fn read_node(
    document: &Document<'_>,
    object: &Object<'_>,
    index: usize,
    draft: &mut Draft,
) -> Result<(), LoadError> {
    let context = document.context;
    let scene = &mut draft.scene;
    let light = match object.extension("KHR_lights_punctual")? {
        Some(extension) => extension.index("light", "light", scene.lights.len())?,
        None => None,
    };
    let camera = object.index("camera", "camera", scene.cameras.len())?;
    let mesh = object.index("mesh", "mesh", scene.meshes.len())?;
    let mut skin = object.index("skin", "skin", scene.skins.len())?;
    let mut morph_weights = object.number_list("weights")?;
    let targets = mesh.map_or(0, |mesh| scene.meshes[mesh].morph_targets.len());
    if !morph_weights.is_empty() && morph_weights.len() != targets {
        let n = morph_weights.len();
        context.warn(format!("{} has {n} morph weights for {targets} morph targets; made to fit", object.at));
        morph_weights.resize(targets, 0.0);
    }
    if let Some(mesh) = mesh {
        if skin.is_some() && scene.meshes[mesh].influences.is_empty() {
            context.warn(format!("{}: its skin is ignored, as mesh {mesh} has no joint weights", object.at));
            skin = None;
        }
        let extras = object.extras();
        let flag = |key: &str| {
            let value = extras.and_then(|extras| extras.get(key));
            if value.is_some_and(|value| !value.is_boolean()) {
                context.warn(format!("{}: extras.{key} must be true or false; taken as true", object.at));
            }
            value.and_then(serde_json::Value::as_bool).unwrap_or(true)
        };
        draft.placements.push(Placement {
            node: index as u32,
            mesh: mesh as u32,
            skin: skin.map(|skin| skin as u32),
            casts: flag("casts"),
            receives: flag("receives"),
        });
    } else if skin.is_some() {
        context.warn(format!("{} has a skin but no mesh; ignored", object.at));
    }
    draft.children.push(object.indices("children", "node", document.nodes.len())?);
    draft.labels.push(object.at.clone());
    draft.scene.nodes.push(Node {
        name: object.name("node", index)?,
        parent: None,
        local: read_transform(object)?,
        camera: camera.map(|camera| camera as u32),
        light: light.map(|light| light as u32),
        morph_weights,
    });
    Ok(())
}

fn read_transform(object: &Object<'_>) -> Result<LocalTransform, LoadError> {
    let context = object.context;
    let translation = object.numbers::<3>("translation")?;
    let rotation = object.numbers::<4>("rotation")?;
    let scale = object.numbers::<3>("scale")?;
    if let Some(columns) = object.numbers::<16>("matrix")? {
        if translation.is_some() || rotation.is_some() || scale.is_some() {
            context.warn(format!(
                "{} has both a matrix and translation, rotation or scale; the matrix is used",
                object.at
            ));
        }
        let mut matrix = Mat4::from_cols_array(&columns);
        if !is_affine(&columns) {
            context.warn(format!("{}: the last row of its matrix is not 0 0 0 1; taken as that", object.at));
            matrix = Mat4::from(Affine3A::from_mat4(matrix));
        }
        return Ok(LocalTransform::Matrix(matrix));
    }
    let rotation = Quat::from_array(rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]));
    let length = rotation.length();
    if (length - 1.0).abs() > 1e-3 {
        context.warn(format!("{}: its rotation is not a unit quaternion; normalized", object.at));
    }
    let unit = rotation.normalize();
    Ok(LocalTransform::Trs {
        translation: translation.map_or(Vec3::ZERO, Vec3::from),
        rotation: if length > 0.0 && unit.is_finite() { unit } else { Quat::IDENTITY },
        scale: scale.map_or(Vec3::ONE, Vec3::from),
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
    let default = document.root.index("scene", "scene", document.scenes.len());
    // Without any scenes, a default scene is a slip that hides nothing.
    let default = if document.scenes.is_empty() && default.is_err() {
        if matches!(default, Err(LoadError::WrongType { .. })) {
            return default.map(|_| Vec::new());
        }
        document
            .context
            .warn("the file names a default scene but has no scenes; all nodes are shown".to_owned());
        None
    } else {
        default?
    };
    let mut roots = Vec::new();
    for (i, scene) in document.scenes.iter().enumerate() {
        let nodes = scene.indices("nodes", "node", count)?;
        if default.unwrap_or(0) == i {
            roots = nodes;
        }
    }
    if document.scenes.is_empty() {
        return Ok(vec![true; count]);
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
