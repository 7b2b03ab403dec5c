//! A mesh made ready for charts: equal positions welded, normals, and which triangle continues which.

use glam::{DVec3, Vec3};

/// No triangle.
pub(super) const NONE: u32 = u32::MAX;

/// Most pairs of half-edges compared at an edge where more than two triangles meet; beyond, the edge is a border.
const MOST_PAIRS: usize = 64;

/// Welded triangles and what lies across their edges.
#[derive(Debug)]
pub(super) struct Surface {
    /// Each place once.
    pub(super) places: Vec<DVec3>,
    /// Corners of each triangle, as indices into `places`.
    pub(super) corners: Vec<[u32; 3]>,
    /// Unit normal by winding; zero for a triangle without area.
    pub(super) normals: Vec<DVec3>,
    /// Twice the area.
    pub(super) double_areas: Vec<f64>,
    /// The triangle that continues the surface across the edge from corner k to corner k + 1, or [`NONE`].
    pub(super) neighbours: Vec<[u32; 3]>,
    /// The first triangle with the same corners and winding, if this one repeats it; else [`NONE`].
    pub(super) repeats: Vec<u32>,
}

impl Surface {
    /// `triangles` must be in range of `positions`. Coordinates that are not finite count as 0, their triangles as
    /// without area.
    pub(super) fn new(positions: &[Vec3], triangles: &[[u32; 3]]) -> Surface {
        let (places, place_of) = weld(positions);
        let corners: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|v| place_of[v as usize])).collect();
        let mut normals = vec![DVec3::ZERO; triangles.len()];
        let mut double_areas = vec![0.0; triangles.len()];
        for (t, triangle) in triangles.iter().enumerate() {
            if triangle.iter().all(|&v| positions[v as usize].is_finite()) {
                let [a, b, c] = corners[t].map(|p| places[p as usize]);
                let area_vector = (b - a).cross(c - a);
                let double_area = area_vector.length();
                if double_area > 0.0 {
                    normals[t] = area_vector / double_area;
                    double_areas[t] = double_area;
                }
            }
        }
        let mut surface = Surface {
            places,
            corners,
            normals,
            double_areas,
            neighbours: vec![[NONE; 3]; triangles.len()],
            repeats: vec![NONE; triangles.len()],
        };
        surface.connect();
        surface
    }

    /// Whether a triangle has no area, and so neither a normal nor neighbours.
    pub(super) fn is_degenerate(&self, triangle: usize) -> bool {
        self.double_areas[triangle] == 0.0
    }

    /// Places of a triangle's corners.
    pub(super) fn corner_places(&self, triangle: usize) -> [DVec3; 3] {
        self.corners[triangle].map(|p| self.places[p as usize])
    }

    /// Longest edge of a triangle.
    pub(super) fn longest_edge(&self, triangle: usize) -> f64 {
        let [a, b, c] = self.corner_places(triangle);
        a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a)).sqrt()
    }

    /// Finds `neighbours` and `repeats`: half-edges sorted by their lower place, then grouped by the upper one.
    fn connect(&mut self) {
        let mut first = vec![0u32; self.places.len() + 1];
        let sides = |corners: &[u32; 3], k: usize| (corners[k], corners[(k + 1) % 3]);
        let solid = |s: &Surface, t: usize| !s.is_degenerate(t);
        for (t, corners) in self.corners.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = sides(corners, k);
                first[a.min(b) as usize + 1] += u32::from(solid(self, t));
            }
        }
        for i in 1..first.len() {
            first[i] += first[i - 1];
        }
        // (upper place, half-edge); half-edge 3 t + k runs upwards if its lower place comes first.
        let mut sorted = vec![(0u32, 0u32); first[self.places.len()] as usize];
        let mut next = first.clone();
        for (t, corners) in self.corners.iter().enumerate() {
            for k in 0..3 {
                if solid(self, t) {
                    let (a, b) = sides(corners, k);
                    let slot = &mut next[a.min(b) as usize];
                    sorted[*slot as usize] = (a.max(b), (3 * t + k) as u32);
                    *slot += 1;
                }
            }
        }
        for place in 0..self.places.len() {
            let group = &mut sorted[first[place] as usize..first[place + 1] as usize];
            group.sort_unstable();
            for edge in group.chunk_by(|a, b| a.0 == b.0) {
                self.connect_edge(place as u32, edge);
            }
        }
    }

    /// Pairs the half-edges of one edge that run opposite ways, the flattest continuation first.
    fn connect_edge(&mut self, lower: u32, edge: &[(u32, u32)]) {
        if let &[(_, a), (_, b)] = edge {
            let starts = [a, b].map(|h| self.corners[(h / 3) as usize][(h % 3) as usize]);
            if starts[0] != starts[1] {
                return self.join(a, b);
            }
        }
        let mut ways: [Vec<(u32, u32)>; 2] = [Vec::new(), Vec::new()];
        for &(_, half_edge) in edge {
            let (t, k) = ((half_edge / 3) as usize, (half_edge % 3) as usize);
            let apex = self.corners[t][(k + 2) % 3];
            ways[usize::from(self.corners[t][k] == lower)].push((apex, half_edge));
        }
        for way in &mut ways {
            if way.len() > 1 {
                way.sort_unstable();
                for i in 1..way.len() {
                    if way[i].0 == way[i - 1].0 {
                        // Half-edges ascend, so the first of a run is the first triangle.
                        let original = self.repeats[(way[i - 1].1 / 3) as usize];
                        let original = if original == NONE { way[i - 1].1 / 3 } else { original };
                        self.repeats[(way[i].1 / 3) as usize] = original;
                    }
                }
                way.dedup_by_key(|(apex, _)| *apex);
            }
        }
        let [down, up] = &ways;
        if down.len() == 1 && up.len() == 1 {
            self.join(down[0].1, up[0].1);
        } else if down.len() * up.len() <= MOST_PAIRS {
            let normal = |half_edge: u32| self.normals[(half_edge / 3) as usize];
            let mut pairs: Vec<(f64, u32, u32)> = down
                .iter()
                .flat_map(|&(_, d)| up.iter().map(move |&(_, u)| (d, u)))
                .map(|(d, u)| (-normal(d).dot(normal(u)), d, u))
                .collect();
            pairs.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
            for (_, d, u) in pairs {
                let is_free = |h: u32| self.neighbours[(h / 3) as usize][(h % 3) as usize] == NONE;
                if is_free(d) && is_free(u) {
                    self.join(d, u);
                }
            }
        }
    }

    fn join(&mut self, a: u32, b: u32) {
        self.neighbours[(a / 3) as usize][(a % 3) as usize] = b / 3;
        self.neighbours[(b / 3) as usize][(b % 3) as usize] = a / 3;
    }
}

/// Each place once, ascending by the bits of its coordinates, and the place of each position.
fn weld(positions: &[Vec3]) -> (Vec<DVec3>, Vec<u32>) {
    // Adding zero turns -0 into +0.
    let clean = |x: f32| if x.is_finite() { x + 0.0 } else { 0.0 };
    let bits = |p: Vec3| [clean(p.x).to_bits(), clean(p.y).to_bits(), clean(p.z).to_bits()];
    let mut sorted: Vec<([u32; 3], u32)> =
        positions.iter().enumerate().map(|(i, &p)| (bits(p), i as u32)).collect();
    sorted.sort_unstable();
    let mut places: Vec<DVec3> = Vec::new();
    let mut place_of = vec![0u32; positions.len()];
    let mut last = None;
    for (key, i) in sorted {
        if last != Some(key) {
            last = Some(key);
            let [x, y, z] = key.map(|b| f64::from(f32::from_bits(b)));
            places.push(DVec3::new(x, y, z));
        }
        place_of[i as usize] = places.len() as u32 - 1;
    }
    (places, place_of)
}
