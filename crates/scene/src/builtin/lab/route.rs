//! Closed ways on the floor, measured by their length.

use glam::Vec2;

/// Pieces that a route is measured in.
const PIECES: u32 = 4096;

/// A smooth closed way (x, z): the uniform cubic B-spline of control points.
#[derive(Clone, Debug)]
pub(super) struct Route {
    points: Vec<Vec2>,
    /// Length of the way to each point; one more than points, the last is the whole.
    way: Vec<f64>,
}

impl Route {
    /// The way around at least four control points.
    pub(super) fn new(control: &[Vec2]) -> Route {
        let n = control.len().max(1) as u32;
        let at = |i: u32| control.get((i % n) as usize).copied().unwrap_or(Vec2::ZERO);
        let points: Vec<Vec2> = (0..PIECES)
            .map(|k| {
                let s = f64::from(k) * f64::from(n) / f64::from(PIECES);
                let i = s as u32;
                let t = (s - f64::from(i)) as f32;
                let (t2, t3) = (t * t, t * t * t);
                let weights = [
                    (1.0 - 3.0 * t + 3.0 * t2 - t3) / 6.0,
                    (4.0 - 6.0 * t2 + 3.0 * t3) / 6.0,
                    (1.0 + 3.0 * t + 3.0 * t2 - 3.0 * t3) / 6.0,
                    t3 / 6.0,
                ];
                (0..4).fold(Vec2::ZERO, |p, k| p + at(i + k) * weights[k as usize])
            })
            .collect();
        let mut way = vec![0.0_f64];
        for (i, p) in points.iter().enumerate() {
            way.push(way[i] + f64::from(p.distance(points[(i + 1) % points.len()])));
        }
        Route { points, way }
    }

    /// Its length, metres.
    pub(super) fn length(&self) -> f32 {
        self.way[self.points.len()] as f32
    }

    /// The place at a part of the way (1 is once around, any number is allowed).
    pub(super) fn at(&self, part: f64) -> Vec2 {
        let goal = part.rem_euclid(1.0) * self.way[self.points.len()];
        let i = self.way.partition_point(|&w| w <= goal).clamp(1, self.points.len()) - 1;
        let t = (goal - self.way[i]) / (self.way[i + 1] - self.way[i]).max(1e-12);
        self.points[i].lerp(self.points[(i + 1) % self.points.len()], t as f32)
    }

    /// The heading at a part of the way: the turn about the vertical that brings +Z there, radians within ±π.
    /// It is the mean over a foot's length, so that a walker does not twitch.
    pub(super) fn heading(&self, part: f64) -> f32 {
        let reach = 0.12 / self.way[self.points.len()].max(1e-6);
        let d = self.at(part + reach) - self.at(part - reach);
        libm::atan2f(d.x, d.y)
    }
}
