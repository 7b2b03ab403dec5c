//! Any bytes as an environment, and directions chosen from what is taken.

use dapple_scene::area_lights::{Environment, MAX_SIDE};

/// Reads `data` as a Radiance picture. Nothing may panic; what is taken has sides within the limit and finite light, and directions chosen from it are unit
/// vectors of the density that it says they have.
pub fn read_environment(data: &[u8]) {
    let Ok(environment) = Environment::from_hdr(data) else { return };
    let [width, height] = environment.size();
    assert!((1..=MAX_SIDE).contains(&width) && (1..=MAX_SIDE).contains(&height));
    for i in 0..16u32 {
        let u = [0.618_034, 0.754_878].map(|step: f32| (step * i as f32).fract());
        let (direction, radiance, density) = environment.sample(u);
        assert!((direction.length() - 1.0).abs() < 1e-3, "{direction}");
        assert!(radiance.min_element() >= 0.0 && density >= 0.0, "{radiance} {density}");
    }
}

/// A sky of 8 × 4 texels without run lengths, with a sun.
pub(crate) fn sky() -> Vec<u8> {
    let mut file = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n".to_vec();
    for i in 0..32u8 {
        file.extend(if i == 11 { [250, 240, 200, 136] } else { [60 + i, 90, 120, 127] });
    }
    file
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Or the search would hardly get anywhere.
    #[test]
    fn the_sky_is_taken() {
        let sky = Environment::from_hdr(&sky()).unwrap();
        assert!(sky.size() == [8, 4] && sky.mean_radiance().y > 0.2, "{:?}", sky.mean_radiance());
    }
}
