//! What a host and its workers say: each worker lights some instances of the scene, in step with the host.
//!
//! A worker's light goes up as messages of light ([`LightHead`](crate::LightHead), frames of its own publisher), everything else is text.

use dapple_scene::Edits;
use serde::{Deserialize, Serialize};

use crate::message::{MAX_FROM_HOST_BYTES, MAX_FROM_VIEWER_BYTES, check_length};
use crate::{LookCamera, MessageError, Refusal};

/// What a worker says in text.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "kebab-case")]
pub enum FromWorker {
    /// The first message.
    Hello(WorkerHello),
    /// A step is done, and its light was sent before this.
    Done(StepDone),
}

/// How a worker introduces itself.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorkerHello {
    /// [`PROTOCOL`](crate::PROTOCOL).
    pub protocol: u32,
    /// Version of frames of light that it writes.
    pub wire: u8,
    /// The scene that it has loaded, its hash as 64 hexadecimal digits.
    pub scene: String,
    /// Which part of the instances it lights, from 0, and of how many.
    pub shard: u32,
    /// See `shard`.
    pub of: u32,
    /// What lets it in, where the host asks for that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub token: Option<String>,
}

/// What a step of a worker did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepDone {
    /// The step's moment, as the host named it.
    pub stamp_us: u64,
    /// Rays traced.
    pub rays: u64,
    /// Points whose visibility changed.
    pub changed: u32,
    /// Points that wait for rays.
    pub waiting: u32,
    /// Points that it lights.
    pub points: u32,
}

/// What a host says to a worker.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "kebab-case")]
pub enum ToWorker {
    /// How it is to light: the answer to a hello.
    Setup(Setup),
    /// Light the scene as it is at a moment. The newest replaces those before that have not been begun.
    Step(Step),
    /// The last message before the host closes the connection.
    Refused(Refusal),
}

/// How the scene is lit; the same for all workers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Setup {
    /// Points spawned a square metre.
    pub points_per_m2: f32,
    /// Seed of all random numbers.
    pub seed: u32,
    /// Rays a point.
    pub rays: u32,
    /// Rays that a point at rest gets in time; 0 for no more.
    pub rays_still: u32,
    /// Occlusion distance, metres.
    pub radius_m: f32,
    /// Whether cuts are looked for.
    pub cuts: bool,
    /// Whether points say how much of each area light they see.
    #[serde(default)]
    pub area_lights: bool,
    /// The share of a point's irradiance, 0 … 1, below which an error of that waits; `None`: 0.1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub light_tolerance: Option<f32>,
    /// Part of the time between two steps that one may take, seconds.
    pub step_s: f64,
    /// Rays a step may take; `None` to go by `step_s`.
    pub ray_budget: Option<u64>,
}

/// One step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// The host's clock, microseconds: what comes of it is named after it.
    pub stamp_us: u64,
    /// Scene time, microseconds.
    pub scene_us: u64,
    /// Version of the scene's state.
    pub state: u64,
    /// What was changed of the scene, where the worker was not told before.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub edits: Option<Edits>,
    /// What viewers see.
    #[serde(default)]
    pub looks: Vec<LookCamera>,
}

impl FromWorker {
    /// Reads a message.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn parse(text: &str) -> Result<FromWorker, MessageError> {
        check_length(text, MAX_FROM_VIEWER_BYTES)?;
        Ok(serde_json::from_str(text)?)
    }

    /// As text.
    pub fn to_text(&self) -> String {
        serde_json::to_string(self).expect("every message is JSON")
    }
}

impl ToWorker {
    /// Reads a message. Edits have yet to be checked against the scene.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn parse(text: &str) -> Result<ToWorker, MessageError> {
        check_length(text, MAX_FROM_HOST_BYTES)?;
        let message: ToWorker = serde_json::from_str(text)?;
        if let ToWorker::Step(Step { looks, .. }) = &message {
            looks.iter().try_for_each(LookCamera::check)?;
        }
        Ok(message)
    }

    /// As text.
    pub fn to_text(&self) -> String {
        serde_json::to_string(self).expect("every message is JSON")
    }
}
