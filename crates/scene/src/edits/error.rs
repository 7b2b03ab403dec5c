//! Why an edit was refused.

/// What is wrong with an edit, or with a state of edits.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EditError {
    /// There is no such node.
    #[error(
        "there is no node {node}: the scene has {nodes}, counted from 0; load the same scene as the server"
    )]
    NoNode {
        /// What was asked for.
        node: u32,
        /// How many there are.
        nodes: usize,
    },
    /// There is no such instance.
    #[error(
        "there is no instance {instance}: the scene has {instances}, counted from 0; load the same scene as the server"
    )]
    NoInstance {
        /// What was asked for.
        instance: u32,
        /// How many there are.
        instances: usize,
    },
    /// There is no such light.
    #[error(
        "there is no light {light}: the scene has {lights}, counted from 0; load the same scene as the server"
    )]
    NoLight {
        /// What was asked for.
        light: u32,
        /// How many there are.
        lights: usize,
    },
    /// Too far away, or not a number.
    #[error(
        "node {node} cannot be moved to {translation:?}: each number must be −1e6 to 1e6; move it less far"
    )]
    Translation {
        /// Index of the node.
        node: u32,
        /// Where it should have gone.
        translation: [f32; 3],
    },
    /// Not a rotation.
    #[error(
        "node {node} cannot be turned by {rotation:?}: a rotation is a quaternion x, y, z, w of length 1; normalise it"
    )]
    Rotation {
        /// Index of the node.
        node: u32,
        /// What was given for one.
        rotation: [f32; 4],
    },
    /// Too large or too small.
    #[error(
        "node {node} cannot be scaled by {scale:?}: the size of each number must be 0.001 to 1000; to make it vanish, \
         remove its instance"
    )]
    Scale {
        /// Index of the node.
        node: u32,
        /// What was given.
        scale: [f32; 3],
    },
    /// Not a colour.
    #[error("light {light} cannot have the colour {color:?}: each channel must be 0 to 1e6")]
    Color {
        /// Index of the light.
        light: u32,
        /// What was given.
        color: [f32; 3],
    },
    /// Not an intensity.
    #[error("light {light} cannot have the intensity {intensity}: it must be 0 to 1e9")]
    Intensity {
        /// Index of the light.
        light: u32,
        /// What was given.
        intensity: f32,
    },
    /// Transforms multiply beyond all numbers.
    #[error(
        "node {descendant} cannot be placed anywhere with node {node} where that is to go: the transforms between \
         them overflow; move or scale it less"
    )]
    Unbearable {
        /// The nearest node above it that is placed, or it itself.
        node: u32,
        /// What would be nowhere.
        descendant: u32,
    },
}
