//! How a walker walks: feet are put down along its route and stay there, everything else follows from them.
//!
//! A foot stands for a part of its cycle: it lands on the heel, rolls flat and leaves over the ball, and each of these
//! turns about the point that bears, which does not slide. Legs are solved from hip to ankle. All lengths are those of a
//! body of usual height; the walker's size scales them and its route.

use std::f32::consts::{PI, TAU};

use glam::{Mat3, Quat, Vec2, Vec3};

use super::body::*;
use super::route::Route;

/// The part of a cycle during which a foot stands.
const STANCE: f32 = 0.62;
/// When in its cycle the body passes the standing foot.
const PASSING: f32 = 0.27;
/// Until when the foot rolls flat, and from when the heel rises.
const FLAT: [f32; 2] = [0.12, 0.38];
/// How far toes point up on landing and the heel has risen on leaving, radians.
const PITCH: [f32; 2] = [0.33, 0.72];
/// Half the distance between the lines that the feet follow.
const TRACK: f32 = 0.08;
/// How far feet turn outward, radians.
const TOE_OUT: f32 = 0.09;
/// How high a swinging foot passes over the floor.
const CLEARANCE: f32 = 0.028;

/// A way of walking.
#[derive(Clone, Debug)]
pub(super) struct Gait {
    route: Route,
    /// Seconds for once around.
    seconds: f32,
    /// Cycles (two steps) for once around, a whole number: the last frame meets the first.
    cycles: u32,
    /// Where on the route the walker is at time 0, and in which phase its left foot is.
    start: [f64; 2],
    /// Height as a multiple of the usual.
    size: f32,
    /// Metres a second, for a body of usual height.
    speed: f32,
    /// Lowest and highest height of the hips.
    height: [f32; 2],
}

/// A body's pose: where the pelvis is, and how each joint is turned in its parent.
pub(super) struct BodyPose {
    pub(super) pelvis: Vec3,
    pub(super) turns: [Quat; JOINTS],
}

/// A foot's pose: the ankle, the heading, how far the toes point up, and how far they are bent up against the foot.
#[derive(Clone, Copy)]
struct Foot {
    ankle: Vec3,
    heading: f32,
    pitch: f32,
    toes: f32,
}

impl Gait {
    /// A walker of a size (1 is usual) that goes once around a route in `seconds`, from a part of it, its left foot in a phase.
    pub(super) fn new(route: Route, size: f32, seconds: f32, start: f64, phase: f64) -> Gait {
        let speed = route.length() / size / seconds;
        // Faster walkers take longer strides, and more of them.
        let usual = 0.45 + 0.68 * speed;
        let cycles = libm::roundf(speed * seconds / usual).max(1.0) as u32;
        let stride = speed * seconds / cycles as f32;
        // As low as the landing leg asks for, higher when passing over it.
        let ankle = ANKLE * libm::cosf(PITCH[0]) - SOLE[0] * libm::sinf(PITCH[0]);
        let (leg, reach) = (0.99 * (LEG[0] + LEG[1]), PASSING * stride + 0.005);
        let low = ankle + libm::sqrtf((leg * leg - reach * reach).max(0.0));
        let height = [low, (low + 0.05).min(0.918).max(low)];
        Gait { route, seconds, cycles, start: [start, phase], size, speed, height }
    }

    /// The pose at a time, seconds.
    pub(super) fn pose(&self, time: f64) -> BodyPose {
        let cycle = self.cycle(time, 0);
        let part = self.start[0] + time / f64::from(self.seconds);
        let (place, heading) = (self.place(part), self.route.heading(part));
        let phase = (cycle - libm::floor(cycle)) as f32;
        let wave = |turns: f32, at: f32| libm::cosf(TAU * turns * (phase - at));

        // Lowest when both feet stand, highest over one; towards the foot that stands.
        let hips = 0.5 * (self.height[0] + self.height[1])
            - 0.5 * (self.height[1] - self.height[0]) * wave(2.0, 0.05);
        let facing = turn(heading);
        let sway = 0.022 * wave(1.0, PASSING + 0.02);
        let pelvis = Vec3::new(place.x, hips + HIP[1], place.y) + facing * Vec3::X * sway;
        // The hip of the leg in front goes with it; the hip of the swinging leg sinks.
        let twist = -0.10 * wave(1.0, 0.0);
        let drop = 0.045 * wave(1.0, PASSING + 0.02);
        // Into the turn.
        let bend = self.route.heading(part + 0.15 / f64::from(self.route.length()))
            - self.route.heading(part - 0.15 / f64::from(self.route.length()));
        let curvature = wrapped(bend) * self.size / 0.3;
        let lean = -0.6 * libm::atan2f(self.speed * self.speed * curvature, 9.81);

        let mut turns = [Quat::IDENTITY; JOINTS];
        let base = facing * turn(twist) * about_z(drop) * about_x(0.03);
        turns[PELVIS] = base;
        turns[SPINE] = turn(-0.9 * twist) * about_z(0.5 * lean - 0.7 * drop) * about_x(0.03);
        turns[CHEST] = turn(-0.9 * twist) * about_z(0.5 * lean - 0.4 * drop);
        // The head looks ahead and stays level.
        let ahead = wrapped(self.route.heading(part + 0.5 / f64::from(self.route.length())) - heading);
        turns[HEAD] = turn(0.8 * twist + 0.7 * ahead) * about_z(-0.7 * lean) * about_x(-0.04);

        let swing = (0.32 + 0.3 * (self.speed - 1.1)).clamp(0.2, 0.45);
        for side in 0..2 {
            let back = libm::cosf(TAU * phase + PI * side as f32);
            let [upper, lower] = ARMS[side];
            turns[upper] = about_x(swing * back - 0.03);
            turns[lower] = about_x(-0.34 + 0.2 * back);
            let foot = self.foot(time, side);
            let hip = pelvis + base * Vec3::new(HIP[0] * sign(side), -HIP[1], 0.0);
            let ahead = facing * Vec3::Z + turn(foot.heading) * Vec3::Z;
            let [thigh, shin] = solve_leg(hip, foot.ankle, ahead);
            let sole = turn(foot.heading) * about_x(-foot.pitch);
            let [a, b, c, d] = LEGS[side];
            turns[a] = base.conjugate() * thigh;
            turns[b] = thigh.conjugate() * shin;
            turns[c] = shin.conjugate() * sole;
            turns[d] = about_x(-foot.toes);
        }
        BodyPose { pelvis, turns: turns.map(Quat::normalize) }
    }

    /// Cycles of a foot until a time; whole numbers are landings.
    fn cycle(&self, time: f64, side: usize) -> f64 {
        f64::from(self.cycles) * time / f64::from(self.seconds) + self.start[1] + 0.5 * side as f64
    }

    /// A part of the route in the body's units.
    fn place(&self, part: f64) -> Vec2 {
        self.route.at(part) / self.size
    }

    /// Where the ankle stands flat after landing `cycle`, on the floor, and the foot's heading.
    fn footprint(&self, cycle: f64, side: usize) -> (Vec3, f32) {
        let passing = cycle + f64::from(PASSING) - self.cycle(0.0, side);
        let part = self.start[0] + passing / f64::from(self.cycles);
        let (place, heading) = (self.place(part), self.route.heading(part));
        let offset = turn(heading) * Vec3::new(TRACK * sign(side), 0.0, 0.03);
        (Vec3::new(place.x, 0.0, place.y) + offset, heading + TOE_OUT * sign(side))
    }

    fn foot(&self, time: f64, side: usize) -> Foot {
        let cycle = self.cycle(time, side);
        let landing = libm::floor(cycle);
        let phase = (cycle - landing) as f32;
        if phase < STANCE { self.standing(landing, side, phase) } else { self.swinging(landing, side, phase) }
    }

    /// A foot on the floor: what bears it stays where it is.
    fn standing(&self, landing: f64, side: usize, phase: f32) -> Foot {
        let (print, heading) = self.footprint(landing, side);
        let pitch = if phase < FLAT[0] {
            let t = phase / FLAT[0];
            PITCH[0] * (1.0 - t * t * (3.0 - 2.0 * t))
        } else {
            let t = ((phase - FLAT[1]) / (STANCE - FLAT[1])).max(0.0);
            -PITCH[1] * t * t * (1.5 - 0.5 * t)
        };
        let bearing = Vec3::new(0.0, -ANKLE, if pitch > 0.0 { SOLE[0] } else { SOLE[1] });
        let facing = turn(heading);
        let pivot = print + facing * Vec3::Z * bearing.z;
        let ankle = pivot - facing * about_x(-pitch) * bearing;
        Foot { ankle, heading, pitch, toes: (-pitch).max(0.0) }
    }

    /// A foot in the air, from one footprint to the next.
    fn swinging(&self, landing: f64, side: usize, phase: f32) -> Foot {
        let u = (phase - STANCE) / (1.0 - STANCE);
        let (from, to) = (self.standing(landing, side, STANCE), self.standing(landing + 1.0, side, 0.0));
        // It leaves and lands at the speed that it has on the floor.
        let near = 0.002;
        let before = self.standing(landing, side, STANCE - near).ankle;
        let after = self.standing(landing + 1.0, side, near).ankle;
        let rate = (1.0 - STANCE) / near;
        let mut ankle =
            hermite([from.ankle, to.ankle], [(from.ankle - before) * rate, (after - to.ankle) * rate], u);
        let heading = from.heading + wrapped(to.heading - from.heading) * u * u * (3.0 - 2.0 * u);
        let middle = -0.22;
        let pitch = if u < 0.45 {
            hermite([from.pitch, middle].map(Vec3::splat), [-0.77, 0.85].map(Vec3::splat), u / 0.45).x
        } else {
            hermite([middle, to.pitch].map(Vec3::splat), [1.04, 0.0].map(Vec3::splat), (u - 0.45) / 0.55).x
        };
        let fade = (1.0 - u / 0.4).max(0.0);
        let toes = from.toes * fade * fade;
        // As high as its lowest point asks for.
        let lowest = sole_points(pitch, toes).into_iter().fold(f32::INFINITY, f32::min);
        ankle.y = CLEARANCE * 4.0 * u * (1.0 - u) - lowest;
        Foot { ankle, heading, pitch, toes }
    }
}

/// Heights of heel, ball and tip of the toes above the ankle.
fn sole_points(pitch: f32, toes: f32) -> [f32; 3] {
    let (foot, tip) = (about_x(-pitch), about_x(-pitch - toes));
    let ball = foot * Vec3::new(0.0, -ANKLE, SOLE[1]);
    let heel = foot * Vec3::new(0.0, -ANKLE, SOLE[0]);
    [heel.y, ball.y, (ball + tip * Vec3::Z * (SOLE[2] - SOLE[1])).y]
}

/// The turns of upper and lower leg that bring the ankle where it belongs, the knee towards `ahead`.
fn solve_leg(hip: Vec3, ankle: Vec3, ahead: Vec3) -> [Quat; 2] {
    let way = ankle - hip;
    let [a, b] = LEG;
    let length = way.length().min(0.9999 * (a + b));
    let down = way.normalize_or(Vec3::NEG_Y);
    let along = (a * a + length * length - b * b) / (2.0 * length);
    let out = libm::sqrtf((a * a - along * along).max(0.0));
    let front = (ahead - down * down.dot(ahead)).normalize_or(Vec3::Z);
    let knee = down * along + front * out;
    [knee, down * length - knee].map(|bone| {
        let up = -bone.normalize_or(Vec3::NEG_Y);
        let front = (front - up * up.dot(front)).normalize_or(Vec3::Z);
        Quat::from_mat3(&Mat3::from_cols(up.cross(front), up, front)).normalize()
    })
}

/// The cubic from one value to another with given rates at both ends.
fn hermite([p, q]: [Vec3; 2], [m, n]: [Vec3; 2], u: f32) -> Vec3 {
    let (u2, u3) = (u * u, u * u * u);
    p * (2.0 * u3 - 3.0 * u2 + 1.0) + m * (u3 - 2.0 * u2 + u) + q * (3.0 * u2 - 2.0 * u3) + n * (u3 - u2)
}

/// +1 on the left, −1 on the right.
fn sign(side: usize) -> f32 {
    if side == 0 { 1.0 } else { -1.0 }
}

/// An angle within ±π.
fn wrapped(angle: f32) -> f32 {
    angle - TAU * libm::roundf(angle / TAU)
}

fn turn(angle: f32) -> Quat {
    Quat::from_rotation_y(angle)
}

fn about_x(angle: f32) -> Quat {
    Quat::from_rotation_x(angle)
}

fn about_z(angle: f32) -> Quat {
    Quat::from_rotation_z(angle)
}
