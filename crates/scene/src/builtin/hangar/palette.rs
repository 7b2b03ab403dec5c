//! What the hangar is made of.

use glam::{Vec3, Vec4};

use super::plan::Lamp;
use crate::builtin::builder::{GlbBuilder, MaterialId, MaterialSpec};
use crate::builtin::noise::hash;
use crate::builtin::paint::{SIZE, normal_map, paint, tiling};
use crate::builtin::{BuiltinError, emitters};

/// A material by what it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stuff {
    Floor,
    Wall,
    Cladding,
    Roof,
    Structure,
    Steel,
    DarkSteel,
    Chrome,
    Copper,
    Hull,
    HullDark,
    Canopy,
    Orange,
    Yellow,
    Blue,
    Olive,
    Red,
    White,
    Rubber,
    Wood,
    Card,
    Glass,
    Carbon,
}

/// Materials in the order of [`Stuff`].
pub(super) struct Palette(Vec<MaterialId>);

/// Colours of the drones' lights, each of about the same luminance.
const COLORS: [Vec3; 6] = [
    Vec3::new(1.45, 0.93, 0.48),
    Vec3::new(0.55, 1.05, 1.55),
    Vec3::new(1.0, 1.0, 1.0),
    Vec3::new(1.75, 0.72, 0.55),
    Vec3::new(0.55, 1.22, 0.75),
    Vec3::new(1.15, 0.80, 1.60),
];

impl Palette {
    /// Adds all materials, their textures and normal maps.
    pub(super) fn new(b: &mut GlbBuilder) -> Result<Palette, BuiltinError> {
        let size = [SIZE; 2];
        let floor = b.texture("floor", size, &floor(), false)?;
        let panel = b.texture("panel", size, &panel(), false)?;
        let waves = b.texture("cladding-relief", size, &normal_map(1.0, wave_height), false)?;
        let plates = b.texture("hull-relief", size, &normal_map(1.0, plate_height), false)?;
        let hull = b.texture("hull", size, &hull(), false)?;
        let wood = b.texture("wood", size, &wood(), false)?;
        let matt = MaterialSpec::matt;
        let metal = |r: f32, g: f32, bl: f32, roughness: f32| MaterialSpec {
            metallic: 1.0,
            ..matt(r, g, bl, roughness)
        };
        let painted = |texture, tint: [f32; 3], roughness| MaterialSpec {
            texture: Some(texture),
            base_color: Vec4::new(tint[0], tint[1], tint[2], 1.0),
            roughness,
            ..Default::default()
        };
        let specs = [
            ("floor", painted(floor, [1.0; 3], 0.24)),
            ("wall", painted(panel, [0.56, 0.58, 0.60], 0.7)),
            ("cladding", MaterialSpec { normal_map: Some(waves), ..matt(0.42, 0.45, 0.48, 0.55) }),
            ("roof", matt(0.30, 0.31, 0.33, 0.9)),
            ("structure", matt(0.22, 0.25, 0.29, 0.6)),
            ("steel", metal(0.62, 0.63, 0.65, 0.32)),
            ("dark-steel", metal(0.20, 0.21, 0.23, 0.45)),
            ("chrome", metal(0.80, 0.81, 0.83, 0.1)),
            ("copper", metal(0.80, 0.44, 0.28, 0.28)),
            ("hull", MaterialSpec { normal_map: Some(plates), ..painted(hull, [1.0; 3], 0.3) }),
            (
                "hull-dark",
                MaterialSpec { normal_map: Some(plates), ..painted(hull, [0.16, 0.18, 0.21], 0.4) },
            ),
            ("canopy", matt(0.02, 0.03, 0.045, 0.1)),
            ("orange", matt(0.75, 0.25, 0.05, 0.4)),
            ("yellow", matt(0.78, 0.56, 0.06, 0.45)),
            ("blue", matt(0.07, 0.18, 0.40, 0.45)),
            ("olive", matt(0.20, 0.24, 0.11, 0.6)),
            ("red", matt(0.50, 0.06, 0.05, 0.35)),
            ("white", matt(0.76, 0.76, 0.74, 0.4)),
            ("rubber", matt(0.035, 0.035, 0.04, 0.85)),
            ("wood", painted(wood, [1.0; 3], 0.8)),
            ("card", matt(0.46, 0.33, 0.20, 0.9)),
            ("glass", matt(0.30, 0.32, 0.33, 0.15)),
            ("carbon", matt(0.05, 0.05, 0.055, 0.3)),
        ];
        Ok(Palette(specs.iter().map(|(name, spec)| b.material(name, spec)).collect()))
    }

    /// The material.
    pub(super) fn of(&self, stuff: Stuff) -> MaterialId {
        self.0[stuff as usize]
    }
}

/// The radiance of a lamp of a colour: such that each kind gives about 2 lx at 2 m.
pub(super) fn radiance(lamp: Lamp, color: usize) -> Vec3 {
    let strength = match lamp {
        Lamp::Sphere => 170.0,
        Lamp::Ring => 105.0,
        Lamp::Rectangle | Lamp::Disc => 60.0,
    };
    COLORS[color % COLORS.len()] * strength
}

/// How many colours there are.
pub(super) const COLOR_COUNT: usize = COLORS.len();

/// The material of a lamp of a colour.
pub(super) fn glow(b: &mut GlbBuilder, lamp: Lamp, color: usize) -> MaterialId {
    let name = match lamp {
        Lamp::Sphere => "sphere",
        Lamp::Ring => "ring",
        Lamp::Rectangle => "rectangle",
        Lamp::Disc => "disc",
    };
    b.material(&format!("light-{name}-{color}"), &emitters::glow(radiance(lamp, color)))
}

/// A number in −½ … ½ of one field of a texture.
fn own(seed: u32, i: u32, j: u32) -> f32 {
    (hash(seed, i as i32, j as i32, 0) >> 16) as f32 / 65536.0 - 0.5
}

/// Sealed concrete in fields of a metre, scuffed.
fn floor() -> Vec<u8> {
    paint(|x, y| {
        let edge = x.min(SIZE - 1 - x).min(y).min(SIZE - 1 - y);
        let cloud = tiling(901, x, y, [4.0, 4.0], 4);
        let scuff = (tiling(903, x, y, [30.0, 6.0], 3) - 0.35).max(0.0);
        let shade = (0.27 + 0.07 * cloud - 0.22 * scuff) * if edge < 1 { 0.6 } else { 1.0 };
        [shade, 1.01 * shade, 1.04 * shade, 1.0]
    })
}

/// Painted panels of half a metre by a metre, pale: colours come from the material.
fn panel() -> Vec<u8> {
    paint(|x, y| {
        let half = SIZE / 2;
        let edge = (x % half).min(half - 1 - x % half).min(y).min(SIZE - 1 - y);
        let shade = 0.92 + 0.1 * tiling(905, x, y, [3.0, 9.0], 4) + 0.06 * own(61, x / half, 0);
        let shade = shade * if edge < 1 { 0.6 } else { 1.0 };
        [shade, shade, shade, 1.0]
    })
}

/// Trapezoid waves, eight a metre.
fn wave_height(x: u32, _: u32) -> f32 {
    let wave = SIZE / 8;
    let t = (x % wave) as f32 / wave as f32;
    0.03 * (1.6 * (1.0 - (2.0 * t - 1.0).abs() * 2.0)).clamp(-1.0, 1.0)
}

/// Which of the craft's plates a texel is of, a metre long and half as high, shifted by turns; how far it is from a seam in texels.
fn plate(x: u32, y: u32) -> ([u32; 2], u32) {
    let half = SIZE / 2;
    let row = y / half;
    let shifted = (x + row * SIZE / 3) % SIZE;
    let edge = |v: u32, n: u32| (v % n).min(n - 1 - v % n);
    ([0, row], edge(shifted, SIZE).min(edge(y, half)))
}

fn plate_height(x: u32, y: u32) -> f32 {
    let (_, edge) = plate(x, y);
    0.0015 * (edge as f32 / 2.0).min(1.0)
}

/// Painted plates, each of its own shade, streaked.
fn hull() -> Vec<u8> {
    paint(|x, y| {
        let (which, edge) = plate(x, y);
        let shade = 1.0 + 0.08 * own(67, which[0], which[1]) + 0.08 * tiling(907, x, y, [10.0, 3.0], 4);
        let base = if edge < 1 { 0.42 } else { 0.68 };
        [base * shade, base * shade, 0.98 * base * shade, 1.0]
    })
}

/// Rough boards, eight to a metre.
fn wood() -> Vec<u8> {
    paint(|x, y| {
        let row = y * 8 / SIZE;
        let shade = 1.0 + 0.3 * tiling(909 + row, x, y, [4.0, 60.0], 3) + 0.2 * own(71, row, 0);
        let shade = shade * if y % (SIZE / 8) == 0 { 0.5 } else { 1.0 };
        [0.50 * shade, 0.37 * shade, 0.23 * shade, 1.0]
    })
}
