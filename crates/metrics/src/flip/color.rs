//! Colours: from linear light to opponents that are filtered, and from there to distances that people see.
//!
//! Tristimulus values X, Y, Z are always divided by those of white, so white is (1, 1, 1).

/// Chromaticities of the primaries of sRGB (IEC 61966-2-1), and of the white D65 in the CIE's five digits.
const PRIMARIES: [[f64; 2]; 3] = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]];
const WHITE: [f64; 2] = [0.312_71, 0.329_02];

type Matrix = [[f64; 3]; 3];

/// The matrices between linear sRGB and X, Y, Z over white.
#[derive(Debug, Clone, Copy)]
pub(super) struct Space {
    xyz_from_rgb: [[f32; 3]; 3],
    rgb_from_xyz: [[f32; 3]; 3],
}

impl Space {
    /// From the chromaticities: the columns are those of the primaries, scaled so that they add up to white.
    pub(super) fn srgb() -> Space {
        let xyz = |[x, y]: [f64; 2]| [x / y, 1.0, (1.0 - x - y) / y];
        let columns = PRIMARIES.map(xyz);
        let white = xyz(WHITE);
        let over_white: Matrix =
            std::array::from_fn(|row| std::array::from_fn(|c| columns[c][row] / white[row]));
        let amounts = inverse(&over_white).map(|row| row.iter().sum::<f64>());
        let xyz_from_rgb: Matrix = over_white.map(|row| std::array::from_fn(|c| row[c] * amounts[c]));
        let single = |m: Matrix| m.map(|row| row.map(|v| v as f32));
        Space { xyz_from_rgb: single(xyz_from_rgb), rgb_from_xyz: single(inverse(&xyz_from_rgb)) }
    }

    /// Luminance over that of white, and how red and how blue it is: Y, X − Y, Y − Z. These are the coordinates of
    /// YCxCz but for constant factors, of which linear filters know nothing.
    pub(super) fn opponents(&self, rgb: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = times(&self.xyz_from_rgb, rgb);
        [y, x - y, y - z]
    }

    /// L*, and a* and b* as a Hunt effect scales them by it, of what a display can show of a colour.
    pub(super) fn seen(&self, [y, red, blue]: [f32; 3]) -> [f32; 3] {
        let rgb = times(&self.rgb_from_xyz, [y + red, y, y - blue]).map(|v| v.clamp(0.0, 1.0));
        self.seen_rgb(rgb)
    }

    fn seen_rgb(&self, rgb: [f32; 3]) -> [f32; 3] {
        let [x, y, z] = times(&self.xyz_from_rgb, rgb).map(lightness_curve);
        let lightness = 116.0 * y - 16.0;
        let hunt = 0.01 * lightness;
        [lightness, hunt * (500.0 * (x - y)), hunt * (200.0 * (y - z))]
    }

    /// The largest distance of two colours, that of green and blue.
    pub(super) fn largest_distance(&self) -> f32 {
        distance(self.seen_rgb([0.0, 1.0, 0.0]), self.seen_rgb([0.0, 0.0, 1.0]))
    }

    /// Luminance of linear light, over that of white.
    pub(super) fn luminance(&self, rgb: [f32; 3]) -> f32 {
        times(&self.xyz_from_rgb, rgb)[1]
    }
}

/// HyAB: lightness by its difference, chroma by its Euclidean distance.
pub(super) fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    let [l, u, v] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    l.abs() + (u * u + v * v).sqrt()
}

/// Light of an sRGB-encoded byte, 0 … 1.
pub(super) fn linear_from_srgb8() -> [f32; 256] {
    std::array::from_fn(|byte| {
        let encoded = byte as f64 / 255.0;
        let linear =
            if encoded <= 0.04045 { encoded / 12.92 } else { libm::pow((encoded + 0.055) / 1.055, 2.4) };
        linear as f32
    })
}

/// The cube root of CIE L*a*b*, with its straight part near 0.
fn lightness_curve(t: f32) -> f32 {
    const EDGE: f32 = 6.0 / 29.0;
    if t > EDGE * EDGE * EDGE { libm::cbrtf(t) } else { t / (3.0 * EDGE * EDGE) + 4.0 / 29.0 }
}

fn times(m: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// By cofactors.
fn inverse(m: &Matrix) -> Matrix {
    let minor = |r: usize, c: usize| {
        let (r1, r2, c1, c2) = ((r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3);
        m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1]
    };
    let determinant: f64 = (0..3).map(|c| m[0][c] * minor(0, c)).sum();
    std::array::from_fn(|r| std::array::from_fn(|c| minor(c, r) / determinant))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matrices_are_those_of_the_standard() {
        let space = Space::srgb();
        let close = |found: [f32; 3], expected: [f32; 3], tolerance: f32| {
            found.iter().zip(expected).all(|(f, e)| (f - e).abs() < tolerance)
        };
        // IEC 61966-2-1 prints four digits: red is (0.4124, 0.2126, 0.0193), white (0.9505, 1, 1.0890).
        let red = times(&space.xyz_from_rgb, [1.0, 0.0, 0.0]);
        assert!(close(red, [0.4124 / 0.9505, 0.2126, 0.0193 / 1.089], 1e-4), "{red:?}");
        assert!(close(times(&space.xyz_from_rgb, [1.0; 3]), [1.0; 3], 1e-6));
        let there = times(&space.xyz_from_rgb, [0.1, 0.7, 0.4]);
        assert!(close(times(&space.rgb_from_xyz, there), [0.1, 0.7, 0.4], 1e-6));
        assert!((space.luminance([0.0, 1.0, 0.0]) - 0.7152).abs() < 1e-4);
    }

    #[test]
    fn colors_are_seen_as_cie_says() {
        let space = Space::srgb();
        let seen = |rgb| space.seen(space.opponents(rgb));
        let close = |a: [f32; 3], b: [f32; 3]| distance(a, b) < 1e-2;
        assert!(close(seen([1.0; 3]), [100.0, 0.0, 0.0]));
        assert!(close(seen([0.0; 3]), [0.0; 3]));
        // 18 % gray is L* = 49.5. Red is L* = 53.24, a* = 80.1, b* = 67.2, the latter two times 0.5324.
        assert!(close(seen([0.184_186_5; 3]), [50.0, 0.0, 0.0]));
        let red = seen([1.0, 0.0, 0.0]);
        assert!(
            (red[0] - 53.24).abs() < 0.02 && (red[1] - 42.65).abs() < 0.05 && (red[2] - 35.78).abs() < 0.05,
            "{red:?}"
        );
        // Beyond the display's gamut is its rim.
        assert!(close(seen([2.0, -1.0, 0.5]), seen([1.0, 0.0, 0.5])));
    }

    #[test]
    fn bytes_decode_by_the_exact_curve() {
        let table = linear_from_srgb8();
        assert_eq!((table[0], table[255]), (0.0, 1.0));
        assert!((table[10] - 10.0 / 255.0 / 12.92).abs() < 1e-9);
        assert!((table[188] - 0.502_886_5).abs() < 1e-6, "{}", table[188]);
        assert!(table.is_sorted());
    }
}
