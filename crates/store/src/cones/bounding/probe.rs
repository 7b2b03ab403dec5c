//! Probes: whether there is still light at the rim of a cone ([Stadlbauer2023] sec. 3.1.2, figure 7).

use std::f32::consts::{PI, TAU};

use glam::Vec3;

use super::cap::turn_towards;
use super::{BoundingEntry, BoundingParams, Cycle, angle_between, unit};

/// What a ray near the rim of a cone met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    /// Index of the cone.
    pub cone: usize,
    /// Unit vector along the ray: s.
    pub direction: Vec3,
    /// Whether it met a light.
    pub hit: bool,
}

impl BoundingEntry {
    /// A direction to probe a cone in: ε inside the rim, at `turn` (0 … 1) around the axis. `None` if there is no such cone.
    pub fn probe_direction(&self, cone: usize, turn: f32, params: &BoundingParams) -> Option<Vec3> {
        let cone = self.cones().get(cone)?;
        let (tangent, bitangent) = cone.direction.any_orthonormal_pair();
        let around = tangent * libm::cosf(TAU * turn) + bitangent * libm::sinf(TAU * turn);
        let angle = cone.angle * (1.0 - params.probe_inset.clamp(0.0, 1.0));
        Some(turn_towards(cone.direction, around, angle))
    }

    /// Applies what probes met, those of one update together: where there was a light, the cone is right. Otherwise a small one is
    /// discarded (or, without [`BoundingParams::discard`], stays), and another shrinks by δ = α − acos(D · s) and turns away from s by
    /// δ / 2. Then C is reduced, unless `cycle`, which the update began, says that it was already.
    ///
    /// Cones are named by their index before the call; probes of cones that are not there do nothing.
    pub fn probe(&mut self, probes: &[Probe], params: &BoundingParams, cycle: &mut Cycle) {
        let mut discarded = 0u8;
        for probe in probes.iter().filter(|probe| !probe.hit) {
            if probe.cone >= usize::from(self.count) {
                continue;
            }
            let Some(direction) = unit(probe.direction) else { continue };
            let cone = &mut self.cones[probe.cone];
            if cone.angle < params.small_rad {
                discarded |= u8::from(params.discard) << probe.cone;
                continue;
            }
            let shrunk = (cone.angle - angle_between(cone.direction, direction)).clamp(0.0, cone.angle);
            cone.angle -= shrunk;
            cone.direction = turn_towards(cone.direction, direction, (-0.5 * shrunk).max(-PI));
            cycle.turned_rad = cycle.turned_rad.max(0.5 * shrunk);
        }
        for at in (0..usize::from(self.count)).rev() {
            if discarded >> at & 1 == 1 {
                self.remove(at);
            }
        }
        self.reduce(cycle, params);
    }
}
