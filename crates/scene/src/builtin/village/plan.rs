//! Measures of the village: where everything is, whatever the detail. Metres; the green's middle is the origin, +X is east, +Z south.

use glam::{Vec2, Vec3};

use crate::builtin::noise::{fractal_noise, unit};

/// Length of the animation, seconds.
pub(super) const SECONDS: f32 = 15.0;
/// Frames of a camera path.
pub(super) const FRAMES: u32 = 900;
/// Half the side of the square of land.
pub(super) const LAND: f32 = 30.5;
/// How deep the land's block reaches.
pub(super) const BEDROCK: f32 = -2.5;

/// The road's middle line, from west to east.
pub(super) const ROAD: [[f32; 2]; 9] = [
    [-33.0, 4.2],
    [-27.0, 3.4],
    [-18.0, 2.4],
    [-9.5, 0.2],
    [-0.5, 0.6],
    [8.5, 2.0],
    [17.5, 1.0],
    [26.0, -2.0],
    [33.0, -4.5],
];
/// The lane from the road to the hall.
pub(super) const LANE: [[f32; 2]; 3] = [[0.0, 0.5], [-0.4, -5.0], [-0.6, -10.2]];
/// Half the road's width.
pub(super) const ROAD_HALF: f32 = 1.75;

/// The pond: middle (x, z), half extents, and the water's height.
pub(super) const POND: ([f32; 2], [f32; 2], f32) = ([-0.9, 8.9], [3.1, 2.5], -0.22);

/// The moon: where, its radius, and where it shines to.
pub(super) const MOON: (Vec3, f32, Vec3) = (Vec3::new(-33.0, 46.0, 20.0), 5.0, Vec3::new(1.0, 0.0, -1.0));

/// A house: middle (x, z), turn about the vertical (its front looks along +Z unturned), which design.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plot {
    pub(super) at: [f32; 2],
    pub(super) turn: f32,
    pub(super) design: usize,
}

const fn plot(x: f32, z: f32, turn: f32, design: usize) -> Plot {
    Plot { at: [x, z], turn, design }
}

const PI: f32 = std::f32::consts::PI;

/// The houses; the first is the hall.
pub(super) const PLOTS: [Plot; 9] = [
    plot(-0.6, -14.6, 0.0, 3),
    plot(-20.6, -4.6, 0.16, 0),
    plot(-11.6, -6.6, 0.26, 1),
    plot(-16.4, 9.6, PI + 0.2, 2),
    plot(-7.8, 8.6, PI + 0.12, 0),
    plot(6.2, 9.6, PI - 0.12, 1),
    plot(15.2, 8.6, PI + 0.1, 2),
    plot(11.2, -6.2, -0.12, 2),
    plot(20.4, -7.4, 0.28, 0),
];

/// A design: half extents (x, z), heights of eaves and ridge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Design {
    pub(super) half: [f32; 2],
    pub(super) eaves: f32,
    pub(super) ridge: f32,
}

/// Three houses and the hall.
pub(super) const DESIGNS: [Design; 4] = [
    Design { half: [3.1, 2.4], eaves: 2.6, ridge: 5.4 },
    Design { half: [2.7, 2.6], eaves: 3.3, ridge: 6.5 },
    Design { half: [3.5, 2.5], eaves: 2.4, ridge: 5.0 },
    Design { half: [6.6, 3.4], eaves: 2.7, ridge: 7.0 },
];

/// The windmill: middle (x, z), its turn, the height of its axle above the ground there, and how far its sails reach.
pub(super) const MILL: ([f32; 2], f32, f32, f32) = ([-23.6, -18.0], 0.75, 8.2, 5.2);

/// Torches on posts (x, z).
pub(super) const TORCHES: [[f32; 2]; 30] = [
    [-29.5, 6.2],
    [-24.6, 0.7],
    [-21.5, 5.3],
    [-15.4, -0.9],
    [-12.8, 3.6],
    [-8.2, -2.5],
    [-5.4, 3.0],
    [-3.0, -2.9],
    [-2.9, -6.6],
    [1.9, -6.4],
    [-3.1, -9.6],
    [2.0, -9.5],
    [3.9, 3.6],
    [5.6, -1.5],
    [9.8, 4.9],
    [13.6, -1.6],
    [16.2, 3.9],
    [20.6, -2.2],
    [22.6, 2.0],
    [28.2, -5.4],
    [27.4, 0.4],
    [-4.6, 6.3],
    [2.7, 7.4],
    [-1.0, 12.2],
    [-24.0, -8.6],
    [-18.0, -13.6],
    [10.4, -11.6],
    [6.6, -4.6],
    [-10.6, 12.6],
    [11.0, 12.0],
];

/// Barrels and the like (x, z): on the ground, where nothing else is.
pub(super) const BARRELS: [[f32; 2]; 17] = [
    [-18.6, -1.4],
    [-17.9, -1.7],
    [-18.2, -0.8],
    [-9.0, -3.4],
    [-8.4, -3.9],
    [-13.5, 5.9],
    [-14.2, 6.1],
    [-5.1, 5.4],
    [9.3, -2.7],
    [9.9, -3.0],
    [12.7, 5.3],
    [13.3, 5.0],
    [18.7, -3.6],
    [17.8, -3.9],
    [5.3, -10.5],
    [5.8, -9.9],
    [4.2, 6.3],
];
/// Crates: (x, z), turn and scale; stacked ones are told by their height above the ground.
pub(super) const CRATES: [([f32; 2], f32, f32, f32); 11] = [
    ([-21.9, -0.7], 0.2, 1.0, 0.0),
    ([-22.9, -0.9], 0.5, 0.9, 0.0),
    ([-22.3, -0.75], 0.9, 0.7, 0.8),
    ([-7.0, -4.6], 0.1, 0.8, 0.0),
    ([8.3, 6.3], -0.2, 0.9, 0.0),
    ([7.4, 6.5], 0.3, 1.0, 0.0),
    ([7.7, 6.4], 0.6, 0.6, 0.8),
    ([19.4, 5.2], 0.4, 1.0, 0.0),
    ([-8.0, -11.6], 0.0, 1.0, 0.0),
    ([-8.1, -12.6], 0.2, 0.9, 0.0),
    ([22.6, -3.7], 0.7, 0.8, 0.0),
];
/// Carts: (x, z) and turn.
pub(super) const CARTS: [([f32; 2], f32); 3] =
    [([-5.6, -3.6], 0.7), ([16.6, -3.7], 2.9), ([-19.0, 5.6], -0.35)];
/// The well (x, z).
pub(super) const WELL: [f32; 2] = [3.4, -3.4];
/// The market stalls: (x, z) and turn.
pub(super) const STALLS: [([f32; 2], f32); 3] =
    [([-3.5, 3.9], 3.2), ([9.0, -1.7], 0.0), ([-13.3, -1.65], 0.25)];
/// Stacks of fire wood: (x, z) and turn.
pub(super) const STACKS: [([f32; 2], f32); 4] =
    [([-24.9, -4.2], 1.75), ([-12.35, 8.8], 1.75), ([19.35, 9.2], 1.65), ([15.8, -6.6], 1.45)];
/// Where the fire and its kettle are (x, z).
pub(super) const KETTLE: [f32; 2] = [-6.4, -7.0];

/// Fences: corners (x, z) of runs, which are filled with panels of about 2 m.
pub(super) const FENCES: [&[[f32; 2]]; 7] = [
    &[[-25.6, -1.6], [-26.6, -7.6], [-22.0, -10.4], [-15.9, -9.6]],
    &[[-22.0, 7.0], [-22.6, 13.4], [-14.0, 14.6], [-11.7, 10.0]],
    &[[9.8, 7.2], [10.6, 12.8], [1.8, 14.0]],
    &[[19.8, 6.4], [20.2, 12.2], [13.0, 13.2]],
    &[[15.4, -4.6], [16.0, -10.2], [9.4, -10.8], [7.4, -8.4]],
    &[[24.4, -5.6], [25.8, -11.0], [17.6, -12.2]],
    &[[-9.0, -13.0], [-9.4, -19.6], [7.6, -19.8], [8.4, -13.6]],
];

/// Leafy trees: (x, z), turn, scale.
pub(super) const TREES: [([f32; 2], f32, f32); 12] = [
    ([-5.4, 15.2], 0.3, 1.15),
    ([-11.8, 16.4], 1.9, 1.0),
    ([3.0, 16.4], 2.2, 0.95),
    ([-15.9, -11.8], 4.0, 1.0),
    ([-10.6, -12.4], 5.2, 0.9),
    ([10.4, -13.9], 0.9, 1.2),
    ([15.6, -12.8], 3.1, 1.1),
    ([23.7, 7.0], 1.2, 1.05),
    ([11.4, 15.2], 0.1, 1.1),
    ([-24.6, 9.6], 2.7, 1.1),
    ([25.8, -13.6], 4.4, 1.15),
    ([-13.2, -15.0], 5.0, 1.25),
];

/// Firs: how many are tried on the hills around.
pub(super) const FIRS: u32 = 72;

/// Rocks: (x, z) and radius.
pub(super) const ROCKS: [([f32; 2], f32); 14] = [
    ([-4.3, 8.0], 0.42),
    ([-4.0, 9.4], 0.3),
    ([2.6, 9.9], 0.4),
    ([1.9, 11.0], 0.28),
    ([-2.6, 11.7], 0.5),
    ([-27.6, -2.4], 0.9),
    ([-28.6, -1.4], 0.6),
    ([24.6, 12.0], 1.1),
    ([25.8, 11.2], 0.7),
    ([-19.8, -15.8], 0.9),
    ([-26.2, -14.6], 0.7),
    ([27.8, -9.0], 0.9),
    ([3.6, -22.4], 1.2),
    ([-15.0, 19.4], 1.1),
];

/// 0 below `a`, 1 above `b`, smooth between.
pub(super) fn smooth(a: f32, b: f32, v: f32) -> f32 {
    let t = ((v - a) / (b - a)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Distance from a line of points.
fn from_line(p: Vec2, line: &[[f32; 2]]) -> f32 {
    let mut nearest = f32::INFINITY;
    for pair in line.windows(2) {
        let (a, b) = (Vec2::from(pair[0]), Vec2::from(pair[1]));
        let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        nearest = nearest.min(p.distance(a.lerp(b, t)));
    }
    nearest
}

/// Distance from the edge of the road or lane, negative on it.
pub(super) fn off_road(p: Vec2) -> f32 {
    let waver = 0.28 * fractal_noise(503, Vec3::new(p.x, 0.0, p.y) * 0.45, 2);
    let road = from_line(p, &ROAD) - ROAD_HALF;
    let lane = from_line(p, &LANE) - 0.72 * ROAD_HALF;
    road.min(lane) + waver
}

/// How far a place is from the pond's middle, 1 at its shore.
pub(super) fn off_pond(p: Vec2) -> f32 {
    let ([x, z], [a, b], _) = POND;
    let q = Vec2::new((p.x - x) / a, (p.y - z) / b);
    q.length() * (1.0 + 0.09 * fractal_noise(509, Vec3::new(p.x, 0.0, p.y) * 0.7, 2))
}

/// The ground's height at a place (x, z).
pub(super) fn ground(p: Vec2) -> f32 {
    let at = Vec3::new(p.x, 0.0, p.y);
    let r = p.length();
    let swell = 0.16 * fractal_noise(501, at / 6.5, 3);
    let hills = smooth(18.0, 31.0, r) * (2.6 + 2.2 * fractal_noise(505, at / 11.0, 3));
    let road = from_line(p, &ROAD).min(from_line(p, &LANE));
    // The road runs through the hills in a hollow way, its crown a little lower than the green.
    let cut = 1.0 - smooth(ROAD_HALF, ROAD_HALF + 6.0, road);
    let level =
        (swell + hills) * (1.0 - 0.75 * cut) - 0.07 * (1.0 - smooth(0.6 * ROAD_HALF, 1.3 * ROAD_HALF, road));
    // Houses stand on level ground.
    let mut even = 0.0_f32;
    for plot in PLOTS {
        let half = DESIGNS[plot.design].half;
        let reach = half[0].max(half[1]);
        even = even.max(1.0 - smooth(reach, reach + 3.0, p.distance(Vec2::from(plot.at))));
    }
    let level = level * (1.0 - 0.8 * even);
    let pond = 1.0 - smooth(0.55, 1.12, off_pond(p));
    level * (1.0 - pond) - 0.75 * pond
}

/// The place on the ground at (x, z).
pub(super) fn on_ground(at: [f32; 2]) -> Vec3 {
    Vec3::new(at[0], ground(Vec2::from(at)), at[1])
}

/// Where firs stand: place (x, z), turn, scale. They keep off the road, the mill, its view, and each other.
pub(super) fn firs() -> Vec<([f32; 2], f32, f32)> {
    let mut placed: Vec<([f32; 2], f32, f32)> = Vec::new();
    for i in 0..FIRS {
        let (s, c) = libm::sincosf(std::f32::consts::TAU * (i as f32 + 0.8 * unit(511, i)) / FIRS as f32);
        let r = 21.5 + 12.0 * unit(512, i);
        let p = Vec2::new(r * c, r * s);
        let far = placed.iter().all(|(q, _, _)| p.distance(Vec2::from(*q)) > 2.4);
        let free = PLOTS.iter().all(|plot| p.distance(Vec2::from(plot.at)) > 7.5)
            && TORCHES.iter().all(|t| p.distance(Vec2::from(*t)) > 2.2)
            && TREES.iter().all(|t| p.distance(Vec2::from(t.0)) > 4.0)
            && ROCKS.iter().all(|t| p.distance(Vec2::from(t.0)) > 2.6)
            && p.distance(Vec2::from(MILL.0)) > 7.5
            && off_road(p) > 2.2;
        if far && free && p.x.abs() < LAND - 1.5 && p.y.abs() < LAND - 1.5 {
            placed.push((p.to_array(), 6.0 * unit(513, i), 0.75 + 0.6 * unit(514, i)));
        }
    }
    placed
}
