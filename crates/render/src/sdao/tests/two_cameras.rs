//! The second camera covers the first one's view, and finds what the first one looks along; bent normals lean to where it is open.

use dapple_scene::{PosedCamera, Projection};
use glam::{Affine3A, Vec3};

use super::*;
use crate::gbuffer::GBuffer;
use crate::shade::{Ambient, Gathering, Openings, ShadeParams, render_shadow_maps, shade, shade_gathered};
use crate::testing::screen::{
    Shot, check_golden_view_of, check_pictures_of, check_walls_of, corner, corner_profile, corner_profile_of,
};
use crate::testing::{cube, ground};

const HALF: SideParams = SideParams { aside_m: 2.0, covers_from_m: 1.0, coarseness: 2 };

#[test]
fn the_second_camera_takes_in_all_that_the_first_one_sees() {
    let placed = look(Vec3::new(3.0, 2.0, -1.0), Vec3::new(-1.0, 0.5, 4.0));
    let lenses = [0.3, 0.8, 1.2].map(|yfov| Projection::Perspective { yfov, near: 0.05 });
    let parallel = [
        Projection::Orthographic { half_height: 2.0, near: 0.5, far: 30.0 },
        Projection::Orthographic { half_height: 5.0, near: -3.0, far: 3.0 },
    ];
    for projection in lenses.into_iter().chain(parallel) {
        let camera = PosedCamera { projection, ..placed };
        for (aside_m, covers_from_m) in [(0.3, 1.0), (2.0, 1.0), (2.0, 0.5), (1.0, 4.0)] {
            for [width, height] in [[160, 90], [90, 90], [60, 100]] {
                let side = SideParams { aside_m, covers_from_m, coarseness: 1 };
                let aspect = f64::from(width) / f64::from(height);
                let second = side.camera(&camera, aspect).unwrap();
                let distances = match projection {
                    Projection::Perspective { .. } => [covers_from_m, 3.0 * covers_from_m, 50.0, 2000.0],
                    Projection::Orthographic { near, far, .. } => [near, near + 1.0, 0.5 * (near + far), far],
                };
                let [first, beside] =
                    [&camera, &second].map(|camera| Screen::of_nothing(camera, [width, height]));
                let (columns, rows) = (width as f32, height as f32);
                let (mut least, mut most) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
                for distance in distances {
                    for point in [
                        [0.0, 0.0],
                        [columns, 0.0],
                        [0.0, rows],
                        [columns, rows],
                        [0.4 * columns, 0.6 * rows],
                    ] {
                        let place = first.place_view(point[0], point[1], distance);
                        let world = camera.world_from_view.transform_point3(place);
                        let seen = second.world_from_view.inverse().transform_point3(world);
                        let [column, row] = beside.point_of(seen).expect("before the second camera");
                        let slack = 0.002 * (columns + rows);
                        let inside = (-slack..=columns + slack).contains(&column)
                            && (-slack..=rows + slack).contains(&row);
                        assert!(
                            inside,
                            "{projection:?} {side:?} {width}x{height} {distance}: {column}, {row}"
                        );
                        if let Projection::Orthographic { far, .. } = second.projection {
                            assert!((-1e-3..far + 1e-3).contains(&-seen.z), "{seen}");
                        }
                        least = [least[0].min(column), least[1].min(row)];
                        most = [most[0].max(column), most[1].max(row)];
                    }
                }
                // And no more than it must, along one axis at least.
                let used = [(most[0] - least[0]) / columns, (most[1] - least[1]) / rows];
                assert!(used[0].max(used[1]) > 0.9, "{projection:?} {side:?} {width}x{height}: {used:?}");
            }
        }
    }
}

#[test]
fn a_second_picture_may_have_more_samples_than_pictures_have_pixels() {
    let stage = still_life();
    let projection = Projection::Orthographic { half_height: 0.001, near: -3.0, far: 20.0 };
    let camera = PosedCamera { projection, ..look(Vec3::new(2.0, 0.3, 4.0), Vec3::new(0.9, 0.3, 0.6)) };
    for map in [MapParams::default(), MapParams::paper(1)] {
        let draw = |size| {
            SideView::draw(&stage.scene, &stage.pose, &camera, size, &SideParams::default(), &map).map(|_| ())
        };
        draw([16_386, 3]).unwrap();
        assert!(matches!(draw([1 << 20, 1]), Err(RenderError::Size { .. })));
    }
}

#[test]
fn wrong_second_cameras_are_refused() {
    let camera = look(Vec3::new(2.0, 2.5, 4.0), Vec3::ZERO);
    let good = SideParams::default();
    for (side, says) in [
        (SideParams { aside_m: 0.0, ..good }, "aside_m is 0"),
        (SideParams { aside_m: f32::NAN, ..good }, "aside_m is NaN"),
        (SideParams { covers_from_m: -1.0, ..good }, "covers_from_m is -1"),
        (SideParams { coarseness: 0, ..good }, "coarseness is 0"),
        (SideParams { coarseness: 9, ..good }, "1 to 8"),
    ] {
        let error = side.camera(&camera, 1.5).unwrap_err().to_string();
        assert!(error.contains("sdao") && error.contains(says), "{error}");
    }
    let wide = PosedCamera { projection: Projection::Perspective { yfov: 3.12, near: 0.1 }, ..camera };
    assert!(good.camera(&wide, 2.0).unwrap_err().to_string().contains("too wide"));
    let (stage, (_, screen)) = (still_life(), draw(&still_life(), &camera, [16, 12]));
    let map = MapParams::default();
    let side = SideView::draw(&stage.scene, &stage.pose, &camera, [16, 12], &good, &map).unwrap();
    let two = |params: &HbaoParams| {
        estimate_visibility_of_two(&screen, params, &Lookup::default(), &side, &mut |_| ())
    };
    assert!(two(&HbaoParams::hbao_plus()).is_ok());
    assert!(two(&HbaoParams::hbao()).unwrap_err().to_string().contains("mean"));
}

/// HBAO+ of two cameras.
fn two_cameras(side: SideParams, map: MapParams) -> impl Fn(&Shot<'_>) -> Vec<f32> + Sync {
    move |shot| {
        let Shot { stage: Stage { scene, pose }, camera, gbuffer, screen } = shot;
        let size = [screen.columns(), screen.rows()];
        let own = StochasticMap::draw(scene, pose, camera, gbuffer, &map).unwrap();
        let side = SideView::draw(scene, pose, camera, size, &side, &map).unwrap();
        let lookup = Lookup::stochastic(&own);
        estimate_visibility_of_two(screen, &HbaoParams::hbao_plus(), &lookup, &side, &mut |_| ()).unwrap()
    }
}

/// SSAO of two cameras.
fn two_cameras_of_ssao(side: SideParams, map: MapParams) -> impl Fn(&Shot<'_>) -> Vec<f32> + Sync {
    move |shot| {
        let Shot { stage: Stage { scene, pose }, camera, gbuffer, screen } = shot;
        let size = [screen.columns(), screen.rows()];
        let own = StochasticMap::draw(scene, pose, camera, gbuffer, &map).unwrap();
        let side = SideView::draw(scene, pose, camera, size, &side, &map).unwrap();
        let lookup = Lookup::stochastic(&own);
        estimate_ssao_of_two(screen, &SsaoParams::default(), &lookup, &side, &mut |_| ()).unwrap()
    }
}

#[test]
fn walls_are_open_and_pictures_are_pictures_to_ssao_too() {
    for (side, map) in [(SideParams::default(), MapParams::with_samples(4)), (HALF, MapParams::paper(4))] {
        let estimate = two_cameras_of_ssao(side, map);
        check_walls_of(&estimate, 75.0, 0.99);
        check_pictures_of(&estimate);
        let alone = |screen: &Screen| ssao::estimate_visibility(screen, &SsaoParams::default()).unwrap();
        for (found, alone) in corner_profile_of(&estimate, 0.6).iter().zip(corner_profile(&alone, 0.6)) {
            println!("{found:?}, {alone:?}");
            assert!((-0.12..0.01).contains(&(found[0] - alone[0])), "{found:?}, {alone:?}");
        }
    }
}

#[test]
fn walls_are_open_pictures_are_pictures_and_a_corner_is_one() {
    for (side, map) in [(SideParams::default(), MapParams::with_samples(4)), (HALF, MapParams::paper(4))] {
        let estimate = two_cameras(side, map);
        check_walls_of(&estimate, 75.0, 0.99);
        check_pictures_of(&estimate);
        let alone = |screen: &Screen| hbao::estimate_visibility(screen, &HbaoParams::hbao_plus()).unwrap();
        for (found, alone) in corner_profile_of(&estimate, 0.6).iter().zip(corner_profile(&alone, 0.6)) {
            assert!((-0.12..0.01).contains(&(found[0] - alone[0])), "{found:?}, {alone:?}");
        }
    }
}

#[test]
fn a_wall_that_the_first_camera_looks_along_is_found() {
    // A tower from straight above: its walls are not on the picture, and its top is too far away to count.
    let mut stage = Stage::new();
    stage.add(ground(30.0), 0, Affine3A::IDENTITY);
    let tower = Affine3A::from_translation(Vec3::Y) * Affine3A::from_scale(Vec3::new(0.5, 1.0, 0.5));
    stage.add(cube(), 0, tower);
    // Far away with a narrow lens, so that walls stay edge-on; its right is +x.
    let mut camera = look(Vec3::new(0.0, 40.0, 0.0), Vec3::new(0.0, 0.0, -1e-3));
    camera.projection = Projection::Perspective { yfov: 0.1, near: 0.1 };
    assert!(camera.world_from_view.transform_vector3(Vec3::X).dot(Vec3::X) > 0.99);
    let (gbuffer, screen) = draw(&stage, &camera, [160, 160]);
    let beside = |values: &[f32], sign: f32| {
        let is_there = |i: &usize| {
            gbuffer.surface(&stage.scene, &stage.pose, *i).is_some_and(|surface| {
                let at = surface.position_world;
                surface.instance == 0 && (0.55..0.7).contains(&(sign * at.x)) && at.z.abs() < 0.3
            })
        };
        let there: Vec<usize> = (0..values.len()).filter(is_there).collect();
        assert!(there.len() > 50, "{}", there.len());
        there.iter().map(|i| values[*i]).sum::<f32>() / there.len() as f32
    };
    let alone = hbao::estimate_visibility(&screen, &HbaoParams::hbao_plus()).unwrap();
    assert!(beside(&alone, 1.0) > 0.99 && beside(&alone, -1.0) > 0.99);
    let far = SideParams { aside_m: 25.0, covers_from_m: 30.0, coarseness: 1 };
    let shot = Shot { stage: &stage, camera: &camera, gbuffer: &gbuffer, screen: &screen };
    for (side, map) in [
        (far, MapParams::with_samples(4)),
        (far, MapParams::paper(16)),
        (SideParams { coarseness: 2, ..far }, MapParams::with_samples(4)),
    ] {
        let both = [two_cameras(side, map)(&shot), two_cameras_of_ssao(side, map)(&shot)];
        // Within the radius the wall takes less of SSAO's hemisphere.
        for (found, dark) in both.iter().zip([0.8, 0.9]) {
            let sides = [1.0, -1.0].map(|sign| beside(found, sign));
            println!("{side:?} {sides:?}");
            assert!(sides[0] < dark, "the wall that the second camera faces: {sides:?}");
            assert!(sides[1] > 0.98, "no camera sees the other one: {sides:?}");
        }
    }
}

/// Mean of a vector a sample over the ground of [`corner`] within a strip beside the wall.
fn over_the_ground(gbuffer: &GBuffer, stage: &Stage, values: &[Vec3], strip: std::ops::Range<f32>) -> Vec3 {
    let is_there = |i: &usize| {
        let surface = gbuffer.surface(&stage.scene, &stage.pose, *i);
        surface.is_some_and(|s| s.instance == 0 && strip.contains(&s.position_world.x))
    };
    let there: Vec<usize> = (0..values.len()).filter(is_there).collect();
    assert!(there.len() > 100, "{}", there.len());
    there.iter().map(|i| values[*i]).sum::<Vec3>() / there.len() as f32
}

#[test]
fn bent_normals_lean_away_from_a_wall_and_stand_upright_in_the_open() {
    let stage = corner();
    let camera = look(Vec3::new(3.0, 2.5, 0.0), Vec3::new(0.5, 0.0, 0.0));
    let (gbuffer, screen) = draw(&stage, &camera, [240, 240]);
    let layers = Layers::draw(&stage.scene, &stage.pose, &camera, 240, 240, 1).unwrap();
    for params in [HbaoParams::hbao(), HbaoParams::hbao_plus()] {
        for lookup in [Lookup::default(), Lookup::peeled(&layers)] {
            let bent = bent_normals(&screen, &params, &lookup).unwrap();
            let open = bent.open_world(&camera);
            let far = over_the_ground(&gbuffer, &stage, &open, 0.8..1.2);
            assert!(far.distance(Vec3::Y * (2.0 / 3.0)) < 0.01, "{far}");
            // At the wall's foot half of the directions is open: (1/3 up, 2/(3π) away) of the mean; distance lets more be
            // open, and a strength above 1 closes more.
            let near = over_the_ground(&gbuffer, &stage, &open, 0.0..0.06);
            let away = 2.0 / (3.0 * std::f32::consts::PI);
            println!("{:?}: {near}, limit {away}", params.horizon);
            assert!((0.4 * away..1.4 * away).contains(&near.x) && near.z.abs() < 0.02, "{near}");
            assert!((0.3..0.65).contains(&near.y), "{near}");
            for ((axis, cosine), visibility) in bent.cones().iter().zip(&bent.visibility) {
                assert!((axis.length() - 1.0).abs() < 1e-3 || *axis == Vec3::ZERO);
                assert!((1.0 - cosine * cosine - visibility).abs() < 1e-3);
            }
        }
    }
}

#[test]
fn bent_normals_of_a_ground_take_the_light_of_its_normals_and_hidden_things_bend_them() {
    let (stage, camera) = super::hidden::behind_a_pillar();
    let (gbuffer, screen) = draw(&stage, &camera, [640, 480]);
    let map = StochasticMap::draw(&stage.scene, &stage.pose, &camera, &gbuffer, &MapParams::with_samples(8))
        .unwrap();
    let bent = |lookup: &Lookup<'_>| bent_normals(&screen, &HbaoParams::hbao(), lookup).unwrap();
    let (alone, known) = (bent(&Lookup::default()), bent(&Lookup::stochastic(&map)));
    let [before, after] = [&alone, &known].map(|bent| {
        let right = |i: usize| {
            let at =
                gbuffer.surface(&stage.scene, &stage.pose, i).filter(|s| s.instance == 0)?.position_world;
            ((0.3..0.6).contains(&at.x) && (-6.2..-5.8).contains(&at.z))
                .then(|| bent.open_world(&camera)[i].x)
        };
        let found: Vec<f32> = (0..640 * 480).step_by(3).filter_map(right).collect();
        assert!(found.len() > 15, "{}", found.len());
        found.iter().sum::<f32>() / found.len() as f32
    });
    assert!(before.abs() < 0.01 && after > before + 0.02, "away from the hidden box: {before}, {after}");

    let ambient = Ambient::Hemisphere { sky: Vec3::new(0.9, 0.8, 0.7), ground: Vec3::new(0.1, 0.3, 0.2) };
    let params = ShadeParams { ambient, ..ShadeParams::default() };
    let (scene, pose) = (&stage.scene, &stage.pose);
    let plain =
        shade(scene, pose, &camera, &gbuffer, &render_shadow_maps(scene, pose, &params), &params).ambient;
    let open_world = alone.open_world(&camera);
    let gathering = Gathering { visibility: &alone.visibility, openings: Openings::Traced(&open_world) };
    let lit = shade_gathered(scene, pose, &camera, &gbuffer, &params, gathering);
    let open = (0..lit.len()).filter(|i| alone.visibility[*i] == 1.0 && gbuffer.samples()[*i].instance == 0);
    let far = open.map(|i| lit[i].distance(plain[i])).fold(0.0, f32::max);
    assert!(far < 1e-3, "{far}");
}

#[test]
fn golden_view_of_two_cameras() {
    check_golden_view_of(
        "sdao",
        "sd-hbao-plus-mv",
        &two_cameras(SideParams::default(), MapParams::default()),
    );
}
