//! What the street is made of.

use glam::{Vec3, Vec4};

use crate::builtin::builder::{GlbBuilder, MaterialId, MaterialSpec};
use crate::builtin::noise::hash;
use crate::builtin::paint::{SIZE, normal_map, paint, tiling};
use crate::builtin::{BuiltinError, emitters};

/// A material by what it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stuff {
    Cobbles,
    Paving,
    Kerb,
    Cream,
    Rose,
    Sand,
    Stone,
    Brick,
    Trim,
    Slate,
    Zinc,
    Glass,
    White,
    Green,
    Blue,
    Red,
    Black,
    Wood,
    Boards,
    Iron,
    Steel,
    Brass,
    Marble,
    Terracotta,
    Leaf,
    Petal,
    RedCloth,
    GreenCloth,
    Warm,
    Cool,
    Cube,
}

/// Materials in the order of [`Stuff`].
pub(super) struct Palette(Vec<MaterialId>);

/// Radiances: each light gives about 1 lx at 4 m.
const WARM: Vec3 = Vec3::new(140.0, 90.0, 43.0);
const COOL: Vec3 = Vec3::new(110.0, 172.0, 214.0);
const CUBE: Vec3 = Vec3::new(86.0, 54.0, 70.0);

impl Palette {
    /// Adds all materials, their textures and normal maps.
    pub(super) fn new(b: &mut GlbBuilder) -> Result<Palette, BuiltinError> {
        let size = [SIZE; 2];
        let cobbles = b.texture("cobbles", size, &cobbles(), false)?;
        let domes = b.texture("cobbles-relief", size, &normal_map(1.0, cobble_height), false)?;
        let paving = b.texture("paving", size, &paving(), false)?;
        let plaster = b.texture("plaster", size, &plaster(), false)?;
        let ashlar = b.texture("ashlar", size, &ashlar(), false)?;
        let joints = b.texture("ashlar-relief", size, &normal_map(1.0, ashlar_height), false)?;
        let brick = b.texture("brick", size, &brick(), false)?;
        let courses = b.texture("brick-relief", size, &normal_map(1.0, brick_height), false)?;
        let grain = b.texture("grain", size, &grain(), false)?;
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
        let cloth = |r: f32, g: f32, bl: f32| MaterialSpec { double_sided: true, ..matt(r, g, bl, 0.9) };
        let specs = [
            ("cobbles", MaterialSpec { normal_map: Some(domes), ..painted(cobbles, [1.0; 3], 0.34) }),
            ("paving", painted(paving, [1.0; 3], 0.5)),
            ("kerb", painted(plaster, [0.45, 0.46, 0.48], 0.55)),
            ("cream", painted(plaster, [0.86, 0.80, 0.66], 0.85)),
            ("rose", painted(plaster, [0.78, 0.52, 0.43], 0.85)),
            ("sand", painted(plaster, [0.80, 0.66, 0.44], 0.85)),
            ("stone", MaterialSpec { normal_map: Some(joints), ..painted(ashlar, [1.0; 3], 0.7) }),
            ("brick", MaterialSpec { normal_map: Some(courses), ..painted(brick, [1.0; 3], 0.8) }),
            ("trim", painted(plaster, [0.82, 0.79, 0.73], 0.6)),
            ("slate", painted(grain, [0.22, 0.25, 0.30], 0.4)),
            ("zinc", metal(0.48, 0.50, 0.53, 0.45)),
            ("glass", matt(0.03, 0.04, 0.045, 0.1)),
            ("white", matt(0.78, 0.77, 0.74, 0.3)),
            ("green", matt(0.05, 0.19, 0.12, 0.25)),
            ("blue", matt(0.07, 0.15, 0.34, 0.25)),
            ("red", matt(0.48, 0.05, 0.045, 0.22)),
            ("black", matt(0.03, 0.03, 0.034, 0.2)),
            ("wood", painted(grain, [0.44, 0.26, 0.14], 0.35)),
            ("boards", painted(grain, [0.62, 0.45, 0.28], 0.7)),
            ("iron", metal(0.16, 0.165, 0.17, 0.45)),
            ("steel", metal(0.66, 0.67, 0.69, 0.16)),
            ("brass", metal(0.82, 0.60, 0.28, 0.22)),
            ("marble", painted(plaster, [0.80, 0.79, 0.78], 0.12)),
            ("terracotta", matt(0.50, 0.22, 0.12, 0.75)),
            ("leaf", matt(0.07, 0.20, 0.05, 0.45)),
            ("petal", matt(0.72, 0.10, 0.22, 0.6)),
            ("cloth-red", cloth(0.55, 0.07, 0.06)),
            ("cloth-green", cloth(0.10, 0.32, 0.20)),
            ("light-warm", emitters::glow(WARM)),
            ("light-cool", emitters::glow(COOL)),
            ("light-cube", emitters::glow(CUBE)),
        ];
        Ok(Palette(specs.iter().map(|(name, spec)| b.material(name, spec)).collect()))
    }

    /// The material.
    pub(super) fn of(&self, stuff: Stuff) -> MaterialId {
        self.0[stuff as usize]
    }
}

/// A number in −½ … ½ of one field of a texture.
fn own(seed: u32, i: u32, j: u32) -> f32 {
    (hash(seed, i as i32, j as i32, 0) >> 16) as f32 / 65536.0 - 0.5
}

/// Fields of a wall in bond: which one a texel is of, and how far it is from a joint in texels; `across × down` to a texture.
fn bond(x: u32, y: u32, across: u32, down: u32) -> ([u32; 2], u32) {
    let row = (y * down / SIZE).min(down - 1);
    let shifted = (x + (row % 2) * SIZE / (2 * across)) % SIZE;
    let column = (shifted * across / SIZE).min(across - 1);
    let edge = |v: u32, n: u32, i: u32| {
        let (from, to) = ((i * SIZE).div_ceil(n), ((i + 1) * SIZE).div_ceil(n));
        (v - from).min(to - 1 - v)
    };
    ([column, row], edge(shifted, across, column).min(edge(y, down, row)))
}

/// Setts, eight by eight a metre.
fn cobbles() -> Vec<u8> {
    paint(|x, y| {
        let (which, edge) = bond(x, y, 8, 8);
        let shade = 1.0 + 0.5 * own(51, which[0], which[1]) + 0.2 * tiling(851, x, y, [16.0, 16.0], 3);
        let shade = shade * if edge < 2 { 0.45 } else { 1.0 };
        [0.185 * shade, 0.18 * shade, 0.175 * shade, 1.0]
    })
}

fn cobble_height(x: u32, y: u32) -> f32 {
    let (_, edge) = bond(x, y, 8, 8);
    let t = (edge as f32 / 14.0).min(1.0);
    0.0045 * (1.0 - (1.0 - t) * (1.0 - t)) + 0.002 * tiling(851, x, y, [16.0, 16.0], 3)
}

/// Slabs of half a metre.
fn paving() -> Vec<u8> {
    paint(|x, y| {
        let (which, edge) = bond(x, y, 2, 2);
        let shade = 1.0 + 0.12 * own(53, which[0], which[1]) + 0.2 * tiling(853, x, y, [9.0, 9.0], 4);
        let shade = shade * if edge < 1 { 0.5 } else { 1.0 };
        [0.34 * shade, 0.325 * shade, 0.30 * shade, 1.0]
    })
}

/// Plaster, pale: colours come from the material.
fn plaster() -> Vec<u8> {
    paint(|x, y| {
        let stain = tiling(855, x, y, [3.0, 3.0], 4);
        let shade = 0.93 + 0.1 * stain + 0.05 * tiling(857, x, y, [40.0, 40.0], 2);
        [shade, shade, 0.99 * shade, 1.0]
    })
}

/// Blocks of cut stone, two by three a metre.
fn ashlar() -> Vec<u8> {
    paint(|x, y| {
        let (which, edge) = bond(x, y, 2, 3);
        let shade = 1.0 + 0.16 * own(57, which[0], which[1]) + 0.16 * tiling(859, x, y, [12.0, 12.0], 4);
        let shade = shade * if edge < 2 { 0.72 } else { 1.0 };
        [0.52 * shade, 0.48 * shade, 0.41 * shade, 1.0]
    })
}

fn ashlar_height(x: u32, y: u32) -> f32 {
    let (_, edge) = bond(x, y, 2, 3);
    0.008 * (edge as f32 / 4.0).min(1.0) + 0.002 * tiling(859, x, y, [12.0, 12.0], 4)
}

/// Bricks, four by twelve a metre.
fn brick() -> Vec<u8> {
    paint(|x, y| {
        let (which, edge) = bond(x, y, 4, 12);
        let shade = 1.0 + 0.45 * own(59, which[0], which[1]) + 0.2 * tiling(861, x, y, [20.0, 20.0], 3);
        let base = if edge < 1 { [0.36, 0.33, 0.30] } else { [0.40, 0.16, 0.10] };
        [base[0] * shade, base[1] * shade, base[2] * shade, 1.0]
    })
}

fn brick_height(x: u32, y: u32) -> f32 {
    let (_, edge) = bond(x, y, 4, 12);
    0.006 * (edge as f32 / 2.0).min(1.0)
}

/// A long grain, pale: colours come from the material.
fn grain() -> Vec<u8> {
    paint(|x, y| {
        let shade = 0.84 + 0.26 * tiling(863, x, y, [4.0, 50.0], 3) + 0.14 * tiling(865, x, y, [4.0, 4.0], 3);
        [shade, shade, shade, 1.0]
    })
}
