//! What the gallery is made of.

use glam::{Vec3, Vec4};

use crate::builtin::BuiltinError;
use crate::builtin::builder::{GlbBuilder, MaterialId, MaterialSpec};
use crate::builtin::noise::hash;
use crate::builtin::paint::{SIZE, normal_map, paint, tiling};

/// A material by what it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stuff {
    Plaster,
    Stone,
    Boards,
    Basin,
    Water,
    Oak,
    Walnut,
    Onyx,
    Steel,
    DarkSteel,
    Rust,
    RedCloth,
    Linen,
    Carpet,
    Chalk,
    Coral,
    Teal,
    Mustard,
    Ink,
    Paper,
    Rock,
    Lamp,
}

/// Materials in the order of [`Stuff`].
pub(super) struct Palette(Vec<MaterialId>);

impl Palette {
    /// Adds all materials, their textures and normal maps.
    pub(super) fn new(b: &mut GlbBuilder) -> Result<Palette, BuiltinError> {
        let size = [SIZE; 2];
        let stone = b.texture("travertine", size, &travertine(), false)?;
        let boards = b.texture("boards", size, &boards(), false)?;
        let onyx = b.texture("onyx", size, &onyx(), false)?;
        let rust = b.texture("rust", size, &rust(), false)?;
        let seams = b.texture("boards-relief", size, &normal_map(1.0, board_height), false)?;
        let weave = b.texture("weave-relief", size, &normal_map(0.25, weave_height), false)?;
        let matt = MaterialSpec::matt;
        let metal = |r: f32, g: f32, bl: f32, roughness: f32| MaterialSpec {
            metallic: 1.0,
            ..matt(r, g, bl, roughness)
        };
        let painted =
            |texture, roughness| MaterialSpec { texture: Some(texture), roughness, ..Default::default() };
        let tinted = |spec: MaterialSpec, tint: [f32; 3]| MaterialSpec {
            base_color: Vec4::new(tint[0], tint[1], tint[2], 1.0),
            ..spec
        };
        let cloth = |r: f32, g: f32, bl: f32| MaterialSpec { double_sided: true, ..matt(r, g, bl, 0.95) };
        let specs = [
            ("plaster", matt(0.74, 0.72, 0.68, 0.95)),
            ("stone", painted(stone, 0.5)),
            ("boards", MaterialSpec { normal_map: Some(seams), ..painted(boards, 0.45) }),
            ("basin", matt(0.10, 0.13, 0.14, 0.6)),
            ("water", matt(0.05, 0.13, 0.15, 0.06)),
            ("oak", tinted(painted(boards, 0.55), [1.0, 0.94, 0.84])),
            ("walnut", tinted(painted(boards, 0.5), [0.46, 0.36, 0.30])),
            ("onyx", painted(onyx, 0.2)),
            ("steel", metal(0.62, 0.63, 0.65, 0.35)),
            ("dark-steel", metal(0.19, 0.20, 0.22, 0.5)),
            ("rust", painted(rust, 0.9)),
            ("cloth-red", cloth(0.42, 0.045, 0.05)),
            ("linen", cloth(0.72, 0.68, 0.60)),
            ("carpet", MaterialSpec { normal_map: Some(weave), ..matt(0.16, 0.20, 0.30, 1.0) }),
            ("chalk", matt(0.80, 0.79, 0.76, 0.9)),
            ("coral", matt(0.72, 0.23, 0.16, 0.7)),
            ("teal", matt(0.06, 0.34, 0.36, 0.7)),
            ("mustard", matt(0.72, 0.48, 0.09, 0.7)),
            ("ink", matt(0.07, 0.09, 0.17, 0.7)),
            ("paper", matt(0.66, 0.60, 0.50, 0.95)),
            ("rock", matt(0.31, 0.30, 0.29, 0.95)),
            (
                "lamp",
                MaterialSpec { emissive: Vec3::new(1.0, 0.9, 0.74) * 4.5, ..matt(0.5, 0.45, 0.37, 0.4) },
            ),
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

/// Slabs of travertine half a metre wide: bands along u, pores in them.
fn travertine() -> Vec<u8> {
    let slab = SIZE / 2;
    paint(|x, y| {
        let bands = tiling(201, x, y, [2.0, 22.0], 4);
        let pores = (tiling(203, x, y, [26.0, 60.0], 2) - 0.42).max(0.0);
        let shade = 1.0 + 0.16 * bands + 0.05 * own(23, x / slab, y / slab) - 0.9 * pores;
        let joint = (x % slab).min(y % slab) < 1;
        let base = if joint { [0.44, 0.40, 0.34] } else { [0.70, 0.64, 0.54] };
        [base[0] * shade, base[1] * shade, base[2] * shade, 1.0]
    })
}

/// Boards along u, eight to a metre, of different shades, with a grain.
fn boards() -> Vec<u8> {
    let board = SIZE / 8;
    paint(|x, y| {
        let row = y / board;
        // Each row is shifted, so that butt joints do not line up.
        let along = (x + (hash(29, row as i32, 0, 0) >> 8) % SIZE) % SIZE;
        let joint = y % board == 0 || along == 0;
        let grain = tiling(211 + row, x, y, [5.0, 70.0], 3);
        let shade = (1.0 + 0.22 * own(31, row, 0) + 0.16 * grain) * if joint { 0.55 } else { 1.0 };
        [0.50 * shade, 0.36 * shade, 0.23 * shade, 1.0]
    })
}

/// Boards are cushioned by a millimetre.
fn board_height(_: u32, y: u32) -> f32 {
    let board = SIZE / 8;
    let edge = (y % board).min(board - 1 - y % board);
    0.001 * (edge.min(3) as f32 / 3.0)
}

/// Honey-coloured stone with pale and dark veins.
fn onyx() -> Vec<u8> {
    paint(|x, y| {
        let flow = tiling(221, x, y, [2.0, 4.0], 5);
        let vein = libm::powf((1.0 - (3.5 * flow).abs()).max(0.0), 4.0);
        let cloud = tiling(223, x, y, [5.0, 4.0], 4);
        let deep = libm::powf((1.0 - (5.0 * (cloud - 0.2)).abs()).max(0.0), 6.0);
        let color = Vec3::new(0.70, 0.45, 0.20) * (1.0 + 0.35 * cloud) + Vec3::new(0.24, 0.30, 0.30) * vein
            - Vec3::new(0.34, 0.27, 0.12) * deep;
        [color.x, color.y, color.z, 1.0]
    })
}

/// Weathered steel: orange and brown in patches and runs.
fn rust() -> Vec<u8> {
    paint(|x, y| {
        let patch = tiling(231, x, y, [6.0, 6.0], 5);
        let runs = tiling(233, x, y, [26.0, 3.0], 3);
        let t = (0.5 + 0.8 * patch + 0.3 * runs).clamp(0.0, 1.0);
        let color = Vec3::new(0.20, 0.085, 0.05).lerp(Vec3::new(0.50, 0.20, 0.08), t);
        [color.x, color.y, color.z, 1.0]
    })
}

/// Loops of a carpet, sixty-four to the texture's side.
fn weave_height(x: u32, y: u32) -> f32 {
    let cell = SIZE / 64;
    let half = |v: u32| (v % cell).min(cell - 1 - v % cell) as f32;
    0.0008 * half(x + cell / 2 * ((y / cell) % 2)).min(half(y))
}
