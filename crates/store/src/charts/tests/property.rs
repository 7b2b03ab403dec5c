//! The invariants over random meshes and parameters.

use glam::Vec3;
use proptest::prelude::*;

use super::super::*;
use super::invariants::check;
use super::shapes;

fn any_params(scale: f32) -> impl Strategy<Value = ChartParams> {
    let side = prop_oneof![Just(16u16), Just(64), Just(1024), 16u16..2047];
    (0.01f32..2.0, 0.3f32..0.95, side, any::<bool>()).prop_map(
        move |(texel, least_cosine, max_side, mirrored)| ChartParams {
            texel_m: texel * scale,
            least_cosine,
            max_side,
            mirrored,
        },
    )
}

/// Random triangles over few positions; snapped to a coarse grid so that many touch, repeat or have no area.
fn any_soup() -> impl Strategy<Value = (Vec<Vec3>, Vec<[u32; 3]>, ChartParams)> {
    let scale = prop_oneof![Just(1.0f32), Just(1e-6), Just(1e6), Just(1e-3)];
    (scale, 3usize..40, any::<bool>()).prop_flat_map(|(scale, count, snap)| {
        let position = prop::array::uniform3(-1.0f32..1.0).prop_map(move |p| {
            let p = Vec3::from_array(p);
            (if snap { (p * 2.0).round() * 0.5 } else { p }) * scale
        });
        let triangle = prop::array::uniform3(0..count as u32);
        let triangles = prop::collection::vec(triangle, 0..60);
        (prop::collection::vec(position, count), triangles, any_params(scale))
    })
}

/// Rough ground: a sheet with random heights, sometimes torn.
fn any_ground() -> impl Strategy<Value = (Vec<Vec3>, Vec<[u32; 3]>, ChartParams)> {
    (1u32..24, 0.0f32..1.5, any::<u64>(), any_params(1.0), any::<bool>()).prop_map(
        |(quads, rough, seed, params, tear)| {
            let (mut positions, mut triangles) = shapes::floor(4.0, quads);
            for (i, p) in positions.iter_mut().enumerate() {
                p.y = rough * shapes::random(seed, i as u64);
            }
            if tear {
                triangles = triangles
                    .into_iter()
                    .enumerate()
                    .filter(|&(i, _)| shapes::random(seed, i as u64 + 9999) < 0.7)
                    .map(|(_, t)| t)
                    .collect();
            }
            (positions, triangles, params)
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 192, ..ProptestConfig::default() })]

    #[test]
    fn soups_keep_the_promises((positions, triangles, params) in any_soup()) {
        let set = ChartSet::new(&positions, &triangles, &params).unwrap();
        check(&positions, &triangles, &params, &set);
    }

    #[test]
    fn grounds_keep_the_promises((positions, triangles, params) in any_ground()) {
        let set = ChartSet::new(&positions, &triangles, &params).unwrap();
        check(&positions, &triangles, &params, &set);
    }

    /// Bits of floats at random: infinities, NaN, subnormal numbers.
    #[test]
    fn no_input_panics(
        bits in prop::collection::vec(prop::array::uniform3(any::<u32>()), 1..30),
        triangles in prop::collection::vec(prop::array::uniform3(0u32..32), 0..40),
        texel in any::<f32>(),
    ) {
        let positions: Vec<Vec3> = bits.iter().map(|b| Vec3::from_array(b.map(f32::from_bits))).collect();
        for texel_m in [texel, 0.1] {
            let params = ChartParams { texel_m, max_side: 256, ..ChartParams::for_spacing(1.0, true) };
            if let Ok(set) = ChartSet::new(&positions, &triangles, &params) {
                let sites = set.sites(&positions, &triangles);
                prop_assert!(sites.iter().all(|s| s.position_rest.is_finite() && s.normal_rest.is_finite()));
                prop_assert!(set.texel_count() <= MOST_TEXELS);
            }
        }
    }
}
