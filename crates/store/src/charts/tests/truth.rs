//! Charts whose outcome is known.

use glam::Vec3;

use super::super::*;
use super::invariants::{Figures, check};
use super::shapes;

fn params(texel_m: f32) -> ChartParams {
    ChartParams { texel_m, least_cosine: 0.7, max_side: 1024, mirrored: false }
}

#[test]
fn a_floor_is_one_chart_with_texels_on_its_corners() {
    let (positions, triangles) = shapes::floor(1.0, 4);
    let set = ChartSet::new(&positions, &triangles, &params(0.1)).unwrap();
    assert_eq!(set.chart_count(), 1);
    assert_eq!(set.pages(), [PageSize { width: 11, height: 11 }]);
    let sites = set.sites(&positions, &triangles);
    assert_eq!(sites.len(), 121);
    for site in &sites {
        let p = site.position_rest;
        assert!(
            p.y.abs() < 1e-6 && (-1e-6..=1.000001).contains(&p.x) && (-1.000001..=1e-6).contains(&p.z),
            "{p}"
        );
        assert!(site.normal_rest.distance(Vec3::Y) < 1e-6);
    }
}

#[test]
fn a_cube_is_six_charts() {
    let (positions, triangles) = shapes::cube(1.0);
    let set = ChartSet::new(&positions, &triangles, &params(0.1)).unwrap();
    assert_eq!(set.chart_count(), 6);
    assert_eq!(set.texel_count(), 6 * 121);
    let vertices = set.vertices(&triangles);
    assert_eq!(vertices.source.len(), 24);
}

#[test]
fn no_triangles_no_pages() {
    let set = ChartSet::new(&[], &[], &params(0.1)).unwrap();
    assert_eq!((set.pages().len(), set.texel_count(), set.sites(&[], &[]).len()), (0, 0, 0));
}

/// Makes the charts and checks every promise.
fn checked(shape: &shapes::Shape, params: &ChartParams) -> (ChartSet, Figures) {
    let set = ChartSet::new(&shape.0, &shape.1, params).unwrap();
    let figures = check(&shape.0, &shape.1, params, &set);
    eprintln!("{} charts, {} texels, {figures:?}", set.chart_count(), set.texel_count());
    (set, figures)
}

#[test]
fn closed_shapes_keep_the_promises() {
    for texel in [0.3, 0.1, 0.03] {
        checked(&shapes::cube(1.0), &params(texel));
        checked(&shapes::ball(0.5, 24), &params(texel));
        checked(&shapes::torus(1.0, 0.3, 24), &params(texel));
        checked(&shapes::moebius(0.5, 64), &params(texel));
    }
}

#[test]
fn the_turns_of_a_helix_do_not_share_texels() {
    for pitch in [0.05, 0.2, 1.0] {
        let (set, figures) = checked(&shapes::helix(4.0, pitch, 0.4, 256), &params(0.05));
        assert!(set.chart_count() >= 4, "{}", set.chart_count());
        assert!(figures.deepest < 0.5, "{figures:?}");
    }
}

#[test]
fn round_shapes_have_few_charts_that_fill_their_pages() {
    let (set, figures) = checked(&shapes::torus(1.0, 0.3, 24), &params(0.02));
    assert!(set.chart_count() < 40, "{}", set.chart_count());
    assert!(figures.in_charts * 10 >= u64::from(set.texel_count()) * 9);
    let (set, figures) = checked(&(shapes::ball(1.0, 32)), &params(0.02));
    assert!(figures.in_charts * 10 >= u64::from(set.texel_count()) * 8);
}

#[test]
fn thin_surfaces_with_two_sides_do_not_break_up() {
    let (positions, mut triangles) = shapes::floor(1.0, 8);
    let back: Vec<[u32; 3]> = triangles.iter().map(|&[a, b, c]| [c, b, a]).collect();
    triangles.extend(back);
    let (set, _) = checked(&(positions, triangles), &params(0.1));
    assert_eq!(set.chart_count(), 2);
}

#[test]
fn repeated_triangles_share_their_texels() {
    let (positions, mut triangles) = shapes::floor(1.0, 3);
    let again: Vec<[u32; 3]> = triangles.iter().map(|&[a, b, c]| [b, c, a]).collect();
    triangles.extend(again);
    let (set, _) = checked(&(positions, triangles), &params(0.1));
    assert_eq!((set.chart_count(), set.texel_count()), (1, 121));
}

#[test]
fn vertices_at_equal_places_are_one() {
    // Every triangle with vertices of its own, as in files without an index.
    let (positions, triangles) = shapes::floor(1.0, 4);
    let loose: Vec<Vec3> = triangles.iter().flatten().map(|&v| positions[v as usize]).collect();
    let count = loose.len() as u32 / 3;
    let (set, _) =
        checked(&(loose, (0..count).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect()), &params(0.1));
    assert_eq!(set.chart_count(), 1);
}

#[test]
fn charts_end_at_the_longest_side() {
    let params = ChartParams { max_side: 32, ..params(0.1) };
    let (set, _) = checked(&shapes::floor(10.0, 20), &params);
    assert!(set.chart_count() >= 10 && set.pages().len() >= 10, "{} charts", set.chart_count());
    assert_eq!(set.texel_m(), 0.1);
}

#[test]
fn a_triangle_larger_than_a_page_gets_coarser_texels_alone() {
    let (mut positions, mut triangles) = shapes::floor(1.0, 2);
    let first = positions.len() as u32;
    positions.extend([Vec3::new(5.0, 0.0, 0.0), Vec3::new(105.0, 0.0, 0.0), Vec3::new(5.0, 0.0, -100.0)]);
    triangles.push([first, first + 1, first + 2]);
    let params = ChartParams { max_side: 64, ..params(0.1) };
    let (set, _) = checked(&(positions, triangles.clone()), &params);
    let step_of = |t: usize| set.chart_step_m(set.chart_of_triangle(t))[0];
    assert!(step_of(0) <= 0.1 && step_of(triangles.len() - 1) > 1.0);
}

#[test]
fn a_mesh_with_too_many_texels_gets_coarser_ones() {
    let (set, _) = checked(&shapes::floor(1000.0, 64), &params(0.01));
    assert!(set.texel_m() > 0.1 && set.texel_count() > MOST_TEXELS / 2);
}

#[test]
fn triangles_without_area_read_a_neighbour_or_a_texel_of_their_own() {
    let (mut positions, mut triangles) = shapes::floor(1.0, 2);
    triangles.push([0, 1, 1]);
    triangles.push([0, 1, 2]);
    let first = positions.len() as u32;
    positions.extend([Vec3::new(9.0, 1.0, 0.0), Vec3::new(9.0, 2.0, 0.0), Vec3::NAN]);
    triangles.extend([[first, first + 1, first], [first, first + 1, first + 2]]);
    let set = ChartSet::new(&positions, &triangles, &params(0.1)).unwrap();
    assert_eq!((set.chart_count(), set.chart_of_triangle(8), set.chart_of_triangle(9)), (2, 0, 0));
    let [a, b, c] = set.corner_uv_of(8);
    assert!(a == b && b == c && a == set.corner_uv_of(0)[0]);
    let sites = set.sites(&positions, &triangles);
    let own = sites.iter().find(|s| s.position_rest == Vec3::new(9.0, 1.0, 0.0)).unwrap();
    assert_eq!(own.normal_rest, Vec3::Y);
    assert_eq!(sites.len(), 122);
    // And nothing else.
    let only = ChartSet::new(&[Vec3::ONE; 3], &[[0, 1, 2]], &params(0.1)).unwrap();
    assert_eq!((only.texel_count(), only.sites(&[Vec3::ONE; 3], &[[0, 1, 2]]).len()), (1, 1));
}

#[test]
fn loose_leaves_smaller_than_a_texel_are_kept_per_vertex() {
    let mut leaves = (Vec::new(), Vec::new());
    for i in 0..500u64 {
        let at = |k: u64| Vec3::from_array([0, 1, 2].map(|axis| shapes::random(7, 9 * i + 3 * k + axis)));
        let centre = at(0) * 2.0;
        let first = leaves.0.len() as u32;
        leaves.0.extend([0, 1, 2, 3].map(|k| centre + (at(k) - 0.5) * 0.05));
        // Three faces about one vertex.
        leaves.1.extend([[0, 1, 2], [0, 2, 3], [0, 3, 1]].map(|t| t.map(|v: u32| first + v)));
    }
    // Seen from both sides: two texels a vertex.
    let back: Vec<[u32; 3]> = leaves.1.iter().map(|&[a, b, c]| [a, c, b]).collect();
    leaves.1.extend(back);
    let (both, _) = checked(&leaves, &params(0.1));
    assert!(both.is_per_vertex() && both.texel_count() > 2 * leaves.0.len() as u32 - 64);
    // One wide plate among them, whose light lies between its vertices.
    let mut plate = leaves.clone();
    let first = plate.0.len() as u32;
    plate.0.extend([Vec3::ZERO, Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 0.0, 1.0)]);
    plate.1.push([0, 2, 1].map(|v| first + v));
    assert!(!checked(&plate, &params(0.1)).0.is_per_vertex());
    // Larger than a texel.
    assert!(!ChartSet::new(&leaves.0, &leaves.1, &params(0.004)).unwrap().is_per_vertex());
    // A fine mesh in one piece needs fewer texels than it has vertices.
    let (ball, _) = checked(&shapes::ball(0.2, 40), &params(0.1));
    assert!(!ball.is_per_vertex());
}

#[test]
fn a_mirror_turns_normals_only() {
    let (positions, triangles) = shapes::floor(1.0, 2);
    let plain = ChartSet::new(&positions, &triangles, &params(0.1)).unwrap();
    let mirrored =
        ChartSet::new(&positions, &triangles, &ChartParams { mirrored: true, ..params(0.1) }).unwrap();
    assert_eq!(plain.corners(), mirrored.corners());
    for (a, b) in plain.sites(&positions, &triangles).iter().zip(mirrored.sites(&positions, &triangles)) {
        assert_eq!((a.texel, a.position_rest, a.normal_rest), (b.texel, b.position_rest, -b.normal_rest));
    }
}

#[test]
fn wrong_input_is_named() {
    let (positions, mut triangles) = shapes::floor(1.0, 1);
    for (texel_m, least_cosine, max_side) in [
        (0.0, 0.7, 64),
        (-1.0, 0.7, 64),
        (f32::NAN, 0.7, 64),
        (0.1, 0.0, 64),
        (0.1, 1.1, 64),
        (0.1, 0.7, 15),
        (0.1, 0.7, 2048),
    ] {
        let params = ChartParams { texel_m, least_cosine, max_side, mirrored: false };
        let error = ChartSet::new(&positions, &triangles, &params).unwrap_err();
        assert!(matches!(error, ChartError::BadParameter { .. }), "{error}");
    }
    triangles.push([0, 1, 4]);
    let error = ChartSet::new(&positions, &triangles, &params(0.1)).unwrap_err();
    assert_eq!(error, ChartError::BadVertex { triangle: 2, vertex: 4, count: 4 });
}

/// The same numbers on every processor: an error here means that two ends would disagree.
#[test]
fn charts_are_the_same_everywhere() {
    let mut hash = 0xcbf2_9ce4_8422_2325u64;
    let mut add = |x: u32| hash = (hash ^ u64::from(x)).wrapping_mul(0x0100_0000_01b3);
    // Heights from integers alone: no function of the platform takes part.
    let (mut positions, triangles) = shapes::floor(4.0, 24);
    for (i, p) in positions.iter_mut().enumerate() {
        p.y = 0.4 * shapes::random(3, i as u64);
    }
    let set = ChartSet::new(&positions, &triangles, &params(0.07)).unwrap();
    assert_eq!(set, ChartSet::new(&positions, &triangles, &params(0.07)).unwrap());
    for uv in set.corners().iter().flatten() {
        add(u32::from(uv.page));
        add(u32::from(uv.x) << 16 | u32::from(uv.y));
    }
    for site in set.sites(&positions, &triangles) {
        add(site.texel);
        site.position_rest
            .to_array()
            .into_iter()
            .chain(site.normal_rest.to_array())
            .for_each(|x| add(x.to_bits()));
    }
    assert_eq!(hash, 18_429_774_430_093_416_897);
}

#[test]
fn instances_share_what_is_equal_to_the_bit() {
    let key = |mesh, scale: f32, texel_m| {
        Some(InstanceKey { mesh, rest_from_mesh: glam::Mat3::from_diagonal(Vec3::splat(scale)), texel_m })
    };
    let instances =
        [key(0, 1.0, 0.1), key(1, 1.0, 0.1), None, key(0, 1.0, 0.1), key(0, 1.0, 0.05), key(0, -1.0, 0.1)];
    let plan = SceneCharts::plan(instances);
    let sets: Vec<Option<u32>> = (0..7).map(|i| plan.set_index_of_instance(i)).collect();
    assert_eq!(sets, [Some(0), Some(1), None, Some(0), Some(2), Some(3), None]);
    assert_eq!(plan.sets().len(), 4);
    let defaults = ChartParams::for_spacing(0.2, true);
    assert!(plan.sets()[3].params(&defaults).mirrored && !plan.sets()[0].params(&defaults).mirrored);
    assert_eq!(plan.largest_first(|set| u64::from(set.mesh)), [1, 0, 2, 3]);
    assert_eq!(ChartParams::for_spacing(0.2, false).texel_m, 0.15);
}
