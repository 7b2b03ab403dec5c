//! A realistic cloud of points with visibility, from a seed alone: what the codec is measured on.

use std::collections::HashMap;
use std::sync::Arc;

use dapple_store::points::{PackedNormal, PointLayout, PointSet, PointStore, morton_code};
use glam::{Vec2, Vec3};

/// Spacing radius r0, metres; a quantum is a 32nd of it.
const SPACING_M: f32 = 0.067;

/// Points a square metre at that spacing.
const DENSITY: f32 = 256.0;

/// Splitmix64: random numbers from a seed.
struct Rng(u64);

impl Rng {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    /// In [0, 1).
    fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u32 << 24) as f32
    }

    fn below(&mut self, n: u64) -> u64 {
        self.bits() % n
    }

    fn between(&mut self, a: f32, b: f32) -> f32 {
        a + (b - a) * self.unit()
    }
}

/// A surface that points are thrown on.
enum Shape {
    /// Corner and two edges; the normal is their cross product's.
    Quad(Vec3, Vec3, Vec3),
    /// Foot of the axis, axis with its length, radius.
    Cylinder(Vec3, Vec3, f32),
}

impl Shape {
    fn area(&self) -> f32 {
        match self {
            Shape::Quad(_, u, v) => u.cross(*v).length(),
            Shape::Cylinder(_, axis, radius) => std::f32::consts::TAU * radius * axis.length(),
        }
    }

    /// A random place and its normal.
    fn sample(&self, rng: &mut Rng) -> (Vec3, Vec3) {
        let (s, t) = (rng.unit(), rng.unit());
        match self {
            Shape::Quad(corner, u, v) => (*corner + *u * s + *v * t, u.cross(*v).normalize()),
            Shape::Cylinder(foot, axis, radius) => {
                let (x, y) = axis.normalize().any_orthonormal_pair();
                let around = Vec2::from_angle(s * std::f32::consts::TAU);
                let normal = x * around.x + y * around.y;
                (*foot + *axis * t + normal * *radius, normal)
            }
        }
    }
}

/// Ground, boxes (half of them turned), pillars, slopes; `points` points' worth of surface.
fn shapes(rng: &mut Rng, points: usize) -> Vec<Vec<Shape>> {
    let area = points as f32 / DENSITY;
    let side = (area * 0.45).sqrt();
    let corner = Vec3::new(-side / 2.0, 0.0, -side / 2.0);
    let mut instances = vec![vec![Shape::Quad(corner, Vec3::Z * side, Vec3::X * side)]];
    let mut covered = side * side;
    while covered < area {
        let at = Vec3::new(rng.between(-side, side) / 2.0, 0.0, rng.between(-side, side) / 2.0);
        let shapes = match rng.below(4) {
            0 | 1 => {
                let turn = if rng.below(2) == 0 { 0.0 } else { rng.unit() * 1.5 };
                let (c, s) = Vec2::from_angle(turn).into();
                let u = Vec3::new(c, 0.0, s) * rng.between(0.4, 2.5);
                let w = Vec3::new(-s, 0.0, c) * rng.between(0.4, 2.5);
                let v = Vec3::Y * rng.between(0.3, 3.0);
                vec![
                    Shape::Quad(at, v, u),
                    Shape::Quad(at + w, u, v),
                    Shape::Quad(at, w, v),
                    Shape::Quad(at + u, v, w),
                    Shape::Quad(at + v, w, u),
                ]
            }
            2 => vec![Shape::Cylinder(at, Vec3::Y * rng.between(1.0, 4.0), rng.between(0.15, 0.5))],
            _ => {
                let tilt = Vec3::new(0.8, rng.between(0.2, 0.7), 0.1) * rng.between(1.0, 3.0);
                vec![Shape::Quad(at + Vec3::Y * 2.0, Vec3::Z * rng.between(1.0, 4.0), tilt)]
            }
        };
        covered += shapes.iter().map(Shape::area).sum::<f32>();
        instances.push(shapes);
    }
    instances
}

/// Darts thrown on the shapes, none closer to another than 0.72 spacings.
fn throw(rng: &mut Rng, shapes: &[Shape]) -> Vec<(Vec3, Vec3)> {
    let least = 0.72 * SPACING_M;
    let cell = |p: Vec3| (p / least).floor().to_array().map(|c| c as i32);
    let mut grid: HashMap<[i32; 3], Vec<Vec3>> = HashMap::new();
    let mut kept = Vec::new();
    for shape in shapes {
        let want = (shape.area() * DENSITY) as usize;
        let (mut have, mut tries) = (0, 0);
        while have < want && tries < want * 12 {
            tries += 1;
            let (p, n) = shape.sample(rng);
            let c = cell(p);
            let free = (0..27).all(|k| {
                let near = [c[0] + k % 3 - 1, c[1] + k / 3 % 3 - 1, c[2] + k / 9 - 1];
                grid.get(&near).is_none_or(|list| list.iter().all(|q| q.distance(p) >= least))
            });
            if free {
                grid.entry(c).or_default().push(p);
                kept.push((p, n));
                have += 1;
            }
        }
    }
    kept
}

/// A hall of about `points` points with the visibility that 64 rays a point would count.
pub(crate) fn hall(seed: u64, points: usize) -> PointStore {
    let mut rng = Rng(seed);
    let quantum = SPACING_M / 32.0;
    let mut sets = Vec::new();
    let mut places = Vec::new();
    let instances = shapes(&mut rng, points);
    for (instance, shapes) in instances.iter().enumerate() {
        let kept = throw(&mut rng, shapes);
        let Some(origin) = kept.iter().map(|k| k.0).reduce(Vec3::min) else { continue };
        let mut list: Vec<([u32; 3], PackedNormal, Vec3)> = kept
            .iter()
            .map(|&(p, n)| {
                let steps = ((p - origin) / quantum).round().to_array().map(|v| v as u32);
                (steps, PackedNormal::pack(n), p)
            })
            .collect();
        list.sort_by_key(|&(steps, n, _)| (morton_code(steps), n));
        sets.push(PointSet {
            instance: instance as u32,
            first: 0,
            origin_rest: origin,
            positions: list.iter().map(|l| l.0).collect(),
            normals: list.iter().map(|l| l.1).collect(),
        });
        places.extend(list.iter().map(|l| (instance, l.2)));
    }
    let layout = Arc::new(PointLayout::new(quantum, SPACING_M, sets).expect("points were sorted"));
    // Darker towards the foot of whatever stands here, open elsewhere.
    let centers: Vec<Vec3> = instances.iter().skip(1).map(|s| s[0].sample(&mut rng).0).collect();
    let visibility = places
        .iter()
        .map(|&(instance, p)| {
            let flat = |c: &Vec3| Vec3::new(c.x, 0.0, c.z).distance(p);
            let near = if instance == 0 { centers.iter().map(flat).fold(9.0, f32::min) } else { p.y };
            let open = if near > 0.6 { 1.0 } else { 0.5 + 0.5 * near / 0.6 };
            ((0..64).filter(|_| rng.unit() < open).count() * 255 / 64) as u8
        })
        .collect();
    PointStore::new(layout, visibility).expect("one value a point")
}

/// The values of `store` after movers have passed: a `share` of them is new, in clusters of 0.6 m around the
/// movers, by at least 5 and less the farther away.
pub(crate) fn moved(store: &PointStore, seed: u64, share: f32) -> PointStore {
    let mut rng = Rng(seed);
    let mut values = store.visibility().to_vec();
    let goal = (values.len() as f32 * share) as usize;
    let mut changed = 0;
    let layout = store.layout();
    while changed < goal {
        let set = &layout.sets()[rng.below(layout.sets().len().min(8) as u64) as usize];
        let center = set.position_rest(rng.below(set.len() as u64) as usize, layout.quantum_m());
        for i in 0..set.len() {
            let distance = set.position_rest(i, layout.quantum_m()).distance(center);
            if distance < 0.6 && rng.unit() < 0.7 {
                let value = &mut values[set.first as usize + i];
                let step = (rng.unit() - rng.unit()) * 60.0 * (1.0 - distance / 0.8);
                let new = (f32::from(*value) + step).clamp(0.0, 255.0) as u8;
                if new.abs_diff(*value) > 4 {
                    *value = new;
                    changed += 1;
                }
            }
        }
    }
    PointStore::new(layout.clone(), values).expect("as many values as before")
}
