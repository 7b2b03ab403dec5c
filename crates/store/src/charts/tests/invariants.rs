//! What holds for every chart set.

use glam::{DVec2, DVec3, Vec3};

use super::super::*;

/// Figures of a checked set.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Figures {
    /// Texels with a site.
    pub(super) sites: usize,
    /// Texels of the charts' rectangles.
    pub(super) in_charts: u64,
    /// Farthest that a sample lies from the site of a texel it reads, in texels of its chart.
    pub(super) farthest: f64,
    /// Farthest apart that two triangles of a chart lie over one texel centre, in texels.
    pub(super) deepest: f64,
}

/// Panics where a set breaks a promise.
pub(super) fn check(
    positions: &[Vec3],
    triangles: &[[u32; 3]],
    params: &ChartParams,
    set: &ChartSet,
) -> Figures {
    check_pages(set, params);
    assert_eq!(set.corners().len(), triangles.len());
    let sites = set.sites(positions, triangles);
    check_sites(&sites, set);
    check_vertices(triangles, set);
    let mut figures = Figures { sites: sites.len(), ..Figures::default() };
    let mut site_at = vec![None; set.texel_count() as usize];
    for site in &sites {
        site_at[site.texel as usize] = Some(*site);
    }
    if set.is_per_vertex() {
        check_vertex_texels(positions, triangles, set, &site_at);
        figures.in_charts = u64::from(set.texel_count());
        return figures;
    }
    let mesh = Mesh { positions, triangles, params, set, site_at };
    for chart in 0..set.chart_count() {
        let (_, [_, _, width, height]) = set.chart_rectangle(chart);
        figures.in_charts += u64::from(width) * u64::from(height);
    }
    for t in 0..triangles.len() {
        mesh.check_triangle(t, &mut figures);
    }
    mesh.check_depth(&mut figures);
    figures
}

fn check_pages(set: &ChartSet, params: &ChartParams) {
    let mut first = 0;
    let mut painted: Vec<Vec<bool>> = Vec::new();
    for (i, page) in set.pages().iter().enumerate() {
        assert!(page.width >= 1 && page.height >= 1, "{page:?}");
        assert!(page.width <= params.max_side && page.height <= params.max_side, "{page:?}");
        assert_eq!(set.first_texel_of_page(i), first);
        assert_eq!(set.locate(first), (i as u16, 0, 0));
        first += page.area();
        assert_eq!(set.locate(first - 1), (i as u16, page.width - 1, page.height - 1));
        painted.push(vec![false; page.area() as usize]);
    }
    assert_eq!(set.texel_count(), first);
    assert!(first <= MOST_TEXELS);
    for chart in 0..set.chart_count() {
        let (page, [x, y, width, height]) = set.chart_rectangle(chart);
        let size = set.pages()[usize::from(page)];
        for row in y..y + height {
            for column in x..x + width {
                assert!(row < size.height && column < size.width, "chart {chart} leaves its page");
                let cell = &mut painted[usize::from(page)]
                    [usize::from(row) * usize::from(size.width) + usize::from(column)];
                assert!(!*cell, "chart {chart} lies over another");
                *cell = true;
            }
        }
    }
}

fn check_sites(sites: &[Site], set: &ChartSet) {
    assert!(sites.windows(2).all(|w| w[0].texel < w[1].texel));
    for site in sites {
        assert!(site.texel < set.texel_count());
        assert!(site.position_rest.is_finite(), "{site:?}");
        assert!((site.normal_rest.length() - 1.0).abs() < 1e-4, "{site:?}");
    }
}

fn check_vertices(triangles: &[[u32; 3]], set: &ChartSet) {
    let vertices = set.vertices(triangles);
    assert_eq!(vertices.source.len(), vertices.uv.len());
    for (t, triangle) in vertices.triangles.iter().enumerate() {
        for k in 0..3 {
            assert_eq!(vertices.source[triangle[k] as usize], triangles[t][k]);
            assert_eq!(vertices.uv[triangle[k] as usize], set.corner_uv_of(t)[k]);
        }
    }
    let both: Vec<_> = vertices.source.iter().zip(&vertices.uv).collect();
    assert!(both.windows(2).all(|w| w[0] < w[1]), "a vertex is there twice");
}

fn check_vertex_texels(positions: &[Vec3], triangles: &[[u32; 3]], set: &ChartSet, site_at: &[Option<Site>]) {
    for (t, triangle) in triangles.iter().enumerate() {
        let corners = set.corner_uv_of(t);
        assert!(corners.iter().all(|uv| uv.page == corners[0].page));
        for k in 0..3 {
            let (x, y) = (corners[k].x / TEXEL_FRACTION, corners[k].y / TEXEL_FRACTION);
            assert_eq!(corners[k].x % TEXEL_FRACTION, TEXEL_FRACTION / 2);
            assert_eq!(corners[k].y % TEXEL_FRACTION, TEXEL_FRACTION / 2);
            let width = u32::from(set.pages()[usize::from(corners[k].page)].width);
            let texel = set.first_texel_of_page(corners[k].page.into()) + u32::from(y) * width + u32::from(x);
            assert_eq!(site_at[texel as usize].unwrap().position_rest, positions[triangle[k] as usize]);
        }
    }
}

struct Mesh<'a> {
    positions: &'a [Vec3],
    triangles: &'a [[u32; 3]],
    params: &'a ChartParams,
    set: &'a ChartSet,
    site_at: Vec<Option<Site>>,
}

impl Mesh<'_> {
    fn corners(&self, t: usize) -> [DVec3; 3] {
        self.triangles[t].map(|v| self.positions[v as usize].as_dvec3())
    }

    fn double_area(&self, t: usize) -> f64 {
        let [a, b, c] = self.corners(t);
        (b - a).cross(c - a).length()
    }

    /// Half a step of a coordinate and the rounding of positions, in texels.
    fn rounding(&self, t: usize, step: f64) -> f64 {
        let largest = self.corners(t).into_iter().fold(0.0, |m: f64, p| m.max(p.abs().max_element()));
        1.0 / 32.0 + 4e-7 * largest / step
    }

    fn check_triangle(&self, t: usize, figures: &mut Figures) {
        let chart = self.set.chart_of_triangle(t);
        let (page, [x, y, width, height]) = self.set.chart_rectangle(chart);
        for uv in self.set.corner_uv_of(t) {
            assert_eq!(uv.page, page);
            let within = |at: u16, first: u16, count: u16| {
                let half = TEXEL_FRACTION / 2;
                at >= first * TEXEL_FRACTION + half && at <= (first + count - 1) * TEXEL_FRACTION + half
            };
            assert!(within(uv.x, x, width) && within(uv.y, y, height), "triangle {t} leaves chart {chart}");
        }
        let [step_x, step_y] = self.set.chart_step_m(chart).map(f64::from);
        let (step, texel) = (step_x.max(step_y), f64::from(self.set.texel_m()));
        let is_solid = self.double_area(t) > 0.0;
        let corners = self.corners(t);
        for [v, w] in
            [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.33, 0.33], [0.5, 0.0], [0.0, 0.5], [0.5, 0.5], [0.1, 0.7]]
        {
            let (at_page, at_x, at_y) = self.set.texel_at(t, [v, w]);
            assert_eq!(at_page, page);
            let place =
                corners[0] * f64::from(1.0 - v - w) + corners[1] * f64::from(v) + corners[2] * f64::from(w);
            for (tap_x, tap_y) in taps(at_x, at_y) {
                assert!(
                    (x..x + width).contains(&tap_x) && (y..y + height).contains(&tap_y),
                    "triangle {t} reads outside"
                );
                let page_width = u32::from(self.set.pages()[usize::from(page)].width);
                let texel = self.set.first_texel_of_page(page.into())
                    + u32::from(tap_y) * page_width
                    + u32::from(tap_x);
                let Some(site) = self.site_at[texel as usize] else {
                    panic!("triangle {t} at {v}, {w} reads texel {tap_x}, {tap_y} which has no site")
                };
                if is_solid {
                    let distance = place.distance(site.position_rest.as_dvec3()) / step;
                    figures.farthest = figures.farthest.max(distance - self.rounding(t, step));
                }
            }
        }
        if is_solid {
            assert!(step <= texel * 1.0002 || self.is_large(chart), "step {step} for texels of {texel}");
            self.check_stretch(t, [step_x, step_y], [width, height]);
        }
    }

    /// Whether one triangle of the chart alone is longer than a page.
    fn is_large(&self, chart: u32) -> bool {
        let limit = f64::from(self.params.max_side - 1) * f64::from(self.set.texel_m());
        (0..self.triangles.len()).filter(|&t| self.set.chart_of_triangle(t) == chart).any(|t| {
            let [a, b, c] = self.corners(t);
            a.distance(b).max(b.distance(c)).max(c.distance(a)) > limit
        })
    }

    fn check_stretch(&self, t: usize, step: [f64; 2], size: [u16; 2]) {
        let (uv, corners) = (self.set.corner_uv_of(t), self.corners(t));
        for k in 0..3 {
            let (a, b) = (uv[k], uv[(k + 1) % 3]);
            let across =
                |a: u16, b: u16, step: f64| (f64::from(a) - f64::from(b)) / f64::from(TEXEL_FRACTION) * step;
            let flat = across(a.x, b.x, step[0]).hypot(across(a.y, b.y, step[1]));
            let rest = corners[k].distance(corners[(k + 1) % 3]);
            let longest = step[0].max(step[1]);
            let rounding = 1.5 * self.rounding(t, longest) * longest;
            assert!(flat <= rest * 1.0001 + rounding, "edge of {rest} m is {flat} m long in its chart");
            // What is thinner than a third of a texel is drawn together.
            let thin = 0.36
                * step[0].max(step[1])
                * f64::from(size.iter().filter(|&&n| n == 1).count() as u32).sqrt();
            let least = f64::from(self.params.least_cosine) * rest * 0.9999 - rounding - thin;
            assert!(flat >= least, "edge of {rest} m is {flat} m long in its chart");
        }
    }

    /// No two triangles of a chart lie far from each other over the same texel.
    fn check_depth(&self, figures: &mut Figures) {
        let mut first_at: Vec<Option<DVec3>> = vec![None; self.site_at.len()];
        for t in (0..self.triangles.len()).filter(|&t| self.double_area(t) > 0.0) {
            let chart = self.set.chart_of_triangle(t);
            let step = self.set.chart_step_m(chart).map(f64::from);
            let step = step[0].max(step[1]);
            let uv = self.set.corner_uv_of(t);
            let [a, b, c] =
                uv.map(|uv| DVec2::new(f64::from(uv.x), f64::from(uv.y)) / f64::from(TEXEL_FRACTION) - 0.5);
            let doubled = (b - a).perp_dot(c - a);
            let page = usize::from(uv[0].page);
            let (low, high) = (a.min(b).min(c).ceil(), a.max(b).max(c).floor());
            let corners = self.corners(t);
            for y in low.y as i64..=high.y as i64 {
                for x in low.x as i64..=high.x as i64 {
                    let p = DVec2::new(x as f64, y as f64);
                    let (v, w) = ((p - a).perp_dot(c - a) / doubled, (b - a).perp_dot(p - a) / doubled);
                    if doubled.abs() < 0.1 || v < 0.02 || w < 0.02 || v + w > 0.98 {
                        continue;
                    }
                    let place = corners[0] * (1.0 - v - w) + corners[1] * v + corners[2] * w;
                    let width = u32::from(self.set.pages()[page].width);
                    let texel = (self.set.first_texel_of_page(page) + y as u32 * width + x as u32) as usize;
                    let other = *first_at[texel].get_or_insert(place);
                    let apart = other.distance(place) / step - 2.0 * self.rounding(t, step);
                    figures.deepest = figures.deepest.max(apart);
                    assert!(apart < 2.0, "triangle {t} lies {apart} texels from another over the same texel");
                }
            }
        }
    }
}

/// Texels that a bilinear read gives weight.
fn taps(x: f32, y: f32) -> Vec<(u16, u16)> {
    let along = |at: f32| {
        let at = at - 0.5;
        let (first, part) = (at.floor(), at - at.floor());
        let mut taps = Vec::new();
        if part < 0.9999 {
            taps.push(first as u16);
        }
        if part > 0.0001 {
            taps.push(first as u16 + 1);
        }
        taps
    };
    along(y).into_iter().flat_map(|ty| along(x).into_iter().map(move |tx| (tx, ty))).collect()
}
