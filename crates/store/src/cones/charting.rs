//! Where a place on an instance's surface lies in the texels of its charts.

use std::sync::Arc;

use glam::Vec3;

use super::key::SLABS;
use crate::charts::ChartSet;

/// Furthest coordinate in texels that is told apart; what lies beyond is taken to be there.
const MOST_COORDINATE: f32 = 1e5;

/// A place in the texels of a chart, or of a slab.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChartPlace {
    /// Chart of the instance's set, or [`SLABS`] + 0 … 5 (the axis that the normal points along: +X, −X, +Y, −Y, +Z, −Z).
    pub chart: u32,
    /// In texels from the border of the chart's rectangle; the centre of its first texel is at 0.5. In a slab the other two
    /// coordinates, in texels from the origin of rest space.
    pub uv: [f32; 2],
    /// Along a slab's axis, in texels. 0 on a chart.
    pub depth: f32,
    /// Texels of the chart's rectangle along x and y; 0 in a slab, which has no border.
    pub size: [u16; 2],
    /// Edge of a texel at rest, metres.
    pub texel_m: f32,
}

impl ChartPlace {
    /// Finds the place. `barycentrics` are the weights of the triangle's second and third corner; `position_rest` and
    /// `normal_rest` are only used for a mesh with a texel a vertex ([`ChartSet::is_per_vertex`]), which has no charts to lay
    /// an image on: there a slab is what shares the axis its normal is nearest to, and a depth along it.
    ///
    /// `None` for a triangle that is not there, a set without texels, and places that are not finite.
    pub fn of(
        charts: &ChartSet,
        triangle: u32,
        barycentrics: [f32; 2],
        position_rest: Vec3,
        normal_rest: Vec3,
    ) -> Option<ChartPlace> {
        let triangle = triangle as usize;
        if charts.is_per_vertex() {
            return ChartPlace::in_slab(position_rest, normal_rest, charts.texel_m());
        }
        if triangle >= charts.corners().len() || !barycentrics.iter().all(|b| b.is_finite()) {
            return None;
        }
        let chart = charts.chart_of_triangle(triangle);
        let (_, [left, top, width, height]) = charts.chart_rectangle(chart);
        let (_, x, y) = charts.texel_at(triangle, barycentrics);
        let [step_x, step_y] = charts.chart_step_m(chart);
        // Barycentrics a little out of their range must not leave the chart.
        let within = |v: f32, low: u16, size: u16| (v - f32::from(low)).clamp(0.5, f32::from(size) - 0.5);
        Some(ChartPlace {
            chart,
            uv: [within(x, left, width), within(y, top, height)],
            depth: 0.0,
            size: [width, height],
            texel_m: (step_x * step_y).sqrt(),
        })
    }

    /// The place in the slab along the axis that the normal is nearest to.
    pub fn in_slab(position_rest: Vec3, normal_rest: Vec3, texel_m: f32) -> Option<ChartPlace> {
        if !position_rest.is_finite() || !normal_rest.is_finite() || !texel_m.is_normal() || texel_m < 0.0 {
            return None;
        }
        let size = normal_rest.abs();
        let axis = if size.x >= size.y && size.x >= size.z {
            0
        } else if size.y >= size.z {
            1
        } else {
            2
        };
        let p = (position_rest / texel_m).clamp(Vec3::splat(-MOST_COORDINATE), Vec3::splat(MOST_COORDINATE));
        let side = u32::from(normal_rest[axis] < 0.0);
        Some(ChartPlace {
            chart: SLABS + 2 * axis as u32 + side,
            uv: [p[(axis + 1) % 3], p[(axis + 2) % 3]],
            depth: p[axis],
            size: [0; 2],
            texel_m,
        })
    }
}

/// The chart sets of all instances.
#[derive(Clone, Debug, Default)]
pub struct Charting {
    sets: Vec<Option<Arc<ChartSet>>>,
}

impl Charting {
    /// One set an instance, in the order of instances; `None` for one that carries no cones.
    pub fn new(sets: Vec<Option<Arc<ChartSet>>>) -> Charting {
        Charting { sets }
    }

    /// [`ChartPlace::of`] an instance, of which `rest` gives position and normal at rest if they are needed; `None` also where it has no
    /// charts.
    pub fn place_with(
        &self,
        instance: u32,
        triangle: u32,
        barycentrics: [f32; 2],
        rest: impl FnOnce() -> Option<(Vec3, Vec3)>,
    ) -> Option<ChartPlace> {
        let charts = self.sets.get(instance as usize)?.as_ref()?;
        let (position, normal) = if charts.is_per_vertex() { rest()? } else { (Vec3::ZERO, Vec3::ZERO) };
        ChartPlace::of(charts, triangle, barycentrics, position, normal)
    }

    /// [`ChartPlace::of`] an instance; `None` also where it has no charts.
    pub fn place(
        &self,
        instance: u32,
        triangle: u32,
        barycentrics: [f32; 2],
        position_rest: Vec3,
        normal_rest: Vec3,
    ) -> Option<ChartPlace> {
        let charts = self.sets.get(instance as usize)?.as_ref()?;
        ChartPlace::of(charts, triangle, barycentrics, position_rest, normal_rest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::charts::ChartParams;

    /// A square of 1 m in two triangles, and its charts with texels of 0.1 m.
    fn square() -> ChartSet {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::X - Vec3::Z, -Vec3::Z];
        let params = ChartParams { texel_m: 0.1, ..ChartParams::for_spacing(0.1, false) };
        ChartSet::new(&positions, &[[0, 1, 2], [0, 2, 3]], &params).unwrap()
    }

    #[test]
    fn places_move_by_texels_as_they_do_on_the_surface() {
        let charting = Charting::new(vec![None, Some(Arc::new(square()))]);
        let at = |v, w| charting.place(1, 0, [v, w], Vec3::ZERO, Vec3::Y).unwrap();
        let corner = at(0.0, 0.0);
        assert!((corner.texel_m - 0.1).abs() < 0.01, "{corner:?}");
        // Along the edge from the first corner to the second: one metre.
        let along = at(1.0, 0.0);
        let moved = (along.uv[0] - corner.uv[0]).hypot(along.uv[1] - corner.uv[1]);
        assert!((moved * corner.texel_m - 1.0).abs() < 0.02, "{moved}");
        // The second triangle continues it.
        let shared = charting.place(1, 1, [1.0, 0.0], Vec3::ZERO, Vec3::Y).unwrap();
        let same = at(0.0, 1.0);
        assert_eq!((shared.uv, shared.chart), (same.uv, same.chart));
        for outside in [at(-3.0, 0.0), at(40.0, 2.0)] {
            let limit = outside.size.map(|s| f32::from(s) - 0.5);
            assert!((0..2).all(|k| outside.uv[k] >= 0.5 && outside.uv[k] <= limit[k]), "{outside:?}");
        }
    }

    #[test]
    fn nothing_where_there_is_nothing() {
        let charting = Charting::new(vec![None, Some(Arc::new(square()))]);
        for (instance, triangle, v) in [(0, 0, 0.0), (2, 0, 0.0), (1, 2, 0.0), (1, 0, f32::NAN)] {
            assert_eq!(charting.place(instance, triangle, [v, 0.0], Vec3::ZERO, Vec3::Y), None);
        }
        assert_eq!(ChartPlace::in_slab(Vec3::NAN, Vec3::Y, 0.1), None);
        assert_eq!(ChartPlace::in_slab(Vec3::ZERO, Vec3::Y, 0.0), None);
    }

    #[test]
    fn slabs_lie_across_the_normal() {
        let p = Vec3::new(1.0, 2.0, 3.0);
        let place = ChartPlace::in_slab(p, Vec3::new(0.1, -0.9, 0.2), 0.5).unwrap();
        assert_eq!((place.chart, place.uv, place.depth), (SLABS + 3, [6.0, 2.0], 4.0));
        let far = ChartPlace::in_slab(Vec3::splat(1e30), Vec3::Z, 1e-3).unwrap();
        assert!(far.uv[0] <= MOST_COORDINATE && far.depth <= MOST_COORDINATE);
    }
}
