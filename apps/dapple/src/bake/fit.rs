//! Fits values at vertices to values measured all over the triangles between them.
//!
//! Source: L. Kavan, A. Bargteil, P.-P. Sloan, "Least Squares Vertex Baking", EGSR 2011: the piecewise linear function that
//! is nearest to what was measured, in the mean over the surface, instead of what is seen from the vertices themselves, most of
//! which lie in corners. As there, jumps of the gradient across edges cost something, or the function would ring beside
//! steps. The weights are our own, and so is a small cost of differences, which fills vertices about which nothing is known.

use dapple_scene::glam::DVec3;

/// Weight of a gradient that jumps, against an error as large as the jump makes at the opposite corners.
const BENDING: f64 = 1.0;

/// Weight of a difference between neighbours, against an error of the same size.
const DIFFERENCE: f64 = 1e-3;

/// Weight of what is measured where nobody sees it: decides only where there is nothing else.
pub(crate) const HIDDEN_WEIGHT: f64 = 1e-6;

/// Decrease of the residual that ends the solution, and most steps towards it.
const TOLERANCE: f64 = 1e-5;
const MOST_STEPS: usize = 300;

/// Normal equations of a fit, triangle by triangle, of `N` values a vertex.
pub(crate) struct Fit<const N: usize> {
    unknowns: usize,
    triangles: Vec<Block<N>>,
}

/// One triangle's part.
struct Block<const N: usize> {
    /// Unknowns at the corners.
    corners: [u32; 3],
    points: [DVec3; 3],
    /// Upper half of the matrix: 00, 01, 02, 11, 12, 22.
    matrix: [f64; 6],
    right: [[f64; N]; 3],
}

/// A cost of two triangles that share an edge: (Σ factor · x)².
struct Hinge {
    unknowns: [u32; 4],
    factors: [f64; 4],
}

impl<const N: usize> Fit<N> {
    pub(crate) fn new(unknowns: usize) -> Fit<N> {
        Fit { unknowns, triangles: Vec::new() }
    }

    /// Adds a triangle with these unknowns at these places; samples are added to the last one.
    pub(crate) fn triangle(&mut self, corners: [u32; 3], points: [DVec3; 3]) {
        // Squared differences along the three edges, on the scale of the mass matrix.
        let edge = DIFFERENCE * area(points) / 3.0;
        let matrix = [2.0 * edge, -edge, -edge, 2.0 * edge, -edge, 2.0 * edge];
        self.triangles.push(Block { corners, points, matrix, right: [[0.0; N]; 3] });
    }

    /// Adds what was measured at a place of a triangle; `weights` are those of its second and third corner, `area` is the
    /// part of the surface that it stands for.
    pub(crate) fn sample(&mut self, triangle: usize, weights: [f32; 2], values: [f32; N], area: f64) {
        let [v, w] = weights.map(f64::from);
        let b = [1.0 - v - w, v, w];
        let block = &mut self.triangles[triangle];
        let products = [b[0] * b[0], b[0] * b[1], b[0] * b[2], b[1] * b[1], b[1] * b[2], b[2] * b[2]];
        for (entry, product) in block.matrix.iter_mut().zip(products) {
            *entry += area * product;
        }
        for (right, b) in block.right.iter_mut().zip(b) {
            for (right, value) in right.iter_mut().zip(values) {
                *right += area * b * f64::from(value);
            }
        }
    }

    /// The values at the unknowns. An unknown without a triangle gets `default`.
    pub(crate) fn solve(&self, default: [f32; N]) -> Vec<[f32; N]> {
        let n = self.unknowns;
        let hinges = self.hinges();
        let mut diagonal = vec![0.0; n];
        let mut weight = vec![0.0; n];
        let mut right = vec![[0.0; N]; n];
        for block in &self.triangles {
            let m = &block.matrix;
            let rows = [m[0] + m[1] + m[2], m[1] + m[3] + m[4], m[2] + m[4] + m[5]];
            for (k, (corner, own)) in block.corners.iter().zip([m[0], m[3], m[5]]).enumerate() {
                let corner = *corner as usize;
                diagonal[corner] += own;
                weight[corner] += rows[k];
                for (to, from) in right[corner].iter_mut().zip(block.right[k]) {
                    *to += from;
                }
            }
        }
        for hinge in &hinges {
            for (unknown, factor) in hinge.unknowns.iter().zip(hinge.factors) {
                diagonal[*unknown as usize] += factor * factor;
            }
        }
        let mut values = vec![default; n];
        for channel in 0..N {
            let right: Vec<f64> = right.iter().map(|r| r[channel]).collect();
            // The mean of what was measured about each vertex is near already.
            let default = f64::from(default[channel]);
            let start = (0..n).map(|i| if weight[i] > 0.0 { right[i] / weight[i] } else { default });
            let mut x: Vec<f64> = start.collect();
            self.descend(&hinges, &diagonal, &right, &mut x);
            for (value, x) in values.iter_mut().zip(x) {
                value[channel] = x as f32;
            }
        }
        values
    }

    /// Costs of all pairs of triangles that continue each other.
    fn hinges(&self) -> Vec<Hinge> {
        // Ends in order, whether the triangle runs from the higher to the lower, triangle, corner where it starts.
        let mut edges: Vec<(u32, u32, bool, u32, u8)> = Vec::with_capacity(3 * self.triangles.len());
        for (number, block) in (0u32..).zip(&self.triangles) {
            for k in 0..3u8 {
                let (from, to) = (block.corners[usize::from(k)], block.corners[usize::from(k + 1) % 3]);
                edges.push((from.min(to), from.max(to), from > to, number, k));
            }
        }
        edges.sort_unstable();
        let pairs = edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).filter_map(|around| match around {
            &[(a, b, false, one, k), (_, _, true, two, l)] if a != b => {
                let (one, two) = (&self.triangles[one as usize], &self.triangles[two as usize]);
                let (opposite, other) = (usize::from(k + 2) % 3, usize::from(l + 2) % 3);
                let edge = [one.points[usize::from(k)], one.points[usize::from(k + 1) % 3]];
                let factors = hinge(edge, one.points[opposite], two.points[other])?;
                Some(Hinge { unknowns: [a, b, one.corners[opposite], two.corners[other]], factors })
            }
            _ => None,
        });
        pairs.collect()
    }

    /// Conjugate gradients, scaled by the diagonal. Serial: sums are always in the same order.
    fn descend(&self, hinges: &[Hinge], diagonal: &[f64], right: &[f64], x: &mut [f64]) {
        let n = x.len();
        let mut product = vec![0.0; n];
        self.multiply(hinges, x, &mut product);
        let mut residual: Vec<f64> = right.iter().zip(&product).map(|(r, p)| r - p).collect();
        let scaled = |residual: &[f64]| -> Vec<f64> {
            residual.iter().zip(diagonal).map(|(r, d)| if *d > 0.0 { r / d } else { 0.0 }).collect()
        };
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut step = scaled(&residual);
        let mut size = dot(&residual, &step);
        let scale = dot(right, &scaled(right)).max(f64::MIN_POSITIVE);
        for _ in 0..MOST_STEPS {
            if size.is_nan() || size <= TOLERANCE * TOLERANCE * scale {
                break;
            }
            self.multiply(hinges, &step, &mut product);
            let curvature = dot(&step, &product);
            if curvature.is_nan() || curvature <= 0.0 {
                break;
            }
            let length = size / curvature;
            for i in 0..n {
                x[i] += length * step[i];
                residual[i] -= length * product[i];
            }
            let towards = scaled(&residual);
            let new_size = dot(&residual, &towards);
            let turn = new_size / size;
            size = new_size;
            for i in 0..n {
                step[i] = towards[i] + turn * step[i];
            }
        }
    }

    fn multiply(&self, hinges: &[Hinge], x: &[f64], product: &mut [f64]) {
        product.fill(0.0);
        for block in &self.triangles {
            let [a, b, c] = block.corners.map(|i| i as usize);
            let m = &block.matrix;
            let (xa, xb, xc) = (x[a], x[b], x[c]);
            product[a] += m[0] * xa + m[1] * xb + m[2] * xc;
            product[b] += m[1] * xa + m[3] * xb + m[4] * xc;
            product[c] += m[2] * xa + m[4] * xb + m[5] * xc;
        }
        for hinge in hinges {
            let terms = hinge.unknowns.iter().zip(hinge.factors);
            let sum: f64 = terms.clone().map(|(unknown, factor)| factor * x[*unknown as usize]).sum();
            for (unknown, factor) in terms {
                product[*unknown as usize] += factor * sum;
            }
        }
    }
}

fn area([a, b, c]: [DVec3; 3]) -> f64 {
    let area = 0.5 * (b - a).cross(c - a).length();
    if area.is_finite() { area } else { 0.0 }
}

/// How values at the ends of an edge and at the opposite corners of its two triangles make the gradient jump across it, for
/// triangles turned into one plane: nothing for a linear function.
fn hinge([a, b]: [DVec3; 2], opposite: DVec3, other: DVec3) -> Option<[f64; 4]> {
    let length = (b - a).length();
    let axis = (b - a) / length;
    // Height over the edge, and where its foot divides the edge; far outside the numbers of slivers mean nothing.
    let foot = |corner: DVec3| {
        let along = (corner - a).dot(axis);
        ((corner - a - axis * along).length(), (along / length).clamp(-1.0, 2.0))
    };
    let ((height, t), (other_height, other_t)) = (foot(opposite), foot(other));
    // In units of the harmonic mean of the heights, so that no factor is large.
    let unit = 2.0 * height * other_height / (height + other_height);
    let (slope, other_slope) = (unit / height, unit / other_height);
    let scale = (BENDING * (area([a, b, opposite]) + area([b, a, other])) / 12.0).sqrt();
    let factors = [
        -(1.0 - t) * slope - (1.0 - other_t) * other_slope,
        -t * slope - other_t * other_slope,
        slope,
        other_slope,
    ];
    factors.iter().all(|factor| factor.is_finite()).then(|| factors.map(|factor| factor * scale))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip of squares along x, each of two triangles, four samples a triangle of a function of x.
    fn strip(squares: u32, f: impl Fn(f32) -> f32, hidden: impl Fn(f32) -> bool) -> Vec<f32> {
        let mut fit = Fit::<1>::new(2 * squares as usize + 2);
        let place = |i: u32| DVec3::new(f64::from(i / 2), f64::from(i % 2), 0.0);
        for square in 0..squares {
            let [a, b, c, d] = [2 * square, 2 * square + 1, 2 * square + 2, 2 * square + 3];
            for (corners, xs) in [([a, c, b], [0.0, 1.0, 0.0]), ([b, c, d], [0.0, 1.0, 1.0])] {
                let triangle = fit.triangles.len();
                fit.triangle(corners, corners.map(place));
                for weights in [[0.2, 0.2], [0.6, 0.2], [0.2, 0.6], [0.33, 0.33]] {
                    let [v, w] = weights;
                    let x = square as f32 + xs[0] * (1.0 - v - w) + xs[1] * v + xs[2] * w;
                    let weight = if hidden(x) { HIDDEN_WEIGHT } else { 1.0 };
                    fit.sample(triangle, weights, [f(x)], weight * 0.125);
                }
            }
        }
        fit.solve([1.0]).into_iter().map(|[x]| x).collect()
    }

    #[test]
    fn what_is_linear_is_met() {
        for squares in [1, 20] {
            let values = strip(squares, |x| 0.2 + 0.03 * x, |_| false);
            for (i, value) in values.iter().enumerate() {
                let expected = 0.2 + 0.03 * (i / 2) as f32;
                assert!((value - expected).abs() < 1e-3, "vertex {i} of {squares}: {value}, not {expected}");
            }
        }
        assert!(strip(20, |_| 0.25, |_| false).iter().all(|v| (v - 0.25).abs() < 1e-5));
    }

    #[test]
    fn a_step_is_met_without_much_ringing() {
        let values = strip(20, |x| if x < 10.0 { 0.0 } else { 1.0 }, |_| false);
        assert!(values.iter().all(|v| (-0.15..1.15).contains(v)), "{values:?}");
        assert!(values[..14].iter().all(|v| v.abs() < 0.03), "{values:?}");
        assert!(values[28..].iter().all(|v| (v - 1.0).abs() < 0.03), "{values:?}");
        assert!((values[20] + values[21] - 1.0).abs() < 0.05, "{values:?}");
    }

    #[test]
    fn what_is_hidden_takes_after_its_neighbours() {
        let values = strip(20, |x| if x > 17.0 { 0.0 } else { 0.8 }, |x| x > 17.0);
        for value in &values[..] {
            assert!((value - 0.8).abs() < 0.02, "{values:?}");
        }
        // With nothing to take after, what was measured counts.
        assert!(strip(5, |_| 0.3, |_| true).iter().all(|v| (v - 0.3).abs() < 1e-3));
        assert_eq!(Fit::<1>::new(2).solve([1.0]), [[1.0], [1.0]]);
    }

    #[test]
    fn slivers_do_no_harm() {
        let mut fit = Fit::<1>::new(5);
        let p = |x: f64, y: f64| DVec3::new(x, y, 0.0);
        let places = [p(0.0, 0.0), p(1.0, 0.0), p(0.5, 1e-9), p(1e4, -1e-3), p(0.5, 0.5)];
        for (t, corners) in [[0u32, 1, 2], [1, 0, 3], [2, 1, 4], [0, 2, 4], [4, 4, 4]].into_iter().enumerate()
        {
            fit.triangle(corners, corners.map(|i| places[i as usize]));
            for weights in [[0.2, 0.2], [0.6, 0.2], [0.2, 0.6]] {
                fit.sample(t, weights, [0.5], area(fit.triangles[t].points) / 3.0);
            }
        }
        for [value] in fit.solve([1.0]) {
            assert!((value - 0.5).abs() < 1e-3, "{value}");
        }
    }
}
