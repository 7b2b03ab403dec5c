//! Lights against closed forms, and against what their samplers say of themselves.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use glam::{Affine3A, Mat3, Vec2, Vec3};

use super::*;
use crate::{Filter, Image, Instance, Material, Mesh, Node, Part, Texture, TextureRef, Wrap};

/// A scene of lights, each a mesh with a radiance, placed in the world.
pub(super) struct Stage {
    scene: Scene,
}

impl Stage {
    pub(super) fn new() -> Stage {
        Stage { scene: Scene::default() }
    }

    pub(super) fn scene(&self) -> &Scene {
        &self.scene
    }

    pub(super) fn add(
        &mut self,
        mesh: Mesh,
        emitter: EmitterShape,
        radiance: Vec3,
        world: Affine3A,
    ) -> &mut Material {
        let scene = &mut self.scene;
        let material = scene.materials.len() as u32;
        scene.materials.push(Material { emissive_factor: radiance, ..Material::default() });
        let parts = vec![Part { first_triangle: 0, triangle_count: mesh.triangles.len() as u32, material }];
        scene.meshes.push(Mesh { parts, ..mesh });
        scene.nodes.push(Node { local: crate::LocalTransform::Matrix(world.into()), ..Node::default() });
        scene.instances.push(Instance {
            node: scene.nodes.len() as u32 - 1,
            mesh: scene.meshes.len() as u32 - 1,
            skin: None,
            casts: true,
            emitter,
            receives: true,
            rest_from_mesh: Mat3::IDENTITY,
            spare: false,
        });
        scene.materials.last_mut().unwrap()
    }
}

/// A square of side 2 in the plane z = 0, facing +Z.
pub(super) fn square() -> Mesh {
    let at = |x: f32, y: f32| Vec3::new(x, y, 0.0);
    Mesh {
        positions: vec![at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)],
        normals: vec![Vec3::Z; 4],
        uvs: [vec![Vec2::new(0.0, 1.0), Vec2::ONE, Vec2::new(1.0, 0.0), Vec2::ZERO], vec![]],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    }
}

/// Eight faces around the origin, corners at distance 1.
pub(super) fn octahedron() -> Mesh {
    let positions = vec![Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y, Vec3::Z, -Vec3::Z];
    let mut triangles = Vec::new();
    for x in [0u32, 1] {
        for y in [2u32, 3] {
            for z in [4u32, 5] {
                let odd = (x + y + z) % 2 == 1;
                triangles.push(if odd { [x, z, y] } else { [x, y, z] });
            }
        }
    }
    for t in &mut triangles {
        let [a, b, c] = t.map(|v| positions[v as usize]);
        if (b - a).cross(c - a).dot(a) < 0.0 {
            t.swap(1, 2);
        }
    }
    Mesh { normals: positions.clone(), positions, triangles, ..Mesh::default() }
}

/// Facing down from a height.
fn down(height: f32, half: Vec2) -> Affine3A {
    Affine3A::from_translation(Vec3::new(0.0, height, 0.0))
        * Affine3A::from_rotation_x(FRAC_PI_2)
        * Affine3A::from_scale(Vec3::new(half.x, half.y, 1.0))
}

/// Places in the unit cube, evenly spread.
fn cube(n: u32) -> impl Iterator<Item = [f32; 3]> {
    // Powers of the reciprocal of the root of x⁴ = x + 1.
    (0..n).map(|i| {
        [0.819_172_5_f64, 0.671_043_6, 0.549_700_5].map(|a| ((f64::from(i) + 0.5) * a).fract() as f32)
    })
}

/// Irradiance at the origin of a floor, by sampling.
fn irradiance(lights: &AreaLights<'_>, pick: Pick, position: Vec3, normal: Vec3, n: u32) -> f32 {
    let mut chooser = Chooser::new(pick);
    chooser.aim(lights, position, normal);
    let mut sum = 0.0f64;
    for u in cube(n) {
        if let Some(s) = lights.sample(&chooser, position, u) {
            assert!(s.density_per_sr > 0.0 && s.to_light_world.is_normalized(), "{s:?}");
            sum += f64::from(s.radiance.x * normal.dot(s.to_light_world).max(0.0) / s.density_per_sr);
        }
    }
    (sum / f64::from(n)) as f32
}

const PICKS: [Pick; 3] = [Pick::Uniform, Pick::Power, Pick::Fluence];

#[track_caller]
fn assert_near(found: f32, exact: f32, tolerance: f32) {
    assert!((found - exact).abs() <= tolerance * exact.abs(), "{found}, exactly {exact}");
}

#[test]
fn every_shape_gives_its_closed_form() {
    let one = |mesh: Mesh, emitter, world: Affine3A| {
        let mut stage = Stage::new();
        stage.add(mesh, emitter, Vec3::new(10.0, 1.0, 2.0), world);
        stage.scene
    };
    let ball = one(
        octahedron(),
        EmitterShape::Sphere,
        Affine3A::from_translation(Vec3::Y * 2.0) * Affine3A::from_scale(Vec3::splat(0.5)),
    );
    let disc = one(square(), EmitterShape::Disc, down(1.0, Vec2::splat(0.5f32.sqrt())));
    let rectangle = one(square(), EmitterShape::Rectangle, down(1.0, Vec2::new(2.5, 1.0)));
    let triangles = one(square(), EmitterShape::Triangles, down(1.0, Vec2::new(2.5, 1.0)));
    let (a, b) = (2.5f32, 1.0f32);
    // A rectangle over the foot of its centre: four corners' form factor.
    let corner = |a: f32, b: f32| {
        let (p, q) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
        (a / p * (b / p).atan() + b / q * (a / q).atan()) / TAU
    };
    let rectangle_exact = 10.0 * PI * 4.0 * corner(a, b);
    for pick in PICKS {
        for (scene, exact) in [
            (&ball, 10.0 * PI * 0.25 / 4.0),
            (&disc, 10.0 * PI * 0.5),
            (&rectangle, rectangle_exact),
            (&triangles, rectangle_exact),
        ] {
            let pose = scene.pose(0.0);
            let lights = AreaLights::new(scene, &pose);
            assert_eq!(lights.len(), 1);
            assert_near(irradiance(&lights, pick, Vec3::ZERO, Vec3::Y, 200_000), exact, 0.002);
            // From the back nothing comes: above the disc, below the floor.
            if scene.instances[0].emitter != EmitterShape::Sphere {
                assert_eq!(irradiance(&lights, pick, Vec3::Y * 3.0, -Vec3::Y, 500), 0.0);
            }
        }
    }
}

#[test]
fn picks_differ_in_noise_alone() {
    let mut stage = Stage::new();
    let sphere = |at: Vec3, r: f32| Affine3A::from_translation(at) * Affine3A::from_scale(Vec3::splat(r));
    stage.add(octahedron(), EmitterShape::Sphere, Vec3::splat(50.0), sphere(Vec3::new(1.0, 1.0, 0.0), 0.2));
    stage.add(
        octahedron(),
        EmitterShape::Triangles,
        Vec3::splat(3.0),
        sphere(Vec3::new(-2.0, 1.0, 0.4), 0.9),
    );
    stage.add(square(), EmitterShape::Rectangle, Vec3::splat(5.0), down(3.0, Vec2::new(0.4, 0.9)));
    // Below the floor, and black: never chosen by fluence.
    stage.add(octahedron(), EmitterShape::Sphere, Vec3::splat(900.0), sphere(Vec3::new(0.0, -3.0, 0.0), 0.3));
    let pose = stage.scene.pose(0.0);
    let sky = Environment::new(
        8,
        4,
        (0..32).map(|i| Vec3::splat(0.1 + 0.05 * (i % 5) as f32)).collect(),
        Mat3::IDENTITY,
    );
    let sky = sky.unwrap();
    let lights = AreaLights::new(&stage.scene, &pose).with_environment(&sky, &pose);
    assert_eq!(lights.len(), 5);
    let truth = irradiance(&lights, Pick::Fluence, Vec3::ZERO, Vec3::Y, 200_000);
    for pick in PICKS {
        assert_near(irradiance(&lights, pick, Vec3::ZERO, Vec3::Y, 1_000_000), truth, 0.004);
        let mut chooser = Chooser::new(pick);
        chooser.aim(&lights, Vec3::ZERO, Vec3::Y);
        let sum: f32 = (0..lights.len()).map(|i| chooser.probability(&lights, i)).sum();
        assert_near(sum, 1.0, 1e-5);
    }
    let mut chooser = Chooser::new(Pick::Fluence);
    chooser.aim(&lights, Vec3::ZERO, Vec3::Y);
    assert_eq!(chooser.probability(&lights, 3), 0.0);
    // Of four that can arrive each is picked now and then, however little it would bring.
    let least = (0..5).filter(|l| *l != 3).map(|l| chooser.probability(&lights, l)).fold(1.0, f32::min);
    assert!(least > 0.5 / 4.0 - 1e-5, "{least}");
    // A sample is a pick and a place on what was picked.
    for u in cube(500) {
        let (light, probability, rest) = chooser.pick(&lights, u[0]).unwrap();
        let place = lights.sample_light(light, Vec3::ZERO, [rest, u[1], u[2]]);
        let place = place.map(|s| LightSample { density_per_sr: s.density_per_sr * probability, ..s });
        assert_eq!(place, lights.sample(&chooser, Vec3::ZERO, u));
    }
}

#[test]
fn an_estimate_is_never_zero_where_light_arrives() {
    // Lights of every shape all around, seen from near and far, within and beside them, by surfaces turned every way.
    for emitter in EmitterShape::NAMES.map(|(_, shape)| shape) {
        for (i, u) in cube(60).enumerate() {
            let mut stage = Stage::new();
            let at = (Vec3::from_array(u) - 0.5) * 4.0;
            let flat = matches!(emitter, EmitterShape::Disc | EmitterShape::Rectangle) || i % 2 == 0;
            let turn = Affine3A::from_rotation_y(u[0] * TAU) * Affine3A::from_rotation_x(u[1] * TAU);
            let mesh = if flat { square() } else { octahedron() };
            let double = i % 3 == 0;
            stage.add(mesh, emitter, Vec3::ONE, Affine3A::from_translation(at) * turn).double_sided = double;
            let pose = stage.scene.pose(0.0);
            let lights = AreaLights::new(&stage.scene, &pose);
            for v in cube(20) {
                let normal = (Vec3::from_array(v) - 0.5).normalize();
                let estimate = lights.arriving(0, Vec3::ZERO, normal);
                for w in cube(40) {
                    let Some(s) = lights.sample_light(0, Vec3::ZERO, w) else { continue };
                    // Rounding decides at the horizon.
                    if s.to_light_world.dot(normal) > 1e-3 {
                        assert!(estimate > 0.0, "{emitter:?} at {at}, normal {normal}");
                    }
                }
            }
        }
    }
}

#[test]
fn the_largest_cosine_is_that_of_the_best_direction_in_a_ball() {
    let unit = |u: [f32; 3]| (Vec3::from_array(u) - 0.5).normalize();
    for (i, u) in cube(40).enumerate() {
        let offset = unit(u) * 3.0;
        // Seen from afar as a point, wide, and from its very rim.
        let radius = [1e-4, 0.5, 1.5, 2.999][i % 4];
        for (j, v) in cube(40).enumerate() {
            let normal_world = unit([v[1], v[2], v[0]]);
            let ground_world = (normal_world + 0.8 * unit(v)).normalize();
            let facing = Facing { normal_world, ground_world, least_cosine: [0.0, 0.05][j % 2] };
            // Directions to the ball, from its middle to its rim all around.
            let (axis, spread) = (offset / 3.0, libm::asinf(radius / 3.0));
            let (across, along) = axis.any_orthonormal_pair();
            let towards = (0..9 * 64).map(|k| {
                let (sine, cosine) = libm::sincosf(spread * (k % 9) as f32 / 8.0);
                let (sin_turn, cos_turn) = libm::sincosf(TAU * (k / 9) as f32 / 64.0);
                facing.cosine(axis * cosine + (across * cos_turn + along * sin_turn) * sine)
            });
            let found = facing.largest_cosine(offset, radius);
            let best = towards.fold(0.0, f32::max);
            // The best of so many lies a little beside the best there is.
            assert!(
                found >= best - 1e-5 && found <= best + 0.06,
                "{facing:?} {offset} {radius}: {found}, {best}"
            );
        }
        let flat = offset.any_orthonormal_vector();
        for (normal, far, cosine) in
            [(Vec3::ZERO, radius, 1.0), (flat, 4.0, 1.0), (-offset / 3.0, radius, 0.0)]
        {
            assert_eq!(Facing::from(normal).largest_cosine(offset, far), cosine, "{normal} {far}");
        }
    }
}

#[test]
fn rays_meet_lights_where_samples_lie_on_them() {
    for emitter in EmitterShape::NAMES.map(|(_, shape)| shape) {
        for two_sided in [false, true] {
            let mut stage = Stage::new();
            let flat = matches!(emitter, EmitterShape::Disc | EmitterShape::Rectangle);
            let mesh = if flat { square() } else { octahedron() };
            let world =
                Affine3A::from_translation(Vec3::new(0.4, 2.0, -0.3)) * Affine3A::from_rotation_x(2.0);
            stage.add(mesh, emitter, Vec3::ONE, world).double_sided = two_sided;
            let pose = stage.scene.pose(0.0);
            let lights = AreaLights::new(&stage.scene, &pose);
            let mut found = 0;
            for u in cube(300) {
                let Some(s) = lights.sample_light(0, Vec3::ZERO, u) else { continue };
                found += 1;
                let hit = lights.hit(Vec3::ZERO, s.to_light_world);
                let nearer = hit.is_some_and(|t| t <= s.distance_m * 1.001);
                // At its rim rounding decides; of a body that is seen through, a nearer side may be met.
                assert!(
                    nearer
                        || s.normal_on_light_world.dot(s.to_light_world) > -0.02
                        || hit.is_none() && rim(&s),
                    "{s:?} {hit:?}"
                );
                assert_eq!(lights.hit(Vec3::ZERO, -s.to_light_world), None);
            }
            assert!(found > 50, "{emitter:?}: {found}");
        }
    }
}

/// Whether a sample lies next to an edge of the light of the test above.
fn rim(s: &LightSample) -> bool {
    let local = (s.to_light_world * s.distance_m - Vec3::new(0.4, 2.0, -0.3)).abs();
    local.max_element() > 0.98
}

#[test]
fn textured_triangles_shine_as_their_picture_does() {
    let mut stage = Stage::new();
    // The right half white, the left black.
    stage.scene.images.push(Image {
        name: String::new(),
        width: 2,
        height: 1,
        rgba8: vec![[0, 0, 0, 255], [255, 255, 255, 255]],
    });
    let (wrap_u, wrap_v) = (Wrap::Clamp, Wrap::Clamp);
    stage.scene.textures.push(Texture { image: 0, wrap_u, wrap_v, filter: Filter::Nearest });
    let texture = TextureRef { texture: 0, uv_set: 0, image_from_uv: glam::Affine2::IDENTITY };
    stage.add(square(), EmitterShape::Triangles, Vec3::splat(4.0), down(1.0, Vec2::ONE)).emissive_texture =
        Some(texture);
    let pose = stage.scene.pose(0.0);
    let lights = AreaLights::new(&stage.scene, &pose);
    assert_near(lights.power_of(0), 2.0 * 4.0 * PI, 0.05);
    let all = {
        let mut plain = Stage::new();
        plain.add(square(), EmitterShape::Triangles, Vec3::splat(4.0), down(1.0, Vec2::ONE));
        let pose = plain.scene.pose(0.0);
        irradiance(&AreaLights::new(&plain.scene, &pose), Pick::Power, Vec3::ZERO, Vec3::Y, 20_000)
    };
    assert_near(irradiance(&lights, Pick::Power, Vec3::ZERO, Vec3::Y, 20_000), 0.5 * all, 0.01);
    for u in cube(200) {
        if let Some(s) = lights.sample_light(0, Vec3::ZERO, u) {
            let at = s.to_light_world * s.distance_m;
            assert_eq!(s.radiance.x > 0.0, at.x > 0.0, "{at}");
        }
    }
}

#[test]
fn an_environment_gives_the_light_that_it_holds() {
    // A bright patch on a dim sky: by luminance, against a sum over all directions.
    let (w, h) = (32, 16);
    let texels: Vec<Vec3> = (0..w * h)
        .map(|i| if i % w == 20 && i / w == 4 { Vec3::splat(60.0) } else { Vec3::splat(0.2) })
        .collect();
    let turn = Mat3::from_rotation_y(0.7);
    let sky = Environment::new(w, h, texels, turn).unwrap();
    let mut exact = 0.0f64;
    let (nu, nv) = (960u32, 480u32);
    for j in 0..nv {
        let theta = (j as f32 + 0.5) / nv as f32 * PI;
        for i in 0..nu {
            let phi = (i as f32 + 0.5) / nu as f32 * TAU;
            let d = Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
            exact += f64::from(sky.radiance(d).x * d.y.max(0.0) * theta.sin());
        }
    }
    let exact = (exact * f64::from(PI / nv as f32) * f64::from(TAU / nu as f32)) as f32;
    let scene = Scene::default();
    let pose = scene.pose(0.0);
    let lights = AreaLights::new(&scene, &pose).with_environment(&sky, &pose);
    // A scene without extent has no power from outside; by fluence it has.
    assert_near(irradiance(&lights, Pick::Fluence, Vec3::ZERO, Vec3::Y, 50_000), exact, 0.01);
    for u in cube(500) {
        let (d, radiance, density) = sky.sample([u[0], u[1]]);
        assert!((sky.density_per_sr(d) - density).abs() <= 2e-3 * density, "{d}");
        assert_eq!(radiance, sky.radiance(d));
    }
    let sum: f32 = cube(20_000).map(|u| 1.0 / sky.sample([u[0], u[1]]).2).sum::<f32>() / 20_000.0;
    assert_near(sum, 2.0 * TAU, 0.02);
}

#[test]
fn what_cannot_shine_gives_nothing_and_breaks_nothing() {
    let flat = |s: f32| Affine3A::from_scale(Vec3::splat(s));
    for (radiance, world) in [
        (Vec3::splat(1e30), flat(1.0)),
        (Vec3::splat(1.0), flat(0.0)),
        (Vec3::splat(1.0), flat(1e-30)),
        (Vec3::splat(1.0), flat(1e18)),
        (Vec3::splat(f32::MIN_POSITIVE), flat(1.0)),
    ] {
        for emitter in EmitterShape::NAMES.map(|(_, shape)| shape) {
            let mut stage = Stage::new();
            stage.add(octahedron(), emitter, radiance, world);
            stage.add(square(), emitter, radiance, world);
            let pose = stage.scene.pose(0.0);
            let lights = AreaLights::new(&stage.scene, &pose);
            for pick in PICKS {
                for position in [Vec3::ZERO, Vec3::new(0.3, -2.0, 0.1), Vec3::splat(1e9)] {
                    let mut chooser = Chooser::new(pick);
                    chooser.aim(&lights, position, Vec3::Y);
                    for u in cube(50).chain([[0.0; 3], [0.999_999_9; 3]]) {
                        if let Some(s) = lights.sample(&chooser, position, u) {
                            let finite = s.to_light_world.is_finite() && s.density_per_sr.is_finite();
                            assert!(finite && s.density_per_sr > 0.0, "{emitter:?} {s:?}");
                        }
                    }
                }
            }
        }
    }
    let mut dark = Stage::new();
    dark.add(square(), EmitterShape::Disc, Vec3::ZERO, flat(1.0));
    let pose = dark.scene.pose(0.0);
    assert!(AreaLights::new(&dark.scene, &pose).is_empty());
    assert!(Environment::new(0, 1, vec![], Mat3::IDENTITY).is_err());
    assert!(Environment::new(1, 1, vec![Vec3::splat(f32::NAN)], Mat3::IDENTITY).is_err());
    assert!(Environment::new(1, 1, vec![Vec3::splat(2.0 * MAX_RADIANCE)], Mat3::IDENTITY).is_err());
    let bright = Environment::new(64, 32, vec![Vec3::splat(MAX_RADIANCE); 2048], Mat3::IDENTITY).unwrap();
    assert!(bright.mean_radiance().is_finite());
    let (_, radiance, density) = bright.sample([0.3, 0.6]);
    assert!(radiance.is_finite() && density > 0.0 && density.is_finite(), "{radiance} {density}");
    let error = Environment::from_hdr(b"nothing").unwrap_err().to_string();
    assert!(error.contains("equirectangular .hdr"), "{error}");
    let black = Environment::new(2, 1, vec![Vec3::ZERO; 2], Mat3::IDENTITY).unwrap();
    assert_eq!(black.sample([0.5, 0.5]).2, 0.0);
}

#[test]
fn a_light_keeps_its_index_and_tells_when_it_changed() {
    let mut stage = Stage::new();
    stage.add(square(), EmitterShape::Disc, Vec3::ONE, Affine3A::IDENTITY);
    stage.add(square(), EmitterShape::Rectangle, Vec3::ONE, down(2.0, Vec2::ONE));
    let scene = stage.scene;
    let pose = scene.pose(0.0);
    let mut moved = pose.clone();
    moved.instances[1].world_from_mesh.translation.x += 0.5;
    let mut gone = pose.clone();
    gone.instances[0] = crate::PosedInstance::REMOVED;
    let before = AreaLights::new(&scene, &pose);
    assert_eq!(AreaLights::new(&scene, &pose).changed_since(&before), [false, false]);
    assert_eq!(AreaLights::new(&scene, &moved).changed_since(&before), [false, true]);
    let without = AreaLights::new(&scene, &gone);
    assert_eq!(without.changed_since(&before), [true, false]);
    assert_eq!((without.len(), without.power_of(0), without.bounds(0)), (2, 0.0, None));
    assert_eq!(without.instance(1), Some(1));
}

/// Receivers at the middle and the rim of a ball, who share places on lights of every shape.
#[test]
fn places_that_receivers_share_have_a_density_for_each() {
    let at = |x: f32, y: f32, z: f32, r: f32| {
        Affine3A::from_translation(Vec3::new(x, y, z)) * Affine3A::from_scale(Vec3::splat(r))
    };
    let mut stage = Stage::new();
    stage.add(octahedron(), EmitterShape::Sphere, Vec3::splat(3.0), at(1.0, 2.0, 0.5, 0.5));
    // As near as it may be for a ball of 0.2 m.
    stage.add(octahedron(), EmitterShape::Sphere, Vec3::splat(3.0), at(0.0, 1.31, 0.0, 0.5));
    stage.add(octahedron(), EmitterShape::Triangles, Vec3::splat(3.0), at(-1.0, 1.0, 0.5, 0.4));
    stage.add(square(), EmitterShape::Disc, Vec3::splat(3.0), down(1.0, Vec2::splat(0.5)));
    stage.add(square(), EmitterShape::Rectangle, Vec3::splat(3.0), down(2.0, Vec2::new(1.5, 0.2)));
    let two_sided = down(2.5, Vec2::splat(1.0)) * Affine3A::from_rotation_x(PI);
    stage.add(square(), EmitterShape::Rectangle, Vec3::splat(3.0), two_sided).double_sided = true;
    let pose = stage.scene.pose(0.0);
    let lights = AreaLights::new(&stage.scene, &pose);
    let ball = (Vec3::ZERO, 0.2);
    let n = 100_000;
    for light in 0..lights.len() as u32 {
        for from in [Vec3::ZERO, Vec3::X * 0.2, -Vec3::X * 0.2, Vec3::new(0.1, -0.15, 0.08)] {
            let mean = |sample: &dyn Fn([f32; 3]) -> Option<LightSample>| {
                let worth = |s: LightSample| f64::from(s.to_light_world.y.max(0.0) / s.density_per_sr);
                cube(n).filter_map(sample).map(worth).sum::<f64>() / f64::from(n)
            };
            let own = mean(&|u| lights.sample_light(light, from, u));
            let shared = mean(&|u| {
                let spot = lights.spot(light, ball, u).expect("far enough");
                let seen = spot.seen_from(from)?;
                assert!((from + seen.to_light_world * seen.distance_m - spot.position_world).length() < 1e-5);
                Some(seen)
            });
            assert!(own > 0.0);
            assert_near(shared as f32, own as f32, 0.003);
        }
    }
    let near = (Vec3::ZERO, 0.25);
    assert!(
        cube(9).all(|u| lights.spot(1, near, u).is_none()),
        "too near for their distance from each other"
    );
    let between = (Vec3::Y * 2.5, 0.3);
    assert!(cube(9).all(|u| lights.spot(5, between, u).is_none()), "on both sides of what shines from both");
    assert!(lights.spot(6, ball, [0.5; 3]).is_none(), "no such light");
}

#[test]
fn a_pick_for_many_places_is_the_mean_of_theirs() {
    let mut stage = Stage::new();
    for (x, y) in [(-2.0, 1.0), (2.0, 1.0), (0.0, -1.0)] {
        let world = Affine3A::from_translation(Vec3::new(x, y, 0.0)) * Affine3A::from_scale(Vec3::splat(0.3));
        stage.add(octahedron(), EmitterShape::Sphere, Vec3::splat(5.0), world);
    }
    let pose = stage.scene.pose(0.0);
    let lights = AreaLights::new(&stage.scene, &pose);
    // The last is in the dark.
    let places = [(Vec3::ZERO, Vec3::Y), (Vec3::X * 1.5, Vec3::Y), (Vec3::X * -5.0, -Vec3::X)];
    for pick in PICKS {
        let mut among = Chooser::new(pick);
        among.aim_among(&lights, places);
        let mut own = Chooser::new(pick);
        for light in 0..lights.len() {
            let mean = |own: &mut Chooser| {
                let of = |(position, normal)| {
                    own.aim(&lights, position, normal);
                    own.probability(&lights, light)
                };
                // Places to which nothing can come have no say.
                let lit = if pick == Pick::Fluence { &places[..2] } else { &places[..] };
                lit.iter().copied().map(of).sum::<f32>() / lit.len() as f32
            };
            let (found, exact) = (among.probability(&lights, light), mean(&mut own));
            assert!((found - exact).abs() < 1e-5, "{pick:?}, light {light}: {found}, {exact}");
        }
    }
}
