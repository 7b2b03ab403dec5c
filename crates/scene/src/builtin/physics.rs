//! Rolls boulders through simple solids with a deterministic physics engine and thins the result to key frames.

use glam::{Quat, Vec3};
use rapier3d::prelude as rapier;

/// Simulated steps a second.
const STEPS_PER_SECOND: u32 = 240;
/// Sampled poses a second.
pub const SAMPLES_PER_SECOND: u32 = 60;

/// A fixed body that others collide with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Solid {
    /// An axis-aligned box.
    Box {
        /// Smallest corner.
        min: Vec3,
        /// Largest corner.
        max: Vec3,
    },
    /// An upright cylinder.
    Cylinder {
        /// Centre of the lower disc.
        base: Vec3,
        /// Radius, metres.
        radius: f32,
        /// Height, metres.
        height: f32,
    },
}

impl Solid {
    /// Distance from a point to the solid, metres; 0 inside.
    pub fn distance(&self, p: Vec3) -> f32 {
        match *self {
            Solid::Box { min, max } => (min - p).max(p - max).max(Vec3::ZERO).length(),
            Solid::Cylinder { base, radius, height } => {
                let d = p - base;
                let across = libm::sqrtf(d.x * d.x + d.z * d.z) - radius;
                let along = (-d.y).max(d.y - height);
                let (across, along) = (across.max(0.0), along.max(0.0));
                libm::sqrtf(across * across + along * along)
            }
        }
    }
}

/// A push that sets a body's velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Push {
    /// When, seconds.
    pub time: f32,
    /// Velocity it has from then on, m/s; it starts to roll without sliding on level ground.
    pub velocity: Vec3,
}

/// A convex body that falls and rolls.
#[derive(Clone, Debug)]
pub struct Body {
    /// Points whose convex hull collides, about the body's origin, metres.
    pub hull: Vec<Vec3>,
    /// Mean radius, metres.
    pub radius: f32,
    /// Where the origin is at time 0.
    pub position: Vec3,
    /// Rotation at time 0.
    pub rotation: Quat,
    /// Pushes in the order of time; the body is held fast until the first.
    pub pushes: Vec<Push>,
}

/// Poses of one body at 0, 1/60, 2/60 … seconds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion {
    /// Positions of the origin.
    pub positions: Vec<Vec3>,
    /// Rotations, neighbours in one hemisphere.
    pub rotations: Vec<Quat>,
}

/// Lets bodies fall and roll for a number of samples after the first. Equal input gives equal bits on every machine.
pub fn simulate(solids: &[Solid], bodies: &[Body], samples: u32) -> Vec<Motion> {
    let mut world = rapier::PhysicsWorld::new();
    world.integration_parameters.dt = 1.0 / STEPS_PER_SECOND as f32;
    for solid in solids {
        let collider = match *solid {
            Solid::Box { min, max } => {
                let half = 0.5 * (max - min);
                rapier::ColliderBuilder::cuboid(half.x, half.y, half.z).translation(vector(0.5 * (min + max)))
            }
            Solid::Cylinder { base, radius, height } => {
                rapier::ColliderBuilder::cylinder(0.5 * height, radius)
                    .translation(vector(base + Vec3::Y * (0.5 * height)))
            }
        };
        world.insert_collider(collider.friction(0.8).restitution(0.25), None);
    }
    let handles: Vec<rapier::RigidBodyHandle> = bodies
        .iter()
        .map(|body| {
            let [x, y, z, w] = body.rotation.to_array();
            let hull: Vec<rapier::Vector> = body.hull.iter().map(|&p| vector(p)).collect();
            let shape = rapier::ColliderBuilder::convex_hull(&hull)
                .unwrap_or_else(|| rapier::ColliderBuilder::ball(body.radius));
            let mut rigid = rapier::RigidBodyBuilder::fixed()
                .translation(vector(body.position))
                .angular_damping(0.15)
                .build();
            rigid.set_rotation(rapier::Rotation::from_xyzw(x, y, z, w), false);
            world.insert(rigid, shape.friction(0.8).restitution(0.3).density(2500.0)).0
        })
        .collect();
    let mut motions = vec![Motion::default(); bodies.len()];
    let substeps = STEPS_PER_SECOND / SAMPLES_PER_SECOND;
    for sample in 0..=samples {
        for (motion, &handle) in motions.iter_mut().zip(&handles) {
            let rigid = &world.bodies[handle];
            let t = rigid.translation();
            let r = rigid.rotation();
            let mut rotation = Quat::from_xyzw(r.x, r.y, r.z, r.w).normalize();
            if motion.rotations.last().is_some_and(|last| last.dot(rotation) < 0.0) {
                rotation = -rotation;
            }
            motion.positions.push(Vec3::new(t.x, t.y, t.z));
            motion.rotations.push(rotation);
        }
        for substep in 0..substeps {
            let step = sample * substeps + substep;
            for (body, &handle) in bodies.iter().zip(&handles) {
                for push in body.pushes.iter().filter(|p| step_at(p.time) == step) {
                    let roll = Vec3::Y.cross(push.velocity) / body.radius;
                    world.bodies[handle].set_body_type(rapier::RigidBodyType::Dynamic, true);
                    world.bodies[handle].set_linvel(vector(push.velocity), true);
                    world.bodies[handle].set_angvel(vector(roll), true);
                }
            }
            world.step();
        }
    }
    motions
}

fn step_at(time: f32) -> u32 {
    libm::roundf(time * STEPS_PER_SECOND as f32) as u32
}

fn vector(v: Vec3) -> rapier::Vector {
    rapier::Vector::new(v.x, v.y, v.z)
}

/// Indices of the positions to keep so that linear interpolation of the kept ones is within `tolerance_m` of each dropped one.
pub fn thin_positions(values: &[Vec3], tolerance_m: f32) -> Vec<usize> {
    thin(values.len(), |a, b, k, t| values[a].lerp(values[b], t).distance(values[k]) <= tolerance_m)
}

/// Indices of the rotations to keep so that spherical interpolation of the kept ones is within `tolerance` radians of each
/// dropped one.
pub fn thin_rotations(values: &[Quat], tolerance: f32) -> Vec<usize> {
    // |dot| = cos(angle / 2); the sine of the difference keeps its precision for small angles.
    thin(values.len(), |a, b, k, t| {
        let difference = values[a].slerp(values[b], t).conjugate() * values[k];
        2.0 * difference.xyz().length() <= tolerance
    })
}

/// Times of samples, seconds.
pub fn frame_times(frames: &[usize]) -> Vec<f32> {
    frames.iter().map(|&k| k as f32 / SAMPLES_PER_SECOND as f32).collect()
}

fn thin(count: usize, fits: impl Fn(usize, usize, usize, f32) -> bool) -> Vec<usize> {
    let mut kept = vec![0];
    let mut from = 0;
    while from + 1 < count {
        let mut to = from + 1;
        while to + 1 < count
            && (from + 1..=to).all(|k| fits(from, to + 1, k, (k - from) as f32 / (to + 1 - from) as f32))
        {
            to += 1;
        }
        kept.push(to);
        from = to;
    }
    // A body that never moves needs one key.
    if let [first, last] = kept[..]
        && fits(first, first, last, 0.0)
    {
        kept.pop();
    }
    kept
}
