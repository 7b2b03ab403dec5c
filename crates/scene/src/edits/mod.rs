//! What viewers have changed of a scene since it was loaded: what stands elsewhere, what is gone, which lights shine differently.
//!
//! One writer applies each [`Edit`] to its [`Edits`] and hands it on; everyone else applies the same edits in the same order, or
//! takes over the whole state. [`Scene::pose_edited`] of the same state and time is the same everywhere, to the bit.

mod error;
mod json;
mod spares;
#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may panic")]
mod tests;

use std::collections::{BTreeMap, BTreeSet};

use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

use crate::{LocalTransform, Scene};
pub use error::EditError;
pub use spares::{MAX_SPARES, Spare, SpareError};

/// Farthest that a placement may move a node from its parent along an axis, metres (if the parent has no scale).
pub const MAX_TRANSLATION: f32 = 1e6;
/// Least and greatest size of a placement's scale along an axis; it may be negative.
pub const SCALE_RANGE: std::ops::RangeInclusive<f32> = 1e-3..=1e3;
/// Most of each channel of a light's colour.
pub const MAX_COLOR: f32 = 1e6;
/// Most intensity of a light: candela, or lux where it is directional.
pub const MAX_INTENSITY: f32 = 1e9;

/// How far the length of a rotation may be from 1 before it is no rotation.
const ROTATION_TOLERANCE: f64 = 1e-3;
/// Squared lengths this near to 1 are what normalising gives, so that whoever normalises again changes nothing.
const IS_UNIT: f64 = 1e-6;

/// Where a node stands: its transform to its parent's space (to the world if it has no parent).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Placement {
    /// In units of the parent's space (metres if it has no scale); each −[`MAX_TRANSLATION`] … [`MAX_TRANSLATION`].
    #[serde(serialize_with = "json::numbers")]
    pub translation: [f32; 3],
    /// Unit quaternion x, y, z, w; a length within 0.001 of 1 is put right.
    #[serde(serialize_with = "json::numbers")]
    pub rotation: [f32; 4],
    /// Along the node's axes; the size of each lies in [`SCALE_RANGE`].
    #[serde(serialize_with = "json::numbers")]
    pub scale: [f32; 3],
}

/// Colour and intensity that a light has been given.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightSetting {
    /// Linear RGB, each 0 … [`MAX_COLOR`].
    #[serde(serialize_with = "json::numbers")]
    pub color: [f32; 3],
    /// Candela for point and spot, lux for directional; 0 … [`MAX_INTENSITY`].
    #[serde(serialize_with = "json::number")]
    pub intensity: f32,
}

/// One change. As JSON an object whose `edit` says which, for example `{"edit":"remove","instance":3}`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "edit", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Edit {
    /// A node stands there from now on, whatever its animation says; what hangs from it comes along.
    Place {
        /// Index into [`Scene::nodes`].
        node: u32,
        /// Where.
        placement: Placement,
    },
    /// A node stands again where the file and its animation put it.
    Release {
        /// Index into [`Scene::nodes`].
        node: u32,
    },
    /// An instance is no longer there: it is not drawn and blocks nothing. What hangs from its node stays.
    Remove {
        /// Index into [`Scene::instances`].
        instance: u32,
    },
    /// An instance is there again, or a spare for the first time.
    Restore {
        /// Index into [`Scene::instances`].
        instance: u32,
    },
    /// A light shines like this from now on.
    Light {
        /// Index into [`Scene::lights`]; all nodes that carry it.
        light: u32,
        /// As [`LightSetting::color`].
        #[serde(serialize_with = "json::numbers")]
        color: [f32; 3],
        /// As [`LightSetting::intensity`].
        #[serde(serialize_with = "json::number")]
        intensity: f32,
    },
    /// A light shines again as in the file.
    ResetLight {
        /// Index into [`Scene::lights`].
        light: u32,
    },
    /// Everything is as at first: spares are gone, all else is as in the file.
    Reset,
}

/// The present state of a scene's edits. Plain data: what came from elsewhere is to be put through [`Edits::check`].
///
/// As JSON: `{"placed":[{"node":…,"placement":{…}}],"removed":[…],"lights":[{"light":…,"color":…,"intensity":…}]}`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "json::EditsForm", from = "json::EditsForm")]
pub struct Edits {
    /// Nodes that stand elsewhere than the file and its animation say.
    pub placed: BTreeMap<u32, Placement>,
    /// Instances that are not there.
    pub removed: BTreeSet<u32>,
    /// Lights that shine otherwise than in the file.
    pub lights: BTreeMap<u32, LightSetting>,
}

impl Placement {
    /// The same with a rotation of unit length, as it counts. Normalising it again changes no bit.
    pub fn normalized(&self) -> Placement {
        let length_squared = length_squared(&self.rotation);
        if (length_squared - 1.0).abs() <= IS_UNIT || length_squared <= 0.0 {
            return *self;
        }
        // Square roots and quotients are the same on every machine.
        let length = length_squared.sqrt();
        Placement { rotation: self.rotation.map(|x| (f64::from(x) / length) as f32), ..*self }
    }

    /// As a node's own transform.
    pub fn local(&self) -> LocalTransform {
        LocalTransform::Trs {
            translation: Vec3::from_array(self.translation),
            rotation: Quat::from_array(self.rotation),
            scale: Vec3::from_array(self.scale),
        }
    }

    fn check(&self, node: u32) -> Result<(), EditError> {
        let Placement { translation, rotation, scale } = *self;
        // Comparisons with what is no number fail.
        if !translation.iter().all(|x| x.abs() <= MAX_TRANSLATION) {
            return Err(EditError::Translation { node, translation });
        }
        let length = length_squared(&rotation).sqrt();
        if !(1.0 - ROTATION_TOLERANCE..=1.0 + ROTATION_TOLERANCE).contains(&length) {
            return Err(EditError::Rotation { node, rotation });
        }
        if !scale.iter().all(|x| SCALE_RANGE.contains(&x.abs())) {
            return Err(EditError::Scale { node, scale });
        }
        Ok(())
    }
}

fn length_squared(rotation: &[f32; 4]) -> f64 {
    rotation.iter().map(|x| f64::from(*x) * f64::from(*x)).sum()
}

impl LightSetting {
    fn check(&self, light: u32) -> Result<(), EditError> {
        let LightSetting { color, intensity } = *self;
        if !color.iter().all(|x| (0.0..=MAX_COLOR).contains(x)) {
            return Err(EditError::Color { light, color });
        }
        if !(0.0..=MAX_INTENSITY).contains(&intensity) {
            return Err(EditError::Intensity { light, intensity });
        }
        Ok(())
    }
}

impl Edit {
    /// The same with numbers as [`Edits::apply`] keeps them; applying one or the other comes to the same, to the bit.
    pub fn normalized(&self) -> Edit {
        match *self {
            Edit::Place { node, placement } => Edit::Place { node, placement: placement.normalized() },
            edit => edit,
        }
    }
}

impl Edits {
    /// As at first: nothing is changed, spares are not there.
    pub fn new(scene: &Scene) -> Edits {
        let spares = (0..).zip(&scene.instances).filter(|(_, instance)| instance.spare);
        Edits { placed: BTreeMap::new(), removed: spares.map(|(i, _)| i).collect(), lights: BTreeMap::new() }
    }

    /// Makes one change. What changes nothing is no error.
    ///
    /// # Errors
    /// What does not exist in `scene`, numbers out of their ranges, and places from where what hangs from a node cannot be
    /// computed at time 0. Then nothing has changed.
    pub fn apply(&mut self, scene: &Scene, edit: &Edit) -> Result<(), EditError> {
        match *edit {
            Edit::Place { node, placement } => {
                check_node(scene, node)?;
                placement.check(node)?;
                let before = self.placed.insert(node, placement.normalized());
                self.bearable(scene).inspect_err(|_| self.put_back(node, before))?;
            }
            Edit::Release { node } => {
                check_node(scene, node)?;
                let before = self.placed.remove(&node);
                self.bearable(scene).inspect_err(|_| self.put_back(node, before))?;
            }
            Edit::Remove { instance } => {
                check_instance(scene, instance)?;
                self.removed.insert(instance);
            }
            Edit::Restore { instance } => {
                check_instance(scene, instance)?;
                self.removed.remove(&instance);
            }
            Edit::Light { light, color, intensity } => {
                check_light(scene, light)?;
                let setting = LightSetting { color, intensity };
                setting.check(light)?;
                self.lights.insert(light, setting);
            }
            Edit::ResetLight { light } => {
                check_light(scene, light)?;
                self.lights.remove(&light);
            }
            Edit::Reset => *self = Edits::new(scene),
        }
        Ok(())
    }

    /// Whether this can be a state of the scene's edits: everything that came from elsewhere must pass before it is used. What
    /// passes is no larger than the scene's lists.
    ///
    /// # Errors
    /// As [`Edits::apply`], for the first thing that is wrong.
    pub fn check(&self, scene: &Scene) -> Result<(), EditError> {
        for (&node, placement) in &self.placed {
            check_node(scene, node)?;
            placement.check(node)?;
        }
        for &instance in &self.removed {
            check_instance(scene, instance)?;
        }
        for (&light, setting) in &self.lights {
            check_light(scene, light)?;
            setting.check(light)?;
        }
        self.bearable(scene)
    }

    /// The first instance that is not there and looks like this one once it is: of the same mesh, laid with points alike.
    /// To add another like it, place its node and restore it. `None` if none is left (see [`Scene::add_spares`]), or there is
    /// no such instance.
    pub fn free_like(&self, scene: &Scene, instance: u32) -> Option<u32> {
        let model = scene.instances.get(instance as usize)?;
        let is_like = |i: &u32| {
            scene.instances.get(*i as usize).is_some_and(|other| {
                (other.mesh, other.skin, other.casts, other.receives, other.emitter)
                    == (model.mesh, model.skin, model.casts, model.receives, model.emitter)
                    && other.rest_from_mesh == model.rest_from_mesh
            })
        };
        self.removed.iter().copied().find(is_like)
    }

    fn put_back(&mut self, node: u32, before: Option<Placement>) {
        match before {
            Some(placement) => self.placed.insert(node, placement),
            None => self.placed.remove(&node),
        };
    }

    /// Whether everything that hangs from placed nodes can be placed at time 0.
    fn bearable(&self, scene: &Scene) -> Result<(), EditError> {
        if self.placed.is_empty() {
            return Ok(());
        }
        let mut by: Vec<Option<u32>> = Vec::with_capacity(scene.nodes.len());
        let world = scene.node_transforms(&scene.animate(0.0), self);
        for (i, (node, world)) in (0..).zip(scene.nodes.iter().zip(world)) {
            let inherited = node.parent.and_then(|parent| by[parent as usize]);
            let placed = if self.placed.contains_key(&i) { Some(i) } else { inherited };
            by.push(placed);
            if let Some(placed) = placed.filter(|_| !world.is_finite()) {
                return Err(EditError::Unbearable { node: placed, descendant: i });
            }
        }
        Ok(())
    }
}

fn check_node(scene: &Scene, node: u32) -> Result<(), EditError> {
    let nodes = scene.nodes.len();
    if (node as usize) < nodes { Ok(()) } else { Err(EditError::NoNode { node, nodes }) }
}

fn check_instance(scene: &Scene, instance: u32) -> Result<(), EditError> {
    let instances = scene.instances.len();
    if (instance as usize) < instances { Ok(()) } else { Err(EditError::NoInstance { instance, instances }) }
}

fn check_light(scene: &Scene, light: u32) -> Result<(), EditError> {
    let lights = scene.lights.len();
    if (light as usize) < lights { Ok(()) } else { Err(EditError::NoLight { light, lights }) }
}
