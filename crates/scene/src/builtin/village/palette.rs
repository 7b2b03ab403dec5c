//! What the village is made of.

use glam::{Vec3, Vec4};

use crate::builtin::builder::{GlbBuilder, MaterialId, MaterialSpec};
use crate::builtin::noise::hash;
use crate::builtin::paint::{SIZE, normal_map, paint, tiling};
use crate::builtin::{BuiltinError, emitters};

/// A material by what it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stuff {
    Grass,
    Road,
    Earth,
    Water,
    Rock,
    Stone,
    Plaster,
    Ochre,
    Daub,
    Boards,
    Timber,
    Oak,
    Log,
    Shingle,
    Slate,
    Thatch,
    Clay,
    Iron,
    DarkSteel,
    Steel,
    Brass,
    Pane,
    Paint,
    Red,
    Sack,
    Cloth,
    Bark,
    Leaf,
    Needle,
    Blade,
    Flame,
    Moon,
}

/// Materials in the order of [`Stuff`].
pub(super) struct Palette(Vec<MaterialId>);

/// Radiances: a torch lights what is 1.5 m away with about 2 lx, the moon the land with about 0.5 lx.
const FLAME: Vec3 = Vec3::new(400.0, 200.0, 68.0);
const MOON: Vec3 = Vec3::new(15.0, 18.5, 25.0);

impl Palette {
    /// Adds all materials, their textures and normal maps.
    pub(super) fn new(b: &mut GlbBuilder) -> Result<Palette, BuiltinError> {
        let size = [SIZE; 2];
        let grass = b.texture("grass", size, &grass(), false)?;
        let road = b.texture("road", size, &road(), false)?;
        let pebbles = b.texture("road-relief", size, &normal_map(2.0, road_height), false)?;
        let turf = b.texture("grass-relief", size, &normal_map(2.0, grass_height), false)?;
        let boards = b.texture("boards", size, &boards(), false)?;
        let stone = b.texture("stone", size, &stone(), false)?;
        let courses = b.texture("stone-relief", size, &normal_map(1.0, stone_height), false)?;
        let shingle = b.texture("shingle", size, &shingle(), false)?;
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
        let sheet = |spec: MaterialSpec| MaterialSpec { double_sided: true, ..spec };
        let specs = [
            ("grass", MaterialSpec { normal_map: Some(turf), ..painted(grass, [1.0; 3], 0.9) }),
            ("road", MaterialSpec { normal_map: Some(pebbles), ..painted(road, [1.0; 3], 0.55) }),
            ("earth", matt(0.12, 0.085, 0.06, 0.95)),
            ("water", matt(0.02, 0.04, 0.05, 0.1)),
            ("rock", painted(stone, [0.8, 0.8, 0.84], 0.8)),
            ("stone", MaterialSpec { normal_map: Some(courses), ..painted(stone, [1.0; 3], 0.75) }),
            ("plaster", matt(0.66, 0.61, 0.52, 0.9)),
            ("ochre", matt(0.60, 0.40, 0.19, 0.9)),
            ("daub", matt(0.52, 0.36, 0.28, 0.9)),
            ("boards", painted(boards, [1.0; 3], 0.65)),
            ("timber", painted(boards, [0.42, 0.36, 0.32], 0.6)),
            ("oak", painted(boards, [0.72, 0.64, 0.54], 0.5)),
            ("log", painted(boards, [0.95, 0.82, 0.66], 0.8)),
            ("shingle", painted(shingle, [0.62, 0.44, 0.33], 0.7)),
            ("slate", painted(shingle, [0.36, 0.41, 0.47], 0.4)),
            ("thatch", painted(shingle, [0.80, 0.64, 0.38], 0.9)),
            ("clay", matt(0.46, 0.20, 0.11, 0.5)),
            ("iron", metal(0.20, 0.19, 0.19, 0.5)),
            ("dark-steel", metal(0.28, 0.28, 0.30, 0.3)),
            ("steel", metal(0.62, 0.63, 0.65, 0.18)),
            ("brass", metal(0.80, 0.58, 0.27, 0.25)),
            ("pane", matt(0.03, 0.035, 0.04, 0.12)),
            ("paint", matt(0.09, 0.22, 0.25, 0.4)),
            ("red", matt(0.45, 0.055, 0.045, 0.35)),
            ("sack", matt(0.48, 0.38, 0.25, 0.95)),
            ("cloth", sheet(matt(0.50, 0.13, 0.09, 0.9))),
            ("bark", painted(boards, [0.40, 0.34, 0.29], 0.9)),
            ("leaf", sheet(matt(0.13, 0.23, 0.05, 0.55))),
            ("needle", sheet(matt(0.05, 0.13, 0.07, 0.6))),
            ("blade", sheet(matt(0.14, 0.24, 0.06, 0.7))),
            ("flame", emitters::glow(FLAME)),
            ("moon", emitters::glow(MOON)),
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

/// Short turf with bare patches, two metres a side.
fn grass() -> Vec<u8> {
    paint(|x, y| {
        let patch = (0.5 + 0.9 * tiling(601, x, y, [5.0, 5.0], 4)).clamp(0.0, 1.0);
        let fine = tiling(603, x, y, [60.0, 60.0], 2);
        let color =
            Vec3::new(0.17, 0.15, 0.085).lerp(Vec3::new(0.115, 0.20, 0.055), patch) * (1.0 + 0.45 * fine);
        [color.x, color.y, color.z, 1.0]
    })
}

fn grass_height(x: u32, y: u32) -> f32 {
    0.035 * tiling(603, x, y, [60.0, 60.0], 2) + 0.03 * tiling(601, x, y, [12.0, 12.0], 3)
}

/// How far a texel is from the middle of its pebble, 0 … 1, and a number of its own.
fn pebble(x: u32, y: u32) -> (f32, f32) {
    const CELLS: u32 = 20;
    let at = |v: u32| v as f32 * CELLS as f32 / SIZE as f32;
    let (px, py) = (at(x), at(y));
    let (mut nearest, mut mine) = (9.0_f32, 0.0);
    for dy in -1..=1_i32 {
        for dx in -1..=1_i32 {
            let cell = |v: f32, d: i32| (libm::floorf(v) as i32 + d).rem_euclid(CELLS as i32) as u32;
            let (cx, cy) = (cell(px, dx), cell(py, dy));
            let mx = libm::floorf(px) + dx as f32 + 0.5 + 0.7 * own(611, cx, cy);
            let my = libm::floorf(py) + dy as f32 + 0.5 + 0.7 * own(613, cx, cy);
            let size = 0.62 + 0.3 * own(615, cx, cy);
            let d = libm::sqrtf((px - mx) * (px - mx) + (py - my) * (py - my)) / size;
            if d < nearest {
                (nearest, mine) = (d, own(617, cx, cy));
            }
        }
    }
    (nearest, mine)
}

/// Trodden earth with pebbles in it.
fn road() -> Vec<u8> {
    paint(|x, y| {
        let (d, mine) = pebble(x, y);
        let dust = 1.0 + 0.3 * tiling(621, x, y, [9.0, 9.0], 4);
        let color = match d < 0.9 && mine > -0.3 {
            true => Vec3::new(0.30, 0.28, 0.26) * (1.0 + 0.6 * mine),
            false => Vec3::new(0.21, 0.165, 0.115),
        };
        let color = color * dust;
        [color.x, color.y, color.z, 1.0]
    })
}

fn road_height(x: u32, y: u32) -> f32 {
    let (d, mine) = pebble(x, y);
    let stone = if mine > -0.3 { 0.02 * (1.0 - d * d).max(0.0) } else { 0.0 };
    stone + 0.012 * tiling(621, x, y, [9.0, 9.0], 4)
}

/// Sawn boards along u, with a grain, six to a metre.
fn boards() -> Vec<u8> {
    paint(|x, y| {
        let row = y * 6 / SIZE;
        let grain = tiling(631 + row, x, y, [4.0, 60.0], 3);
        let knots = (tiling(641, x, y, [7.0, 9.0], 2) - 0.45).max(0.0);
        let shade = 1.0 + 0.2 * own(33, row, 0) + 0.28 * grain - 1.1 * knots;
        [0.45 * shade, 0.33 * shade, 0.22 * shade, 1.0]
    })
}

/// Which stone of a rough wall a texel is of, and how far it is from a joint in texels.
fn course(x: u32, y: u32) -> ([u32; 2], u32) {
    let rows = 5;
    let high = SIZE / rows + 1;
    let row = y / high;
    let wide = SIZE / 4;
    let along = (x + (hash(43, row as i32, 0, 0) >> 8) % SIZE) % SIZE;
    let edge = |v: u32, n: u32| (v % n).min(n - 1 - v % n);
    ([along / wide, row], edge(along, wide).min(edge(y, high)))
}

/// Field stones in mortar.
fn stone() -> Vec<u8> {
    paint(|x, y| {
        let (which, edge) = course(x, y);
        let shade = 1.0 + 0.35 * own(47, which[0], which[1]) + 0.25 * tiling(651, x, y, [14.0, 14.0], 4);
        let base = if edge < 3 { [0.27, 0.25, 0.22] } else { [0.36, 0.345, 0.32] };
        [base[0] * shade, base[1] * shade, base[2] * shade, 1.0]
    })
}

fn stone_height(x: u32, y: u32) -> f32 {
    let (_, edge) = course(x, y);
    0.02 * libm::sqrtf((edge as f32 / 14.0).min(1.0)) + 0.008 * tiling(651, x, y, [14.0, 14.0], 4)
}

/// Weathered wood or stone, pale: colours come from the material.
fn shingle() -> Vec<u8> {
    paint(|x, y| {
        let shade = 0.72 + 0.3 * tiling(661, x, y, [40.0, 5.0], 3) + 0.26 * tiling(663, x, y, [5.0, 5.0], 3);
        [shade, shade, 0.98 * shade, 1.0]
    })
}
