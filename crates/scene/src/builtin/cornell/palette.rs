//! What the box and its neighbours are made of.

use glam::{Vec3, Vec4};

use crate::builtin::BuiltinError;
use crate::builtin::builder::{GlbBuilder, MaterialId, MaterialSpec};
use crate::builtin::noise::hash;
use crate::builtin::paint::{SIZE, paint, tiling};

/// A material by what it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stuff {
    White,
    Red,
    Green,
    Light,
    Cladding,
    Concrete,
    Backdrop,
    Stage,
    Ivory,
    Brass,
    Steel,
    Ink,
    Amber,
    Lamp,
}

/// Materials in the order of [`Stuff`].
pub(super) struct Palette(Vec<MaterialId>);

impl Palette {
    /// Adds all materials and their textures.
    pub(super) fn new(b: &mut GlbBuilder) -> Result<Palette, BuiltinError> {
        let concrete = b.texture("concrete", [SIZE; 2], &concrete(), false)?;
        let plywood = b.texture("plywood", [SIZE; 2], &plywood(), false)?;
        let matt = MaterialSpec::matt;
        let metal = |r: f32, g: f32, bl: f32, roughness: f32| MaterialSpec {
            metallic: 1.0,
            ..matt(r, g, bl, roughness)
        };
        let painted = |texture, tint: f32, roughness| MaterialSpec {
            texture: Some(texture),
            base_color: Vec4::new(tint, tint, tint, 1.0),
            roughness,
            ..Default::default()
        };
        let glow = |r: f32, g: f32, bl: f32, strength: f32| MaterialSpec {
            emissive: Vec3::new(r, g, bl) * strength,
            ..matt(0.5 * r, 0.5 * g, 0.5 * bl, 0.4)
        };
        let specs = [
            // The box's three reflectances and its light, as linear colours of the published spectra.
            ("white", matt(0.73, 0.71, 0.68, 0.95)),
            ("red", matt(0.60, 0.055, 0.05, 0.95)),
            ("green", matt(0.12, 0.44, 0.10, 0.95)),
            ("light", glow(1.0, 0.85, 0.58, 9.0)),
            ("cladding", painted(plywood, 1.0, 0.7)),
            ("concrete", painted(concrete, 1.0, 0.6)),
            ("backdrop", painted(concrete, 0.72, 0.9)),
            ("stage", matt(0.55, 0.56, 0.57, 0.8)),
            ("ivory", matt(0.80, 0.75, 0.66, 0.7)),
            ("brass", metal(0.80, 0.58, 0.27, 0.3)),
            ("steel", metal(0.50, 0.51, 0.53, 0.4)),
            ("ink", matt(0.05, 0.055, 0.065, 0.6)),
            ("amber", matt(0.72, 0.42, 0.08, 0.7)),
            ("lamp", glow(1.0, 0.94, 0.82, 6.0)),
        ];
        Ok(Palette(specs.iter().map(|(name, spec)| b.material(name, spec)).collect()))
    }

    /// The material.
    pub(super) fn of(&self, stuff: Stuff) -> MaterialId {
        self.0[stuff as usize]
    }
}

/// Polished concrete in fields of a metre.
fn concrete() -> Vec<u8> {
    paint(|x, y| {
        let edge = x.min(SIZE - 1 - x).min(y).min(SIZE - 1 - y);
        let cloud = tiling(301, x, y, [4.0, 4.0], 4);
        let grain = tiling(303, x, y, [40.0, 40.0], 2);
        let shade = (0.33 + 0.06 * cloud + 0.035 * grain) * if edge < 1 { 0.7 } else { 1.0 };
        [shade, 0.99 * shade, 0.97 * shade, 1.0]
    })
}

/// Plywood: a long, wavy grain, sheets of half a metre.
fn plywood() -> Vec<u8> {
    let sheet = SIZE / 2;
    paint(|x, y| {
        let wave = tiling(311, x, y, [3.0, 2.0], 2);
        let grain = tiling(313, x, y, [4.0, 46.0], 3);
        let own = (hash(41, (y / sheet) as i32, 0, 0) >> 16) as f32 / 65536.0 - 0.5;
        let shade = (1.0 + 0.16 * grain + 0.07 * wave + 0.06 * own) * if y % sheet == 0 { 0.6 } else { 1.0 };
        [0.56 * shade, 0.42 * shade, 0.27 * shade, 1.0]
    })
}
