//! Arguments of `dapple bake`.

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, ValueEnum};

use super::{Radius, SceneChoice};

pub(crate) const BAKE_EXAMPLES: &str = "\
Examples:
  dapple bake room.glb -o baked.glb                         an occlusion texture
  dapple bake room.glb --into vertex -o baked.glb           vertex colours
  dapple bake statue.obj --radius auto -o statue.glb
  dapple bake room.glb --uv 0 --texture-size 2048 --rays 1024 --radius 1.5 -o room.glb
  dapple bake room.glb -o points.ply -o room.dapple         points with their visibility

Viewers multiply an occlusion texture into indirect light only; vertex colours multiply all light. A .dapple belongs to the scene
as it was given, not to a .glb baked beside it: to players that is another scene. docs/baking.md says more.";

#[derive(Debug, Clone, Args)]
pub(crate) struct BakeArgs {
    #[command(flatten)]
    pub(crate) scene: SceneChoice,
    /// The file to write: .glb or .gltf for the scene with what was baked, .ply or .dapple for points. May be given several times,
    /// and may be the scene itself.
    #[arg(short, long, value_name = "FILE", required = true)]
    pub(crate) output: Vec<PathBuf>,
    /// Where visibility goes in a scene.
    #[arg(long, value_enum, default_value = "texture")]
    pub(crate) into: Into,
    /// Attribute that visibility at vertices goes to: COLOR_0 (multiplied into the colours there are, and so into all
    /// light), or a name of your own such as _VISIBILITY (one float).
    #[arg(long, value_name = "NAME", default_value = "COLOR_0")]
    pub(crate) attribute: Attribute,
    /// Set of texture coordinates that a texture is laid out in.
    #[arg(long, value_enum, default_value = "auto")]
    pub(crate) uv: Uv,
    /// Longest side of an image in texels, 16 to 16384. One image holds all new coordinates if texels can be as coarse as
    /// that needs.
    #[arg(long, value_name = "N", default_value_t = 4096)]
    pub(crate) texture_size: u32,
    /// Edge of a texel in metres, 0.000001 to 10000, on as many images as that needs, up to 64 [default: what fits one image; a 12th of the radius if
    /// there is room, finer for small scenes].
    #[arg(long, value_name = "METRES", allow_hyphen_values = true)]
    pub(crate) texel: Option<f64>,
    /// Texels that stay free around each piece of surface in new coordinates, 1 to 64.
    #[arg(long, value_name = "N", default_value_t = 2)]
    pub(crate) margin: u32,
    /// Store where light comes from, too: the mean open direction, as the attribute _BENT_NORMAL or a second texture.
    #[arg(long)]
    pub(crate) bent_normals: bool,
    /// What instances of one mesh get.
    #[arg(long, value_enum, default_value = "split")]
    pub(crate) instances: Instances,
    /// Rays a texel, vertex or point, 1 to 65536.
    #[arg(long, value_name = "N", default_value_t = 256)]
    pub(crate) rays: u32,
    /// Occlusion distance in metres, or `auto`: 2 % of the scene's diagonal, for files that are not in metres (points are then
    /// counted per (radius / 0.6)² instead of per m²).
    #[arg(long, value_name = "METRES|auto", default_value = "0.6", allow_hyphen_values = true)]
    pub(crate) radius: Radius,
    /// Points spawned a square metre, half of which are kept (.ply, .dapple); places a square metre that vertices are
    /// fitted to.
    #[arg(long, value_name = "N", default_value_t = 512.0, allow_hyphen_values = true)]
    pub(crate) points: f32,
    /// Seconds into the animation at which things stand as they are baked [default: as the file has them, without
    /// animation; points: 0].
    #[arg(long, value_name = "T", allow_hyphen_values = true)]
    pub(crate) time: Option<f64>,
    /// Seed of all random numbers.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u32,
    /// Threads; 0 is one for each core.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) threads: usize,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Into {
    /// An occlusionTexture, which dims indirect light alone.
    Texture,
    /// An attribute of vertices.
    Vertex,
    /// Both.
    Both,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Instances {
    /// Copies of the mesh where light differs noticeably.
    Split,
    /// One bake for all, the mean.
    Share,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Uv {
    /// The second set, else the first, where no surfaces overlap in it; a new one where they do.
    Auto,
    /// The first set where nothing overlaps in it, else a new one.
    #[value(name = "0")]
    First,
    /// The second set where nothing overlaps in it, else a new one.
    #[value(name = "1")]
    Second,
    /// A new set, behind those there are.
    New,
}

/// A name for an attribute of vertices.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Attribute {
    Color,
    Own(String),
}

impl FromStr for Attribute {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let is_own = s.strip_prefix('_').is_some_and(|rest| {
            !rest.is_empty() && rest.chars().all(|c| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_')
        });
        match s {
            "COLOR_0" => Ok(Attribute::Color),
            "_BENT_NORMAL" => Err("that is where --bent-normals goes; choose another name".into()),
            _ if is_own && s.len() <= 64 => Ok(Attribute::Own(s.to_owned())),
            _ => Err(
                "write COLOR_0, or a name of your own: _ and then capitals, digits and _, as in _VISIBILITY"
                    .into(),
            ),
        }
    }
}
