//! Messages that are text: JSON objects, small ones.

use dapple_scene::glam::{Affine3A, Mat3, Vec3};
use dapple_scene::{Edit, Edits, PosedCamera, Projection};
use serde::{Deserialize, Serialize};

use crate::SceneClock;

/// Version of the conversation that this end speaks.
pub const PROTOCOL: u32 = 1;

/// Longest message of a viewer, bytes.
pub const MAX_FROM_VIEWER_BYTES: usize = 16 << 10;

/// Most parts of the light.
pub const MAX_PARTS: usize = 256;

/// Longest text of a host that a viewer takes, bytes: the edits of some 10,000 instances.
pub const MAX_FROM_HOST_BYTES: usize = 4 << 20;

/// Why a message was not understood.
#[derive(Debug, thiserror::Error)]
pub enum MessageError {
    /// It is longer than this end takes.
    #[error("a message of {bytes} bytes is longer than the {limit} that are taken")]
    TooLong {
        /// Its length.
        bytes: usize,
        /// The most that is taken.
        limit: usize,
    },
    /// It is none of the messages, or not JSON.
    #[error("not a message of protocol {PROTOCOL}: {0}")]
    Malformed(#[from] serde_json::Error),
    /// A number in it is out of range.
    #[error("{0}")]
    OutOfRange(&'static str),
    /// Light that is cut off or contradicts itself.
    #[error("light: {0}")]
    Light(&'static str),
}

/// What a viewer says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "kebab-case")]
pub enum FromViewer {
    /// The first message.
    Hello(Hello),
    /// How it looks at the scene, and what it holds: the newest replaces all before.
    Look(Look),
    /// Something that is to change the scene, for all viewers.
    Event {
        /// Counts a viewer's events, from 1. What is not answered is said again, also over a new connection.
        number: u32,
        /// What is to happen.
        event: Event,
    },
    /// It leaves for good.
    Bye,
}

impl FromViewer {
    /// Reads a message, with every number in range.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn parse(text: &str) -> Result<FromViewer, MessageError> {
        check_length(text, MAX_FROM_VIEWER_BYTES)?;
        let message: FromViewer = serde_json::from_str(text)?;
        if let FromViewer::Look(look) = &message {
            look.camera.as_ref().map_or(Ok(()), LookCamera::check)?;
            if look.parts.as_ref().is_some_and(|parts| parts.len() > MAX_PARTS) {
                return Err(MessageError::OutOfRange("a viewer sees at most 256 parts"));
            }
        }
        if let FromViewer::Event { event: Event::Seek { time_s }, .. } = &message
            && !(0.0..=SceneClock::MAX_TIME_S).contains(time_s)
        {
            return Err(MessageError::OutOfRange("a time to go to must be 0 to 1,000,000 seconds"));
        }
        Ok(message)
    }
}

/// How a viewer introduces itself.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hello {
    /// [`PROTOCOL`].
    pub protocol: u32,
    /// Version of frames of light that it reads.
    pub wire: u8,
    /// The scene that it has loaded, its hash as 64 hexadecimal digits.
    pub scene: String,
    /// What gives it its role, where the host asks for that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub token: Option<String>,
    /// The key of its last welcome, to go on after a broken connection.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub key: Option<String>,
    /// The light that it holds from before.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held: Option<Held>,
    /// Most bits of light a second that it wants, on average over seconds; snapshots are not counted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bits_per_s: Option<u64>,
}

/// The state of the light that a viewer holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Held {
    /// Its group.
    pub group: u64,
    /// Its epoch.
    pub epoch: u64,
}

/// How a viewer looks, and what has come.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Look {
    /// Counts them, over all connections; one with a number that is not above the last is ignored.
    pub number: u64,
    /// Its camera; `None` for one that looks at nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<LookCamera>,
    /// The light that it holds. `None`: nothing, or nothing that deltas could build on, so that a snapshot is needed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held: Option<Held>,
    /// Version of the scene's state that it holds, 0 for none.
    #[serde(default)]
    pub state: u64,
    /// Moment of the host's clock (microseconds) of the newest light that came whole.
    #[serde(default)]
    pub heard_us: u64,
    /// Microseconds between its coming and this message.
    #[serde(default)]
    pub waited_us: u64,
    /// Bytes of light that came over this connection, heads included.
    #[serde(default)]
    pub came: u64,
    /// How often, over this connection, something was missing that light built on.
    #[serde(default)]
    pub lost: u32,
    /// The parts of the light that it sees, ascending, at most [`MAX_PARTS`]; `None` where it was told of none ([`Welcome::parts`]).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parts: Option<Vec<u8>>,
}

/// A camera in the world.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LookCamera {
    /// Where it is, metres.
    pub eye: [f32; 3],
    /// Direction that it looks in, of any length.
    pub forward: [f32; 3],
    /// Direction that is up in the picture, of any length.
    pub up: [f32; 3],
    /// Vertical field of view, radians, above 0 and below π.
    pub yfov: f32,
    /// Width of the picture divided by its height, 0.05 to 20.
    pub aspect: f32,
}

impl LookCamera {
    /// Of a camera that is drawn with; parallel projections are told as a narrow view from their place.
    pub fn of(camera: &PosedCamera, aspect: f32) -> LookCamera {
        let matrix = camera.world_from_view.matrix3;
        let yfov = match camera.projection {
            Projection::Perspective { yfov, .. } => yfov,
            Projection::Orthographic { .. } => 0.5,
        };
        LookCamera {
            eye: camera.eye_world().to_array(),
            forward: (-Vec3::from(matrix.z_axis)).to_array(),
            up: Vec3::from(matrix.y_axis).to_array(),
            yfov,
            aspect: aspect.clamp(0.05, 20.0),
        }
    }

    pub(crate) fn check(&self) -> Result<(), MessageError> {
        let numbers = [self.eye, self.forward, self.up];
        let usable = numbers.iter().flatten().all(|number| number.is_finite() && number.abs() <= 1e6);
        if !(usable && self.axes().is_some()) {
            return Err(MessageError::OutOfRange(
                "a camera's eye, forward and up must be finite, and its directions must not be parallel",
            ));
        }
        if !(self.yfov > 0.0 && self.yfov < std::f32::consts::PI && (0.05..=20.0).contains(&self.aspect)) {
            return Err(MessageError::OutOfRange(
                "a camera's field of view must be above 0 and below π radians, its aspect 0.05 to 20",
            ));
        }
        Ok(())
    }

    fn axes(&self) -> Option<Mat3> {
        let back = -Vec3::from(self.forward).try_normalize()?;
        let right = Vec3::from(self.up).try_normalize()?.cross(back).try_normalize()?;
        Some(Mat3::from_cols(right, back.cross(right), back))
    }

    /// As a camera to draw with.
    pub fn posed(&self) -> PosedCamera {
        PosedCamera {
            world_from_view: Affine3A::from_mat3_translation(
                self.axes().unwrap_or(Mat3::IDENTITY),
                self.eye.into(),
            ),
            projection: Projection::Perspective { yfov: self.yfov, near: 0.02 },
        }
    }
}

/// What a viewer may want to happen to the scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "kebab-case")]
pub enum Event {
    /// An edit as it is.
    Edit {
        /// Which.
        change: Edit,
    },
    /// Another instance like this one, from those that are not there now: spare or removed ones.
    Add {
        /// The instance that it is to be like.
        like: u32,
        /// Where.
        placement: dapple_scene::Placement,
    },
    /// Scene time runs.
    Play,
    /// Scene time stands still.
    Pause,
    /// Scene time goes to a moment.
    Seek {
        /// Seconds, 0 to [`SceneClock::MAX_TIME_S`].
        time_s: f64,
    },
}

/// What a host says in text.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "kebab-case")]
pub enum FromHost {
    /// The answer to a hello.
    Welcome(Welcome),
    /// The last message before it closes the connection.
    Refused(Refusal),
    /// The scene's whole state.
    State {
        /// Counts its changes, from 1.
        version: u64,
        /// The scene's time.
        clock: SceneClock,
        /// Everything that was changed.
        edits: Edits,
    },
    /// What led from one version of the state to another.
    Changes {
        /// The version that it builds on.
        from: u64,
        /// The version that it leads to.
        to: u64,
        /// The scene's time.
        clock: SceneClock,
        /// In this order.
        edits: Vec<Edit>,
    },
    /// All events of the viewer up to this number have been dealt with.
    Heard {
        /// The number.
        number: u32,
    },
    /// One of the viewer's events changed nothing.
    Rejected {
        /// Its number.
        number: u32,
        /// Why.
        message: String,
    },
    /// How the host is, about once a second.
    Status(Status),
}

impl FromHost {
    /// Reads a message.
    ///
    /// # Errors
    /// What is wrong with it. Edits have yet to be checked against the scene.
    pub fn parse(text: &str) -> Result<FromHost, MessageError> {
        check_length(text, MAX_FROM_HOST_BYTES)?;
        Ok(serde_json::from_str(text)?)
    }

    /// As text.
    pub fn to_text(&self) -> String {
        serde_json::to_string(self).expect("every message is JSON")
    }
}

impl FromViewer {
    /// As text.
    pub fn to_text(&self) -> String {
        serde_json::to_string(self).expect("every message is JSON")
    }
}

/// Lets a viewer in. Unknown fields are left to later versions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Welcome {
    /// [`PROTOCOL`].
    pub protocol: u32,
    /// Number of the viewer.
    pub viewer: u64,
    /// Secret with which it may go on after a broken connection.
    pub key: String,
    /// What it may do.
    pub role: Role,
    /// Updates a second.
    pub hz: f64,
    /// Number of its last event that was dealt with, 0 for none.
    pub heard: u32,
    /// Whether light goes on from what the viewer holds. If not, what it holds is of no use: its groups and epochs are another stream's.
    pub goes_on: bool,
    /// Most bits of light that it is sent in any second; `None`: as many as it takes.
    pub bits_per_s: Option<u64>,
    /// Most events a second.
    pub events_per_s: u32,
    /// The host's clock as it says this, microseconds, and the same moment in microseconds since 1970.
    pub clock_us: u64,
    /// See `clock_us`.
    pub unix_us: u64,
    /// Where the light can be had in parts: which instances each has, as ranges of their numbers (the first, and the one after the last). Empty where it
    /// comes as one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parts: Vec<Vec<[u32; 2]>>,
}

/// What a viewer may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Look.
    View,
    /// Look, and send events.
    Interact,
}

/// A no, with its reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
#[error("{message}")]
pub struct Refusal {
    /// For programs.
    pub reason: Reason,
    /// For people: what, and what to do.
    pub message: String,
}

impl Refusal {
    pub(crate) fn new(reason: Reason, message: impl Into<String>) -> Refusal {
        Refusal { reason, message: message.into() }
    }
}

/// What both ends must agree on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Terms<'a> {
    /// Version of the conversation.
    pub protocol: u32,
    /// Version of the frames of light.
    pub wire: u8,
    /// The scene's hash, 64 hexadecimal digits.
    pub scene: &'a str,
}

impl Terms<'_> {
    /// Why a viewer with these terms cannot be one of a host with those; `None` where it can.
    pub fn refusal(self, host: Terms<'_>) -> Option<Refusal> {
        if (self.protocol, self.wire) != (host.protocol, host.wire) {
            let message = format!(
                "the viewer speaks protocol {} with frames of version {}, the host {} and {}: reload the page, or use a viewer of the host's \
                 own version",
                self.protocol, self.wire, host.protocol, host.wire
            );
            return Some(Refusal::new(Reason::Version, message));
        }
        if !self.scene.eq_ignore_ascii_case(host.scene) {
            let message = format!(
                "the viewer has loaded scene {:.16}, the host lights {:.16}: fetch the scene anew",
                self.scene, host.scene
            );
            return Some(Refusal::new(Reason::Scene, message));
        }
        None
    }
}

/// Which of several streams a viewer gets, of those that have budgets of so many bits a second (`None` for none), from the richest to the leanest: the
/// richest within its wish, or else the leanest.
pub fn stream_within(bits_per_s: &[Option<u64>], wish: Option<u64>) -> usize {
    let Some(wish) = wish else { return 0 };
    let within = |bits: &Option<u64>| bits.is_some_and(|bits| bits <= wish);
    bits_per_s.iter().position(within).unwrap_or(bits_per_s.len().saturating_sub(1))
}

/// Kinds of refusals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reason {
    /// Another version of the conversation, or of frames.
    Version,
    /// It has loaded another scene.
    Scene,
    /// No token, or a wrong one.
    Token,
    /// There are as many viewers as there may be.
    Full,
    /// A message that is none, or that comes out of turn.
    Malformed,
    /// Too many messages.
    TooMany,
    /// No message for too long.
    Silent,
    /// It came again over another connection.
    Replaced,
    /// The host ends.
    Closing,
}

impl Reason {
    /// Whether the same viewer may succeed later without doing anything else.
    pub fn may_retry(self) -> bool {
        matches!(self, Reason::Full | Reason::Silent | Reason::Closing | Reason::TooMany)
    }
}

/// Figures for an overlay.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// Viewers now.
    pub viewers: u32,
    /// What the last step took, microseconds.
    pub step_us: u64,
    /// How long this viewer's last light lay at the host after it was made, microseconds.
    pub queue_us: u64,
    /// From the host to the viewer and back, microseconds; 0 where it is not known yet.
    pub round_trip_us: u64,
    /// Rays that a step may take; 0 for no limit.
    pub ray_budget: u64,
    /// Points that wait for rays, or for bits.
    pub waiting: u32,
    /// How much of the first light there is, per mille; 1000 once it is there.
    #[serde(default)]
    pub started: u32,
}

pub(crate) fn check_length(text: &str, limit: usize) -> Result<(), MessageError> {
    if text.len() > limit {
        return Err(MessageError::TooLong { bytes: text.len(), limit });
    }
    Ok(())
}
