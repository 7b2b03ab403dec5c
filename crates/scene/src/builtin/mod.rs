//! Built-in scenes, made in memory as glTF documents: the same bytes on every machine.
//!
//! ```
//! let glb = dapple_scene::builtin::glb("atrium", 0.1)?;
//! assert_eq!(&glb[..4], b"glTF");
//! # Ok::<(), dapple_scene::builtin::BuiltinError>(())
//! ```

mod atrium;
pub mod builder;
mod cornell;
mod emitters;
mod hangar;
mod joinery;
mod kit;
mod lab;
mod leaks;
mod movers;
pub mod noise;
mod paint;
pub mod path;
pub mod physics;
mod profile;
pub mod shapes;
mod station;
mod street;
mod village;

/// A scene that the library can make.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Builtin {
    /// What [`glb`] takes.
    pub name: &'static str,
    /// One sentence about it.
    pub summary: &'static str,
}

/// All built-in scenes.
pub const BUILTINS: &[Builtin] = &[
    Builtin {
        name: "atrium",
        summary: "A two-storey hall with arcades, stairs, curtains and railings, where boulders roll and spot lights sweep \
                  (15 s; camera paths path-walk and path-gallery).",
    },
    Builtin {
        name: "atrium-lamps",
        summary: "The atrium lit by four area lights alone: three globes in the lower arcades and a panel under the skylight \
                  (15 s; camera paths path-walk and path-gallery).",
    },
    Builtin {
        name: "station",
        summary: "A space station of large panels, thin struts and pipes, almost still, past which 14 rocks drift \
                  (15 s; camera paths path-deck and path-orbit).",
    },
    Builtin {
        name: "lab",
        summary: "A laboratory with machines, benches, pipes and a platform, through which 23 skinned people walk \
                  (15 s; camera paths path-aisle and path-crane).",
    },
    Builtin {
        name: "cornell",
        summary: "The Cornell box, in which a block turns and a cube slides, and beside it stages whose visibility has a closed form \
                  (15 s; camera paths path-box and path-stages).",
    },
    Builtin {
        name: "leaks",
        summary: "A gallery of thin partitions, shelves, sheets of steel, curtains and volumes that touch, on which wrong light \
                  shows (15 s; camera paths path-visit and path-close).",
    },
    Builtin {
        name: "village",
        summary: "A village of timber houses at night, lit by 51 flames and a moon that is a disc; a windmill turns \
                  (15 s; camera paths path-lane and path-roofs).",
    },
    Builtin {
        name: "street",
        summary: "A street of shops and tables, lit by two spheres and a turning cube that move through it past turning wheels and a \
                  carriage (15 s; camera paths path-walk and path-crane).",
    },
    Builtin {
        name: "hangar",
        summary: "A hangar with a craft, stores and a crane, lit by 28 drones that fly with a sphere, a ring, a rectangle or a disc of light \
                  (15 s; camera paths path-aisle and path-roof).",
    },
];

/// Why a built-in scene could not be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BuiltinError {
    /// No scene has this name.
    #[error("there is no built-in scene \"{name}\"; known are: {known}")]
    Unknown {
        /// The name asked for.
        name: String,
        /// The names there are.
        known: String,
    },
    /// The detail is not a number above 0 and at most 1.
    #[error("detail {0} is out of range: give a number above 0 and at most 1 (1 is full detail)")]
    Detail(f32),
    /// A texture could not be encoded.
    #[error("the texture \"{name}\" could not be encoded as PNG: {reason}")]
    Png {
        /// The texture's name.
        name: String,
        /// The encoder's reason.
        reason: String,
    },
    /// The document could not be written.
    #[error("the glTF document could not be written: {0}")]
    Write(String),
}

/// Makes a built-in scene as a GLB that any glTF 2.0 viewer opens.
///
/// `detail` in 0 … 1 (0 excluded) scales the number of triangles: 1 is full detail, 0.1 an eighth to a quarter of it, for tests. The layout,
/// the animation, the lights and the cameras are the same at every detail.
///
/// # Errors
/// [`BuiltinError::Unknown`] and [`BuiltinError::Detail`] for bad arguments.
pub fn glb(name: &str, detail: f32) -> Result<Vec<u8>, BuiltinError> {
    if !(detail > 0.0 && detail <= 1.0) {
        return Err(BuiltinError::Detail(detail));
    }
    match name {
        "atrium" => atrium::glb(Detail(detail)),
        "atrium-lamps" => atrium::lamps(Detail(detail)),
        "station" => station::glb(Detail(detail)),
        "lab" => lab::glb(Detail(detail)),
        "cornell" => cornell::glb(Detail(detail)),
        "leaks" => leaks::glb(Detail(detail)),
        "street" => street::glb(Detail(detail)),
        "hangar" => hangar::glb(Detail(detail)),
        "village" => village::glb(Detail(detail)),
        _ => Err(BuiltinError::Unknown {
            name: name.into(),
            known: BUILTINS.iter().map(|b| b.name).collect::<Vec<_>>().join(", "),
        }),
    }
}

/// How finely a scene is tessellated.
#[derive(Clone, Copy, Debug)]
struct Detail(f32);

impl Detail {
    /// Facets along one direction: `full` at detail 1, falling with the square root of it, so that triangles fall with it.
    fn facets(self, full: u32, least: u32) -> u32 {
        (libm::roundf(full as f32 * libm::sqrtf(self.0)) as u32).clamp(least.min(full), full)
    }

    /// A number of small things: `full` at detail 1, falling with it.
    fn count(self, full: u32, least: u32) -> u32 {
        (libm::roundf(full as f32 * self.0) as u32).clamp(least.min(full), full)
    }
}

#[cfg(test)]
mod tests;
