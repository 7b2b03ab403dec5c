//! Things in the picture: which is where the pointer is, and moving it, for all viewers of a live session.

use dapple_client::viewer::Viewer;
use dapple_scene::glam::Vec3;
use dapple_scene::{Edit, Edits, Placement, Pose, PosedCamera, Scene};
use dapple_session::Event;
use wasm_bindgen::prelude::*;

use crate::core::{Core, Shown, object};
use crate::grab::{Grab, Way, moved, placement_of};

/// What is larger than this part of the scene is what the rest stands in: a hand does not take hold of it.
const LARGEST: f32 = 0.5;

/// Another of something is put so many of its diagonals away.
const BESIDE: f32 = 0.8;

/// Radians from one added thing to the next around what they are like: no two directions are alike.
const TURN: f32 = 2.399_963;

/// What the reader's hand holds.
#[derive(Default)]
pub(crate) struct Hand {
    grab: Option<Grab>,
    added: u32,
}

#[wasm_bindgen]
impl Core {
    /// What is seen at a place of the picture, in pixels from its top left corner: `{ instance, node, name, position }`, or null.
    pub fn pick(&self, x: f32, y: f32) -> JsValue {
        let Some(picked) = self.picked(x, y) else { return JsValue::NULL };
        self.describe(picked.instance, picked.position_world)
    }

    /// Takes hold of what is seen at a place of the picture, as `pick`; null if there is nothing, or what all the rest stands in.
    pub fn grab(&mut self, x: f32, y: f32) -> JsValue {
        self.hand.grab = None;
        let Some(picked) = self.picked(x, y) else { return JsValue::NULL };
        let Some(Shown { scene, viewer }) = &self.shown else { return JsValue::NULL };
        let pose = scene.pose_edited(self.clock.time_s(), viewer.edits());
        let size_m = scene.instance_bounds_world(&pose, picked.instance as usize).diagonal();
        if size_m > LARGEST * self.steering.diagonal_m() {
            return JsValue::NULL;
        }
        self.hand.grab = Grab::new(scene, viewer.edits(), &pose, picked.node, picked.position_world);
        if self.hand.grab.is_none() {
            return JsValue::NULL;
        }
        self.describe(picked.instance, picked.position_world)
    }

    /// Asks for what is held to be under a place of the picture: over the horizontal plane, or up and down. False if it stays.
    pub fn drag(&mut self, x: f32, y: f32, upright: bool) -> Result<bool, JsError> {
        let (Some(camera), Some(mut grab)) = (self.camera_now(), self.hand.grab) else { return Ok(false) };
        let way = if upright { Way::Upright } else { Way::Across };
        if !grab.drag(&camera, self.size(), (x, y), way) {
            return Ok(false);
        }
        self.hand.grab = Some(grab);
        self.send(Event::Edit { change: Edit::Place { node: grab.node, placement: grab.placement } })?;
        Ok(true)
    }

    /// Lets go of what is held.
    pub fn release(&mut self) {
        self.hand.grab = None;
    }

    /// Where a node stands to its parent: `{ translation, rotation, scale }`; null for one that is not there.
    pub fn placement(&self, node: u32) -> JsValue {
        let placement =
            self.posed().and_then(|(scene, viewer, pose)| placement_of(scene, viewer.edits(), &pose, node));
        placement.map_or(JsValue::NULL, |placement| placement_object(&placement))
    }

    /// A place beside an instance for another like it, as `placement`; null for one that is not there.
    #[wasm_bindgen(js_name = placeBeside)]
    pub fn place_beside(&mut self, instance: u32) -> JsValue {
        self.hand.added += 1;
        let turn = TURN * self.hand.added as f32;
        let beside = self.posed().and_then(|(scene, viewer, pose)| {
            let node = scene.instances.get(instance as usize)?.node;
            let bounds = scene.instance_bounds_world(&pose, instance as usize);
            let size_m = if bounds.diagonal().is_finite() { bounds.diagonal() } else { 0.0 };
            let way = BESIDE * size_m * Vec3::new(turn.cos(), 0.0, turn.sin());
            moved(scene, &pose, node, &placement_of(scene, viewer.edits(), &pose, node)?, way)
        });
        beside.map_or(JsValue::NULL, |placement| placement_object(&placement))
    }

    /// Whether there is an instance like this one that is not there now: a spare, or one that was removed.
    #[wasm_bindgen(js_name = canAdd)]
    pub fn can_add(&self, instance: u32) -> bool {
        let Some(Shown { scene, viewer }) = &self.shown else { return false };
        viewer.edits().free_like(scene, instance).is_some()
    }

    /// Whether anything of the scene differs from how it was loaded.
    #[wasm_bindgen(js_name = isEdited)]
    pub fn is_edited(&self) -> bool {
        let Some(Shown { scene, viewer }) = &self.shown else { return false };
        *viewer.edits() != Edits::new(scene)
    }

    /// Whether an instance is there now.
    #[wasm_bindgen(js_name = isThere)]
    pub fn is_there(&self, instance: u32) -> bool {
        let Some(Shown { scene, viewer }) = &self.shown else { return false };
        (instance as usize) < scene.instances.len() && !viewer.edits().removed.contains(&instance)
    }
}

impl Core {
    /// From where the scene is shown now.
    pub(crate) fn camera_now(&self) -> Option<PosedCamera> {
        let scene = &self.shown.as_ref()?.scene;
        Some(self.steering.camera(scene, self.clock.time_s()))
    }

    fn picked(&self, x: f32, y: f32) -> Option<dapple_client::Picked> {
        let viewer = &self.shown.as_ref()?.viewer;
        viewer.pick(&self.camera_now()?, self.size(), (x, y), self.clock.time_s())
    }

    fn posed(&self) -> Option<(&Scene, &Viewer, Pose)> {
        let Shown { scene, viewer } = self.shown.as_ref()?;
        Some((scene, viewer, scene.pose_undeformed_edited(self.clock.time_s(), viewer.edits())))
    }

    fn describe(&self, instance: u32, position_world: Vec3) -> JsValue {
        let Some(shown) = &self.shown else { return JsValue::NULL };
        let node = shown.scene.instances[instance as usize].node;
        object(&[
            ("instance", instance.into()),
            ("node", node.into()),
            ("name", shown.scene.nodes[node as usize].name.as_str().into()),
            ("position", numbers(&position_world.to_array())),
        ])
    }
}

fn placement_object(placement: &Placement) -> JsValue {
    object(&[
        ("translation", numbers(&placement.translation)),
        ("rotation", numbers(&placement.rotation)),
        ("scale", numbers(&placement.scale)),
    ])
}

fn numbers(values: &[f32]) -> JsValue {
    values.iter().map(|value| JsValue::from(*value)).collect::<js_sys::Array>().into()
}
