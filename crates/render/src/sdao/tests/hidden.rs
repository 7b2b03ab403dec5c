//! What is hidden is found, by all three methods, and what they keep to besides.

use dapple_scene::{PosedCamera, Projection};

use super::*;
use crate::compose::view_visibility;
use crate::gbuffer::GBuffer;
use crate::testing::screen::{
    Shot, check_golden_view_of, check_lenses_of, check_pictures_of, check_walls_of, corner_profile,
    corner_profile_of,
};
use crate::testing::{check_golden, cube, ground};

/// Ground, a box of half a metre on it, and a thin pillar near the eye that hides all of the box.
pub(super) fn behind_a_pillar() -> (Stage, PosedCamera) {
    let mut stage = Stage::new();
    let block = |center: Vec3, half: Vec3| Affine3A::from_translation(center) * Affine3A::from_scale(half);
    stage.add(ground(30.0), 0, Affine3A::IDENTITY);
    stage.add(cube(), 0, block(Vec3::new(0.0, 0.25, -6.0), Vec3::splat(0.25)));
    stage.add(cube(), 0, block(Vec3::new(0.0, 1.2, -2.0), Vec3::new(0.12, 1.2, 0.1)));
    (stage, look(Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, 0.3, -6.0)))
}

/// Mean of a value a sample over the ground beside the hidden box.
fn beside_the_box(stage: &Stage, gbuffer: &GBuffer, values: &[f32]) -> f32 {
    let is_there = |i: &usize| {
        gbuffer.surface(&stage.scene, &stage.pose, *i).is_some_and(|surface| {
            let at = surface.position_world;
            surface.instance == 0 && (0.3..0.6).contains(&at.x.abs()) && (-6.2..-5.8).contains(&at.z)
        })
    };
    let there: Vec<usize> = (0..values.len()).filter(is_there).collect();
    assert!(there.len() > 100, "{}", there.len());
    there.iter().map(|i| values[*i]).sum::<f32>() / there.len() as f32
}

/// What a lookup makes of a screen, by each of the methods.
pub(super) type Method = fn(&Screen, &Lookup<'_>) -> Vec<f32>;

pub(super) const METHODS: [(&str, Method); 3] = [
    ("ssao", |screen, lookup| {
        ssao::estimate_visibility_with(screen, &SsaoParams::default(), lookup).unwrap()
    }),
    ("hbao", |screen, lookup| hbao::estimate_visibility_with(screen, &HbaoParams::hbao(), lookup).unwrap()),
    ("hbao-plus", |screen, lookup| {
        hbao::estimate_visibility_with(screen, &HbaoParams::hbao_plus(), lookup).unwrap()
    }),
];

#[test]
fn a_hidden_occluder_is_found_the_oftener_the_more_samples_there_are() {
    let (stage, camera) = behind_a_pillar();
    let (gbuffer, screen) = draw(&stage, &camera, [640, 480]);
    let layers = Layers::draw(&stage.scene, &stage.pose, &camera, 640, 480, 1).unwrap();
    for (name, method) in METHODS {
        let mean = |lookup: &Lookup<'_>| beside_the_box(&stage, &gbuffer, &method(&screen, lookup));
        let single = mean(&Lookup::default());
        let peeled = mean(&Lookup::peeled(&layers));
        let found = SIZES.map(|samples| {
            let params = MapParams::paper(samples);
            let map = StochasticMap::of_layers(&layers, &camera.projection, &params).unwrap();
            mean(&Lookup::paper(&map))
        });
        println!("{name}: {single}, {found:?}, {peeled}");
        assert!(single > 0.995 && peeled < 0.97, "{name}: {single}, {peeled}");
        assert!(found[0] < single && found.windows(2).all(|pair| pair[1] < pair[0]), "{name}: {found:?}");
        assert!((found[4] - peeled).abs() < 0.15 * (single - peeled), "{name}: {found:?}, {peeled}");
        // With the first surface left out, one sample of four always has the second.
        let map =
            StochasticMap::draw(&stage.scene, &stage.pose, &camera, &gbuffer, &MapParams::default()).unwrap();
        let second = mean(&Lookup::stochastic(&map));
        assert!((second - peeled).abs() < 0.05 * (single - peeled), "{name}: {second}, {peeled}");
    }
}

/// By a stochastic map of so many samples, or, for none, by all layers.
pub(super) fn estimate(method: Method, samples: u32) -> impl Fn(&Shot<'_>) -> Vec<f32> + Sync {
    move |shot| {
        let Shot { stage: Stage { scene, pose }, camera, gbuffer, screen } = shot;
        if samples == 0 {
            let [width, height, n] = [gbuffer.width, gbuffer.height, gbuffer.samples_per_axis];
            let layers = Layers::draw(scene, pose, camera, width, height, n).unwrap();
            return method(screen, &Lookup::peeled(&layers));
        }
        let params = MapParams::with_samples(samples);
        let map = StochasticMap::draw(scene, pose, camera, gbuffer, &params).unwrap();
        method(screen, &Lookup::stochastic(&map))
    }
}

#[test]
fn walls_are_open_pictures_are_pictures_and_lenses_agree() {
    for (name, method) in METHODS {
        for samples in [0, 1, 4, 16] {
            println!("{name}, {samples} samples");
            let estimate = estimate(method, samples);
            check_walls_of(&estimate, 75.0, 0.99);
            check_pictures_of(&estimate);
            check_lenses_of(&estimate, 0.01);
        }
    }
}

/// Floors under a floor, and one far below: what lies behind a plane never blocks it, wherever it is looked for.
#[test]
fn a_plane_over_others_is_open() {
    let mut stage = Stage::new();
    for height in [0.0, -0.1, -0.3, -0.5, -4.0] {
        stage.add(ground(60.0), 0, Affine3A::from_translation(Vec3::new(0.0, height, 0.0)));
    }
    for degrees in [10.0, 45.0, 70.0f64] {
        let angle = degrees.to_radians();
        let eye = Vec3::new(libm::sin(angle) as f32, libm::cos(angle) as f32, 0.1) * 4.0;
        let camera = look(eye, Vec3::ZERO);
        let (gbuffer, screen) = draw(&stage, &camera, [97, 61]);
        let layers = Layers::draw(&stage.scene, &stage.pose, &camera, 97, 61, 1).unwrap();
        let maps = SIZES.map(|samples| {
            let params = MapParams::with_samples(samples);
            StochasticMap::draw(&stage.scene, &stage.pose, &camera, &gbuffer, &params).unwrap()
        });
        let held = |map: &StochasticMap| map.distances_m(97 * 30 + 48).iter().any(|d| d.is_finite());
        assert!(maps.iter().all(held), "there are floors in the maps");
        let hidden = maps.iter().map(Hidden::Stochastic).chain([Hidden::Peeled(&layers)]);
        for (hidden, (name, method)) in hidden.flat_map(|hidden| METHODS.map(|method| (hidden, method))) {
            for looks in [Looks::Everywhere, Looks::WhereFirstIsFar, Looks::WhereFirstRises] {
                let visibility = method(&screen, &Lookup { hidden, looks, compensation: 1.0 });
                let least = visibility.iter().copied().fold(1.0, f32::min);
                assert!(least >= 0.99, "{name}, {degrees}°, {looks:?}: {least}");
            }
        }
    }
}

#[test]
fn a_corner_darkens_as_it_does_by_a_single_layer() {
    // Nothing is hidden in it but the ground behind the wall.
    for (_, method) in METHODS {
        let alone = corner_profile(&|screen| method(screen, &Lookup::default()), 0.6);
        for samples in [0, 4] {
            let found = corner_profile_of(&estimate(method, samples), 0.6);
            for (found, alone) in found.iter().zip(&alone) {
                assert!((found[0] - alone[0]).abs() < 0.005, "{found:?}, {alone:?}");
            }
        }
    }
}

#[test]
fn a_map_of_nothing_else_is_a_single_layer_to_the_last_bit() {
    // All that is behind the first surface of a lone wall is nothing; and a map of no weight is none.
    let (stage, camera) = (still_life(), look(Vec3::new(3.2, 2.4, 1.8), Vec3::new(0.5, 0.5, 0.0)));
    let (gbuffer, screen) = draw(&stage, &camera, [80, 60]);
    let layers = Layers::draw(&stage.scene, &stage.pose, &camera, 80, 60, 1).unwrap();
    let map = StochasticMap::draw(&stage.scene, &stage.pose, &camera, &gbuffer, &MapParams::with_samples(8))
        .unwrap();
    for (name, method) in &METHODS[..2] {
        let alone = method(&screen, &Lookup::default());
        let known = method(&screen, &Lookup::stochastic(&map));
        assert_ne!(alone, known, "{name}");
        assert_ne!(alone, method(&screen, &Lookup::peeled(&layers)), "{name}");
    }
    for (name, method) in METHODS {
        let weightless = Lookup { compensation: 0.0, ..Lookup::stochastic(&map) };
        assert_eq!(method(&screen, &Lookup::default()), method(&screen, &weightless), "{name}");
    }
    let stage = walls(1);
    let (gbuffer, screen) = draw(&stage, &ahead(), [33, 21]);
    let map =
        StochasticMap::draw(&stage.scene, &stage.pose, &ahead(), &gbuffer, &MapParams::paper(16)).unwrap();
    for (name, method) in METHODS {
        assert_eq!(
            method(&screen, &Lookup::default()),
            method(&screen, &Lookup { looks: Looks::Everywhere, ..Lookup::stochastic(&map) }),
            "{name}"
        );
    }
}

#[test]
fn sixteen_samples_are_near_all_layers_and_looking_where_it_rises_loses_nothing() {
    let (stage, camera) = (still_life(), look(Vec3::new(1.2, 0.6, 3.0), Vec3::new(0.6, 0.4, 0.0)));
    let (gbuffer, screen) = draw(&stage, &camera, [160, 120]);
    let layers = Layers::draw(&stage.scene, &stage.pose, &camera, 160, 120, 1).unwrap();
    let map = StochasticMap::draw(&stage.scene, &stage.pose, &camera, &gbuffer, &MapParams::with_samples(16))
        .unwrap();
    for (name, method) in METHODS {
        let peeled = method(&screen, &Lookup::peeled(&layers));
        let off = |lookup: &Lookup<'_>| {
            let found = method(&screen, lookup);
            found.iter().zip(&peeled).map(|(a, b)| (a - b).abs()).sum::<f32>() / peeled.len() as f32
        };
        let single = off(&Lookup::default());
        let (sampled, rises) = (
            off(&Lookup::stochastic(&map)),
            off(&Lookup { looks: Looks::WhereFirstRises, ..Lookup::peeled(&layers) }),
        );
        println!("{name}: {single}, {sampled}, {rises}");
        assert!(single > 5e-4 && sampled < 0.1 * single && rises < 0.05 * single, "{name}");
    }
}

#[test]
fn compensation_multiplies_what_hidden_surfaces_block() {
    let (stage, camera) = behind_a_pillar();
    let (gbuffer, screen) = draw(&stage, &camera, [640, 480]);
    let map = StochasticMap::draw(&stage.scene, &stage.pose, &camera, &gbuffer, &MapParams::with_samples(4))
        .unwrap();
    for (name, method) in METHODS {
        let closed = [0.5, 1.0, 2.0].map(|compensation| {
            let lookup = Lookup { compensation, ..Lookup::stochastic(&map) };
            1.0 - beside_the_box(&stage, &gbuffer, &method(&screen, &lookup))
        });
        // Nothing else is near, and little of it is cut off at 1.
        let ratios = [closed[0] / closed[1], closed[2] / closed[1]];
        assert!((ratios[0] - 0.5).abs() < 0.02 && (ratios[1] - 2.0).abs() < 0.2, "{name}: {closed:?}");
    }
}

#[test]
fn golden_views() {
    for (name, method) in METHODS {
        check_golden_view_of("sdao", &format!("sd-{name}"), &estimate(method, 4));
        check_golden_view_of("sdao", &format!("{name}-peeled"), &estimate(method, 0));
    }
}

#[test]
fn a_hidden_occluder_in_pictures() {
    let (stage, camera) = behind_a_pillar();
    let camera = PosedCamera { projection: Projection::Perspective { yfov: 0.32, near: 0.1 }, ..camera };
    let gbuffer = rasterize(&stage.scene, &stage.pose, &camera, 120, 90, 2).unwrap();
    let screen = gbuffer.screen(&stage.scene, &stage.pose, &camera).unwrap();
    let shot = Shot { stage: &stage, camera: &camera, gbuffer: &gbuffer, screen: &screen };
    let (_, hbao) = METHODS[1];
    let pictures = [
        ("hidden-box-hbao", hbao(&screen, &Lookup::default())),
        ("hidden-box-sd-hbao", estimate(hbao, 4)(&shot)),
    ];
    for (name, visibility) in pictures {
        check_golden("sdao", name, &view_visibility(&gbuffer, &visibility).unwrap());
    }
}

#[test]
fn the_more_layers_lie_before_an_occluder_the_less_of_it_is_known() {
    // [Vermeer2021] fig. 8: 0, 5 and 10 plates more within the pillar.
    let found = [0, 5, 10].map(|plates| {
        let (mut stage, camera) = behind_a_pillar();
        for plate in 0..plates {
            let z = -1.95 - 0.01 * plate as f32;
            let at = |x: f32, y: f32| Vec3::new(x, y, z);
            let mesh = quad([at(-0.11, 0.0), at(0.11, 0.0), at(0.11, 2.3), at(-0.11, 2.3)]);
            stage.add(mesh, 0, Affine3A::IDENTITY);
        }
        let (gbuffer, screen) = draw(&stage, &camera, [640, 480]);
        let shot = Shot { stage: &stage, camera: &camera, gbuffer: &gbuffer, screen: &screen };
        let (_, hbao) = METHODS[1];
        let closed = |samples| 1.0 - beside_the_box(&stage, &gbuffer, &estimate(hbao, samples)(&shot));
        let all = closed(0);
        [4, 16].map(|samples| closed(samples) / all)
    });
    println!(
        "of the occlusion by a hidden box, 4 and 16 samples find, behind 0, 5 and 10 layers more: {found:.2?}"
    );
    let [none, five, ten] = found;
    assert!(none[0] > 0.97 && five[0] < 0.8 && ten[0] < five[0]);
    assert!(five[1] > 0.6 && ten[1] > ten[0]);
}

/// The greatest change of visibility from one picture to the next, as the mean over those places of any fifth of a metre of ground that both show, while the
/// camera of [`behind_a_pillar`] steps aside until the box stands free.
fn pop_in(estimate: &dyn Fn(&Shot<'_>) -> Vec<f32>) -> f32 {
    let (stage, _) = behind_a_pillar();
    let mut last: Option<(PosedCamera, Screen, Vec<f32>)> = None;
    let mut most = 0.0f32;
    for frame in 0..=40 {
        let x = 0.01 * frame as f32;
        let camera = PosedCamera::look_at(Vec3::new(x, 1.0, 0.0), Vec3::new(x, 0.1, -6.0), 0.4);
        let (gbuffer, screen) = draw(&stage, &camera, [320, 240]);
        let values = estimate(&Shot { stage: &stage, camera: &camera, gbuffer: &gbuffer, screen: &screen });
        if let Some((camera, screen, last)) = last {
            let mut cells = std::collections::BTreeMap::<[i32; 2], (f32, u32)>::new();
            for (i, value) in values.iter().enumerate() {
                let surface = gbuffer.surface(&stage.scene, &stage.pose, i).filter(|s| s.instance == 0);
                let Some(at) = surface.map(|s| s.position_world) else { continue };
                let before = camera.world_from_view.inverse().transform_point3(at);
                let seen = screen.sample_at(before).filter(|seen| {
                    screen.position_view(*seen).is_some_and(|place| place.distance(before) < 0.05)
                });
                if let Some(seen) = seen.filter(|_| at.x.abs() < 1.0 && (at.z + 6.0).abs() < 1.0) {
                    let cell = cells.entry([at.x, at.z].map(|c| (5.0 * c).floor() as i32)).or_default();
                    *cell = (cell.0 + value - last[seen], cell.1 + 1);
                }
            }
            let means = cells.into_values().filter(|cell| cell.1 >= 20).map(|cell| cell.0 / cell.1 as f32);
            most = means.fold(most, |most, mean| most.max(mean.abs()));
        }
        last = Some((camera, screen, values));
    }
    most
}

#[test]
fn what_comes_out_from_behind_a_pillar_pops_in_less() {
    for (name, method) in METHODS {
        let single = pop_in(&|shot| method(shot.screen, &Lookup::default()));
        let paper = pop_in(&|shot| {
            let Shot { stage: Stage { scene, pose }, camera, gbuffer, screen } = shot;
            let map = StochasticMap::draw(scene, pose, camera, gbuffer, &MapParams::paper(4)).unwrap();
            method(screen, &Lookup::paper(&map))
        });
        let (sampled, peeled) = (pop_in(&estimate(method, 4)), pop_in(&estimate(method, 0)));
        println!("{name}: {single:.4}, paper {paper:.4}, ours {sampled:.4}, all layers {peeled:.4}");
        // What is left by all layers is that the box's sides come into view, along which the camera looked before.
        assert!(sampled < 0.65 * single && sampled < 1.1 * peeled, "{name}");
    }
}
