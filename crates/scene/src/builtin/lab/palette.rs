//! What the laboratory is made of.

use glam::{Vec3, Vec4};

use super::walkers::Clothes;
use crate::builtin::BuiltinError;
use crate::builtin::builder::{GlbBuilder, MaterialId, MaterialSpec};
use crate::builtin::noise::hash;
use crate::builtin::paint::{SIZE, normal_map, paint, tiling};

/// A material by what it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stuff {
    Floor,
    Panel,
    Ceiling,
    Deck,
    Steel,
    DarkSteel,
    Enamel,
    Blue,
    Orange,
    Yellow,
    Rubber,
    Copper,
    Glass,
    RedLiquid,
    GreenLiquid,
    BlueLiquid,
    Wood,
    Card,
    Screen,
    Lamp,
    Signal,
}

/// Materials in the order of [`Stuff`].
pub(super) struct Palette(Vec<MaterialId>);

impl Palette {
    /// Adds all materials, their textures and normal maps.
    pub(super) fn new(b: &mut GlbBuilder) -> Result<Palette, BuiltinError> {
        let size = [SIZE; 2];
        let floor = b.texture("tiles", size, &tiles(), false)?;
        let floor_relief = b.texture("tiles-relief", size, &normal_map(1.0, tile_height), false)?;
        let wall = b.texture("panels", size, &panels(), false)?;
        let wall_relief = b.texture("panels-relief", size, &normal_map(1.0, panel_height), false)?;
        let tread = b.texture("tread-relief", size, &normal_map(1.0, tread_height), false)?;
        let brushed = b.texture("brushed-relief", size, &normal_map(1.0, brushed_height), false)?;
        let matt = MaterialSpec::matt;
        let metal = |r: f32, g: f32, bl: f32, roughness: f32| MaterialSpec {
            metallic: 1.0,
            normal_map: Some(brushed),
            ..matt(r, g, bl, roughness)
        };
        let glow = |r: f32, g: f32, bl: f32, strength: f32| MaterialSpec {
            emissive: Vec3::new(r, g, bl) * strength,
            ..matt(0.5 * r, 0.5 * g, 0.5 * bl, 0.4)
        };
        let textured = |map, relief, tint: f32, roughness| MaterialSpec {
            texture: Some(map),
            normal_map: Some(relief),
            base_color: Vec4::new(tint, tint, tint, 1.0),
            roughness,
            ..Default::default()
        };
        let specs = [
            ("floor", textured(floor, floor_relief, 1.0, 0.45)),
            ("wall-panel", textured(wall, wall_relief, 1.0, 0.7)),
            ("ceiling", matt(0.62, 0.64, 0.65, 0.95)),
            ("deck", MaterialSpec { normal_map: Some(tread), ..matt(0.34, 0.36, 0.38, 0.6) }),
            ("steel", metal(0.66, 0.67, 0.69, 0.36)),
            ("dark-steel", metal(0.20, 0.21, 0.23, 0.5)),
            ("enamel", matt(0.78, 0.79, 0.77, 0.35)),
            ("blue-paint", matt(0.07, 0.20, 0.42, 0.4)),
            ("orange-paint", matt(0.80, 0.29, 0.04, 0.4)),
            ("yellow-paint", matt(0.80, 0.58, 0.06, 0.45)),
            ("rubber", matt(0.035, 0.035, 0.04, 0.85)),
            ("copper", metal(0.78, 0.42, 0.26, 0.3)),
            ("glass", matt(0.52, 0.66, 0.68, 0.1)),
            ("red-liquid", matt(0.55, 0.05, 0.06, 0.2)),
            ("green-liquid", matt(0.07, 0.42, 0.13, 0.2)),
            ("blue-liquid", matt(0.06, 0.17, 0.52, 0.2)),
            ("wood", matt(0.46, 0.31, 0.18, 0.6)),
            ("card", matt(0.48, 0.36, 0.24, 0.9)),
            ("screen", glow(0.25, 0.75, 0.95, 1.6)),
            ("lamp", glow(1.0, 0.97, 0.90, 5.0)),
            ("signal", glow(0.2, 1.0, 0.35, 3.0)),
        ];
        Ok(Palette(specs.iter().map(|(name, spec)| b.material(name, spec)).collect()))
    }

    /// The material.
    pub(super) fn of(&self, stuff: Stuff) -> MaterialId {
        self.0[stuff as usize]
    }
}

/// Adds what walkers are made of.
pub(super) fn clothes(b: &mut GlbBuilder) -> Clothes {
    let mut matt = |name: &str, r: f32, g: f32, bl: f32, roughness: f32| {
        b.material(name, &MaterialSpec::matt(r, g, bl, roughness))
    };
    Clothes {
        skins: [matt("skin-light", 0.62, 0.40, 0.30, 0.6), matt("skin-dark", 0.26, 0.14, 0.09, 0.6)],
        coats: [
            matt("coat-white", 0.76, 0.77, 0.76, 0.9),
            matt("coat-orange", 0.70, 0.25, 0.05, 0.9),
            matt("coat-teal", 0.06, 0.28, 0.30, 0.9),
            matt("coat-blue", 0.08, 0.14, 0.34, 0.9),
        ],
        trousers: [
            matt("trousers-navy", 0.05, 0.07, 0.13, 0.9),
            matt("trousers-gray", 0.20, 0.20, 0.21, 0.9),
        ],
        shoes: matt("shoes", 0.05, 0.04, 0.04, 0.6),
        hair: [matt("hair-brown", 0.10, 0.06, 0.035, 0.8), matt("hair-black", 0.025, 0.022, 0.02, 0.8)],
        helmet: matt("helmet", 0.85, 0.66, 0.08, 0.35),
    }
}

/// Distance in texels from the nearest joint of a grid of square fields.
fn joint(x: u32, y: u32, field: u32) -> u32 {
    let (px, py) = (x % field, y % field);
    px.min(field - 1 - px).min(py.min(field - 1 - py))
}

/// Pale floor tiles, two by two a metre.
fn tiles() -> Vec<u8> {
    let tile = SIZE / 2;
    paint(|x, y| {
        let own = (hash(3, (x / tile) as i32, (y / tile) as i32, 0) >> 16) as f32 / 65536.0 - 0.5;
        let shade = 1.0 + 0.05 * own + 0.07 * tiling(51, x, y, [9.0, 9.0], 4);
        let base = if joint(x, y, tile) < 2 { [0.42, 0.43, 0.43] } else { [0.66, 0.68, 0.67] };
        [base[0] * shade, base[1] * shade, base[2] * shade, 1.0]
    })
}

/// Tiles stand a millimetre and a half above their joints, cushioned at the edge.
fn tile_height(x: u32, y: u32) -> f32 {
    0.0015 * (joint(x, y, SIZE / 2).min(5) as f32 / 5.0)
}

/// Wall panels a metre wide with a stripe, screws at the corners.
fn panels() -> Vec<u8> {
    paint(|x, y| {
        let shade = 1.0 + 0.04 * tiling(57, x, y, [4.0, 6.0], 3);
        let base = match joint(x, y, SIZE) {
            0..2 => [0.30, 0.32, 0.34],
            _ if screw(x, y) < 4.0 => [0.38, 0.40, 0.42],
            _ => [0.72, 0.75, 0.76],
        };
        [base[0] * shade, base[1] * shade, base[2] * shade, 1.0]
    })
}

/// Distance in texels from the nearest screw.
fn screw(x: u32, y: u32) -> f32 {
    let off = |v: u32| (v.min(SIZE - 1 - v) as f32) - 14.0;
    libm::sqrtf(off(x) * off(x) + off(y) * off(y))
}

/// Panels are sunk by 4 mm in a frame, screws stand out.
fn panel_height(x: u32, y: u32) -> f32 {
    let edge = joint(x, y, SIZE) as f32;
    let groove = (edge / 4.0).min(1.0);
    let sunk = ((edge - 24.0) / 5.0).clamp(0.0, 1.0);
    let head = (1.0 - screw(x, y) / 5.0).max(0.0);
    0.004 * groove - 0.004 * sunk + 0.003 * head
}

/// Tread plate: short raised bars, alternately along one and the other diagonal, sixteen a metre.
fn tread_height(x: u32, y: u32) -> f32 {
    let cell = SIZE / 16;
    let (i, j) = (x / cell, y / cell);
    let local = |v: u32| (v % cell) as f32 / cell as f32 - 0.5 + 0.5 / cell as f32;
    let (u, v) = (local(x), local(y));
    let (along, across) = if (i + j) % 2 == 0 { (u + v, u - v) } else { (u - v, u + v) };
    let bar = (along * along / 0.5 + across * across / 0.03).min(1.0);
    0.0025 * (1.0 - bar)
}

/// Fine scratches along u.
fn brushed_height(x: u32, y: u32) -> f32 {
    0.00012 * tiling(71, x, y, [3.0, 90.0], 2)
}
