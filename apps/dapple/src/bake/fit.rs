//! Fits values at vertices to values measured all over the triangles between them.
//!
//! Source: L. Kavan, A. Bargteil, P.-P. Sloan, "Least Squares Vertex Baking", EGSR 2011: the piecewise linear function that
//! is nearest to what was measured, in the mean over the surface, instead of what is seen from the vertices themselves, most of
//! which lie in corners. Here with a first-order regularisation, which also fills vertices about which nothing is known.

/// Weight of a jump between neighbours against an error of the same size.
const SMOOTHNESS: f64 = 0.01;

/// Weight of what is measured where nobody sees it: decides only where there is nothing else.
pub(crate) const HIDDEN_WEIGHT: f64 = 1e-4;

/// Least decrease of the residual that ends the solution, and most steps towards it.
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
    /// Upper half of the matrix: 00, 01, 02, 11, 12, 22.
    matrix: [f64; 6],
    right: [[f64; N]; 3],
}

impl<const N: usize> Fit<N> {
    pub(crate) fn new(unknowns: usize) -> Fit<N> {
        Fit { unknowns, triangles: Vec::new() }
    }

    /// Adds a triangle of that area; samples are added to the last one.
    pub(crate) fn triangle(&mut self, corners: [u32; 3], area: f64) {
        // Squared differences along the three edges, on the scale of the mass matrix.
        let edge = SMOOTHNESS * area / 3.0;
        let matrix = [2.0 * edge, -edge, -edge, 2.0 * edge, -edge, 2.0 * edge];
        self.triangles.push(Block { corners, matrix, right: [[0.0; N]; 3] });
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

    /// The values at the unknowns, by conjugate gradients. An unknown without a triangle gets `default`.
    pub(crate) fn solve(&self, default: [f32; N]) -> Vec<[f32; N]> {
        let n = self.unknowns;
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
        let mut values = vec![default; n];
        for channel in 0..N {
            let right: Vec<f64> = right.iter().map(|r| r[channel]).collect();
            // The mean of what was measured about each vertex is near already.
            let start = (0..n)
                .map(|i| if weight[i] > 0.0 { right[i] / weight[i] } else { f64::from(default[channel]) });
            let mut x: Vec<f64> = start.collect();
            self.descend(&diagonal, &right, &mut x);
            for (value, x) in values.iter_mut().zip(x) {
                value[channel] = x as f32;
            }
        }
        values
    }

    /// Conjugate gradients, scaled by the diagonal. Serial: sums are always in the same order.
    fn descend(&self, diagonal: &[f64], right: &[f64], x: &mut [f64]) {
        let n = x.len();
        let mut product = vec![0.0; n];
        self.multiply(x, &mut product);
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
            self.multiply(&step, &mut product);
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

    fn multiply(&self, x: &[f64], product: &mut [f64]) {
        product.fill(0.0);
        for block in &self.triangles {
            let [a, b, c] = block.corners.map(|i| i as usize);
            let m = &block.matrix;
            let (xa, xb, xc) = (x[a], x[b], x[c]);
            product[a] += m[0] * xa + m[1] * xb + m[2] * xc;
            product[b] += m[1] * xa + m[3] * xb + m[4] * xc;
            product[c] += m[2] * xa + m[4] * xb + m[5] * xc;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip of squares along x, each of two triangles, four samples a triangle of a function of x.
    fn strip(squares: u32, f: impl Fn(f32) -> f32, hidden: impl Fn(f32) -> bool) -> Vec<f32> {
        let mut fit = Fit::<1>::new(2 * squares as usize + 2);
        for square in 0..squares {
            let [a, b, c, d] = [2 * square, 2 * square + 1, 2 * square + 2, 2 * square + 3];
            for (corners, xs) in [([a, c, b], [0.0, 1.0, 0.0]), ([b, c, d], [0.0, 1.0, 1.0])] {
                let triangle = fit.triangles.len();
                fit.triangle(corners, 0.5);
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
        let values = strip(20, |x| 0.2 + 0.03 * x, |_| false);
        for (i, value) in values.iter().enumerate() {
            let expected = 0.2 + 0.03 * (i / 2) as f32;
            assert!((value - expected).abs() < 1.5e-3, "vertex {i}: {value}, not {expected}");
        }
        assert!(strip(20, |_| 0.25, |_| false).iter().all(|v| (v - 0.25).abs() < 1e-5));
    }

    #[test]
    fn a_step_is_met_in_the_mean() {
        let values = strip(20, |x| if x < 10.0 { 0.0 } else { 1.0 }, |_| false);
        assert!(values[..18].iter().all(|v| v.abs() < 0.02), "{values:?}");
        assert!(values[24..].iter().all(|v| (v - 1.0).abs() < 0.02), "{values:?}");
        assert!((values[20] - 0.5).abs() < 0.1 && (values[21] - 0.5).abs() < 0.1, "{values:?}");
    }

    #[test]
    fn what_is_hidden_takes_after_its_neighbours() {
        let values = strip(20, |x| if x > 17.0 { 0.0 } else { 0.8 }, |x| x > 17.0);
        for value in &values[..] {
            assert!((value - 0.8).abs() < 0.06, "{values:?}");
        }
        // With nothing to take after, what was measured counts.
        assert!(strip(5, |_| 0.3, |_| true).iter().all(|v| (v - 0.3).abs() < 1e-3));
        assert_eq!(Fit::<1>::new(2).solve([1.0]), [[1.0], [1.0]]);
    }
}
