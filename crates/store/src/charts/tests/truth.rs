//! Charts whose outcome is known.

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
        assert!(site.normal_rest.distance(glam::Vec3::Y) < 1e-6);
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
