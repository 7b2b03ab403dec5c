//! Caps of the sphere: the least one about two, and turning an axis.

use std::f32::consts::PI;

use glam::Vec3;

use super::{BoundingCone, angle_between};

/// Turns a unit vector towards another by an angle, along the shortest way; negative, away from it. Where both are the same or
/// opposite, any way is the shortest.
pub(super) fn turn_towards(from: Vec3, to: Vec3, angle: f32) -> Vec3 {
    let across = (to - from * from.dot(to)).normalize_or(from.any_orthonormal_vector());
    (from * libm::cosf(angle) + across * libm::sinf(angle)).normalize_or(from)
}

/// Direction and angle of the least cap that holds both cones.
pub(super) fn enclose(a: &BoundingCone, b: &BoundingCone) -> (Vec3, f32) {
    let between = angle_between(a.direction, b.direction);
    if between + b.angle <= a.angle {
        return (a.direction, a.angle);
    }
    if between + a.angle <= b.angle {
        return (b.direction, b.angle);
    }
    let angle = 0.5 * (a.angle + b.angle + between);
    if angle >= PI {
        return (a.direction, PI);
    }
    (turn_towards(a.direction, b.direction, angle - a.angle), angle)
}

/// Angle between the rims of two cones, radians; negative where they overlap.
pub(super) fn gap(a: &BoundingCone, b: &BoundingCone) -> f32 {
    angle_between(a.direction, b.direction) - a.angle - b.angle
}
