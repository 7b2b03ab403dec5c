//! What can be wrong with a scene or a frame for the card.

use crate::RenderError;

/// Why something cannot be put on the card or drawn there.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ForwardError {
    /// The same as without a card.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A mesh does not fit a buffer.
    #[error(
        "mesh {mesh} ({name:?}) needs {bytes} bytes in one buffer and the device allows {limit}: split the mesh, or \
         use a device with more memory"
    )]
    MeshTooLarge {
        /// Index of the mesh.
        mesh: usize,
        /// Its name.
        name: String,
        /// Bytes it may need.
        bytes: u64,
        /// Bytes there may be.
        limit: u64,
    },
    /// Skins and morph targets do not fit a texture.
    #[error(
        "skins and morph targets of the scene need {texels} texels and the device allows {limit}: leave out morph \
         targets, or use a device with larger textures"
    )]
    DeformationTooLarge {
        /// Texels needed.
        texels: usize,
        /// Texels there may be.
        limit: usize,
    },
    /// The atlas does not fit a texture.
    #[error(
        "an atlas of {layers} layers of {side}x{side} texels does not fit: the device allows sides up to {max_side} \
         and {max_layers} layers; make texels larger or layers smaller"
    )]
    AtlasTooLarge {
        /// Texels along a side.
        side: u32,
        /// Layers.
        layers: u32,
        /// Longest side.
        max_side: u32,
        /// Most layers.
        max_layers: u32,
    },
    /// Texels of a layer are not as many as its side says.
    #[error("a layer of the atlas has {found} texels where {expected} are needed: give all its rows")]
    AtlasLength {
        /// How many there are.
        found: usize,
        /// How many there must be.
        expected: usize,
    },
    /// Charts that do not fit the instances they are given to.
    #[error("charts for instance {instance}: {reason}; make them for the mesh of the instance that is drawn")]
    Charts {
        /// Index of the (first) instance.
        instance: u32,
        /// What does not fit.
        reason: &'static str,
    },
    /// A request that the pass was not made for.
    #[error("cannot draw: {reason}")]
    Frame {
        /// What is wrong and what to do.
        reason: &'static str,
    },
}
