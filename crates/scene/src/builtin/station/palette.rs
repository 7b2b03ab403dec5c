//! What the station is made of.

use glam::{Vec3, Vec4};

use crate::builtin::BuiltinError;
use crate::builtin::builder::{GlbBuilder, MaterialId, MaterialSpec};
use crate::builtin::noise::hash;
use crate::builtin::paint::{SIZE, normal_map, paint, tiling};

/// A material by what it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stuff {
    Hull,
    Plate,
    Structure,
    Deck,
    Steel,
    DarkSteel,
    Foil,
    Cells,
    Radiator,
    Orange,
    Yellow,
    Blue,
    Olive,
    Red,
    Rubber,
    Copper,
    Window,
    Lamp,
    Signal,
    RockGray,
    RockBrown,
    RockDark,
}

/// Materials in the order of [`Stuff`].
pub(super) struct Palette(Vec<MaterialId>);

impl Palette {
    /// Adds all materials, their textures and normal maps.
    pub(super) fn new(b: &mut GlbBuilder) -> Result<Palette, BuiltinError> {
        let size = [SIZE; 2];
        let hull = b.texture("hull", size, &hull(), false)?;
        let relief = b.texture("hull-relief", size, &normal_map(1.0, hull_height), false)?;
        let cells = b.texture("cells", size, &cells(), false)?;
        let grip = b.texture("grip-relief", size, &normal_map(1.0, grip_height), false)?;
        let crumple = b.texture("foil-relief", size, &normal_map(1.0, crumple_height), false)?;
        let matt = MaterialSpec::matt;
        let metal = |r: f32, g: f32, bl: f32, roughness: f32| MaterialSpec {
            metallic: 1.0,
            ..matt(r, g, bl, roughness)
        };
        let glow = |r: f32, g: f32, bl: f32, strength: f32| MaterialSpec {
            emissive: Vec3::new(r, g, bl) * strength,
            ..matt(0.5 * r, 0.5 * g, 0.5 * bl, 0.4)
        };
        let plated = |tint: f32| MaterialSpec {
            texture: Some(hull),
            normal_map: Some(relief),
            base_color: Vec4::new(tint, tint, tint, 1.0),
            roughness: 0.6,
            ..Default::default()
        };
        let specs = [
            ("hull", plated(1.0)),
            ("plate", plated(0.72)),
            ("structure", matt(0.24, 0.26, 0.29, 0.7)),
            ("deck", MaterialSpec { normal_map: Some(grip), ..matt(0.30, 0.31, 0.33, 0.65) }),
            ("steel", metal(0.64, 0.65, 0.67, 0.38)),
            ("dark-steel", metal(0.19, 0.20, 0.22, 0.5)),
            ("foil", MaterialSpec { normal_map: Some(crumple), ..metal(0.85, 0.60, 0.22, 0.35) }),
            ("cells", MaterialSpec { texture: Some(cells), roughness: 0.3, ..Default::default() }),
            ("radiator", matt(0.80, 0.80, 0.78, 0.5)),
            ("orange-paint", matt(0.78, 0.27, 0.05, 0.5)),
            ("yellow-paint", matt(0.80, 0.58, 0.06, 0.5)),
            ("blue-paint", matt(0.08, 0.19, 0.40, 0.5)),
            ("olive-paint", matt(0.20, 0.23, 0.11, 0.6)),
            ("red-paint", matt(0.50, 0.07, 0.05, 0.5)),
            ("rubber", matt(0.04, 0.04, 0.045, 0.85)),
            ("copper", metal(0.78, 0.42, 0.26, 0.35)),
            ("window", glow(1.0, 0.86, 0.60, 1.8)),
            ("lamp", glow(0.95, 0.97, 1.0, 5.0)),
            ("signal", glow(1.0, 0.16, 0.10, 4.0)),
            ("rock-gray", matt(0.30, 0.29, 0.28, 0.95)),
            ("rock-brown", matt(0.33, 0.24, 0.18, 0.95)),
            ("rock-dark", matt(0.17, 0.17, 0.18, 0.95)),
        ];
        Ok(Palette(specs.iter().map(|(name, spec)| b.material(name, spec)).collect()))
    }

    /// The material.
    pub(super) fn of(&self, stuff: Stuff) -> MaterialId {
        self.0[stuff as usize]
    }
}

/// Distance in texels from the nearest seam: plates of a metre, some halved, one quartered.
fn seam(x: u32, y: u32) -> u32 {
    let half = SIZE / 2;
    let edge = |v: u32, n: u32| (v % n).min(n - 1 - v % n);
    let outer = edge(x, SIZE).min(edge(y, SIZE));
    let middle = if y < half { edge(x, half) } else { SIZE };
    outer.min(middle).min(edge(y, half))
}

/// Pale plates, each of its own shade, streaked.
fn hull() -> Vec<u8> {
    paint(|x, y| {
        let half = SIZE / 2;
        let plate = (if y < half { x / half } else { 0 }, y / half);
        let own = (hash(13, plate.0 as i32, plate.1 as i32, 0) >> 16) as f32 / 65536.0 - 0.5;
        let shade = 1.0 + 0.07 * own + 0.06 * tiling(81, x, y, [12.0, 2.0], 4);
        let base = if seam(x, y) < 1 { [0.36, 0.37, 0.38] } else { [0.74, 0.75, 0.75] };
        [base[0] * shade, base[1] * shade, base[2] * shade, 1.0]
    })
}

/// Seams are 2 mm deep, plates bulge by a trace.
fn hull_height(x: u32, y: u32) -> f32 {
    let edge = seam(x, y) as f32;
    0.002 * (edge / 3.0).min(1.0) + 0.001 * (edge / 60.0).min(1.0)
}

/// Solar cells: eight by eight a metre, dark blue, with bus bars and cut corners.
fn cells() -> Vec<u8> {
    let cell = SIZE / 8;
    paint(|x, y| {
        let (px, py) = (x % cell, y % cell);
        let (dx, dy) = (px.min(cell - 1 - px), py.min(cell - 1 - py));
        let own = (hash(17, (x / cell) as i32, (y / cell) as i32, 0) >> 16) as f32 / 65536.0 - 0.5;
        let shade = 1.0 + 0.16 * own;
        if dx.min(dy) < 1 || dx + dy < 4 {
            [0.55, 0.56, 0.58, 1.0]
        } else if px % 11 == 5 {
            [0.42, 0.44, 0.52, 1.0]
        } else {
            [0.10 * shade, 0.13 * shade, 0.33 * shade, 1.0]
        }
    })
}

/// Small studs, sixteen a metre.
fn grip_height(x: u32, y: u32) -> f32 {
    let cell = SIZE / 16;
    let off = |v: u32| (v % cell) as f32 + 0.5 - 0.5 * cell as f32;
    let r = libm::sqrtf(off(x) * off(x) + off(y) * off(y));
    0.0025 * (1.0 - (r / 5.0) * (r / 5.0)).max(0.0)
}

/// Crumpled foil.
fn crumple_height(x: u32, y: u32) -> f32 {
    0.012 * tiling(91, x, y, [8.0, 8.0], 3).abs()
}
