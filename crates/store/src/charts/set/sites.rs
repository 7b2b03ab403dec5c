//! Finds the sites of a chart set: for each texel the triangle nearest to it, and the place on that triangle's plane.

use glam::{DVec2, DVec3, Vec3};

use super::super::raster::touched;
use super::super::surface::NONE;
use super::{ChartSet, Site, TEXEL_FRACTION, finite};

/// Finds the sites of a chart set a piece at a time: the same as [`ChartSet::sites`], to the bit. All calls take the chart
/// set, positions and triangles of the first.
#[derive(Debug)]
pub struct SiteFinder {
    /// Per texel: distance squared in texels to the triangle nearest to it, and that triangle.
    nearest: Vec<(f64, u32)>,
    next_triangle: usize,
    next_texel: usize,
    sites: Vec<Site>,
}

impl SiteFinder {
    /// Nothing is found yet. 16 bytes a texel.
    pub fn new(charts: &ChartSet) -> SiteFinder {
        let texels = if charts.per_vertex { 0 } else { charts.texel_count() as usize };
        let nearest = vec![(f64::INFINITY, NONE); texels];
        SiteFinder { nearest, next_triangle: 0, next_texel: 0, sites: Vec::new() }
    }

    /// Goes on until about `budget` texels were looked at, one triangle at least (a set with a texel a vertex is done in one
    /// piece); gives how many were, 0 once all is done.
    pub fn work(
        &mut self,
        charts: &ChartSet,
        positions_rest: &[Vec3],
        triangles: &[[u32; 3]],
        budget: usize,
    ) -> usize {
        debug_assert_eq!(triangles.len(), charts.corners.len());
        if charts.per_vertex {
            if std::mem::replace(&mut self.next_triangle, triangles.len()) < triangles.len() {
                self.sites = charts.vertex_sites(positions_rest, triangles);
                return triangles.len();
            }
            return 0;
        }
        let mesh = Mesh { positions_rest, triangles };
        let mut visits = 0;
        while visits < budget && self.next_triangle < triangles.len() {
            let t = self.next_triangle;
            self.next_triangle += 1;
            visits += 1;
            if !mesh.is_finite(t) || !mesh.normal(t).is_finite() {
                continue;
            }
            let corners = &charts.corners[t];
            let page = usize::from(corners[0].page);
            let (first, width) = (charts.first_texels[page] as usize, usize::from(charts.pages[page].width));
            let flat = corners
                .map(|uv| DVec2::new(f64::from(uv.x), f64::from(uv.y)) / f64::from(TEXEL_FRACTION) - 0.5);
            let nearest = &mut self.nearest;
            touched(flat, 1.0, |x, y, closest| {
                visits += 1;
                let distance = closest.distance_squared(DVec2::new(f64::from(x), f64::from(y)));
                let slot = &mut nearest[first + y as usize * width + x as usize];
                if distance < slot.0 {
                    *slot = (distance, t as u32);
                }
                true
            });
        }
        if self.next_triangle == triangles.len() && self.next_texel == 0 && visits < budget {
            self.place_lone(charts);
        }
        while visits < budget && self.next_triangle == triangles.len() && self.next_texel < self.nearest.len()
        {
            self.collect(charts, &mesh, self.next_texel);
            self.next_texel += 1;
            visits += 1;
        }
        visits
    }

    /// The sites, ascending by texel, once there is nothing left to do.
    pub fn finish(self) -> Vec<Site> {
        self.sites
    }

    /// The texel of triangles without area stands for one place.
    fn place_lone(&mut self, charts: &ChartSet) {
        if let Some(lone) = charts.lone {
            let chart = &charts.charts[lone as usize];
            let [x, y] = chart.corner.map(usize::from);
            let page = usize::from(chart.page);
            let texel = charts.first_texels[page] as usize + y * usize::from(charts.pages[page].width) + x;
            self.nearest[texel] = (0.0, NONE);
        }
    }

    fn collect(&mut self, charts: &ChartSet, mesh: &Mesh<'_>, texel: usize) {
        let (distance, t) = self.nearest[texel];
        if distance == f64::INFINITY {
            return;
        }
        let (place, normal) = if t == NONE {
            let lone = charts.lone.map_or(DVec3::ZERO, |lone| charts.charts[lone as usize].flat.frame.origin);
            (lone, DVec3::NAN)
        } else {
            let chart = &charts.charts[charts.chart_of[t as usize] as usize];
            let (_, x, y) = charts.locate(texel as u32);
            let within = [x - chart.corner[0], y - chart.corner[1]];
            let normal = mesh.normal(t as usize);
            (chart.flat.place_over(within, mesh.corner_places(t as usize)[0], normal), normal)
        };
        self.sites.push(Site {
            texel: texel as u32,
            position_rest: finite(place.as_vec3()),
            normal_rest: charts.front(normal),
        });
    }
}

/// What a chart set was made from.
struct Mesh<'a> {
    positions_rest: &'a [Vec3],
    triangles: &'a [[u32; 3]],
}

impl Mesh<'_> {
    fn is_finite(&self, t: usize) -> bool {
        self.triangles[t].iter().all(|&v| self.positions_rest[v as usize].is_finite())
    }

    fn corner_places(&self, t: usize) -> [DVec3; 3] {
        self.triangles[t].map(|v| finite(self.positions_rest[v as usize]).as_dvec3())
    }

    fn normal(&self, t: usize) -> DVec3 {
        let [a, b, c] = self.corner_places(t);
        let area_vector = (b - a).cross(c - a);
        area_vector / area_vector.length()
    }
}
