//! What both ends agree on before the first frame: geometry, materials, lights, cameras, animation.
//!
//! Conventions (glTF's): right-handed, Y up, metres, seconds, radians, linear light. Transforms are named
//! `a_from_b`; positions and directions say their space (`position_world`, `normal_rest`).
//!
//! A [`Scene`] is plain data. [`Scene::pose`] gives everything that moves at one time as a [`Pose`];
//! [`Scene::pose_edited`] gives it of a scene that viewers have changed ([`edits`]).

mod animation;
pub mod area_lights;
#[cfg(feature = "builtin")]
pub mod builtin;
mod camera;
pub mod edits;
mod hash;
mod light;
pub mod load;
mod local;
mod material;
mod mesh;
pub mod path;
mod pose;
mod posing;
mod reflectance;
mod sample;
mod scene;
mod surface;
pub mod texture;

pub use animation::{Animation, Channel, ChannelTarget, Interpolation};
pub use area_lights::EmitterShape;
pub use camera::{Camera, PosedCamera, Projection};
pub use edits::{Edit, EditError, Edits, LightSetting, Placement, Spare, SpareError};
pub use light::{Light, LightKind, PosedLight};
pub use load::{Files, LoadError, MeshOrigin, NoFiles, Origins, load, load_with_origins, read_reference};
pub use material::{AlphaMode, Filter, Image, Material, NormalTexture, Texture, TextureRef, Wrap};
pub use mesh::{Mesh, MorphTarget, Part, SkinInfluences};
pub use path::{CameraPath, CameraSource, KeyedPath};
pub use pose::{DeformedMesh, Pose, PosedInstance};
pub use reflectance::{Reflectance, ShadingPoint};
pub use scene::{Aabb, Instance, LocalTransform, Node, Scene, SceneHash, Skin, Warning};

pub use glam;
