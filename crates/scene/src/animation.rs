//! Key-framed animation of node transforms and morph weights.

/// A named set of channels that play together.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Animation {
    /// Name in the file, or a made-up one.
    pub name: String,
    /// What moves.
    pub channels: Vec<Channel>,
}

/// One animated property of one node.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Index into [`crate::Scene::nodes`].
    pub node: u32,
    /// Which property.
    pub target: ChannelTarget,
    /// Between key frames.
    pub interpolation: Interpolation,
    /// Key times in seconds, strictly increasing, at least one.
    pub times: Vec<f32>,
    /// `times.len() × width` numbers (× 3 for cubic splines: in-tangent, value, out-tangent).
    /// Width is 3, 4 (quaternion x, y, z, w) or the number of morph targets.
    pub values: Vec<f32>,
}

/// The animated property.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ChannelTarget {
    /// Node translation.
    Translation,
    /// Node rotation.
    Rotation,
    /// Node scale.
    Scale,
    /// Morph target weights of the node's mesh.
    MorphWeights,
}

/// glTF's three interpolations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// The last key holds.
    Step,
    /// Linear; spherical for rotations.
    Linear,
    /// Cubic Hermite with stored tangents.
    CubicSpline,
}

impl Animation {
    /// Time of the last key of any channel, in seconds (0 without channels).
    pub fn duration(&self) -> f32 {
        self.channels.iter().filter_map(|c| c.times.last().copied()).fold(0.0, f32::max)
    }
}
