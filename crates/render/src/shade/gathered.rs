//! Light from the surroundings by where it comes from: about bent normals, or summed over the directions that are open.

use dapple_scene::{Pose, PosedCamera, Projection, Reflectance, Scene};
use glam::{Quat, Vec3};
use rayon::prelude::*;

use super::brdf::reflected_ambient;
use super::{Ambient, ShadeParams};
use crate::gbuffer::{GBuffer, Surface};
use crate::texture;

/// From where samples gather light that they reflect diffusely: one entry a sample, directions in the world and about the geometric normal.
#[derive(Clone, Copy, Debug)]
pub struct Gathering<'a> {
    /// How much is open, 0 … 1.
    pub visibility: &'a [f32],
    /// Where.
    pub openings: Openings<'a>,
}

/// Where samples are open.
#[derive(Clone, Copy, Debug)]
pub enum Openings<'a> {
    /// About bent normals, unit vectors; zero: about the shading normal.
    Bent(&'a [Vec3]),
    /// In directions with this mean by cosine, blocked ones as zero: 2/3 of the normal if all is open.
    Traced(&'a [Vec3]),
}

impl Ambient {
    /// Mean radiance, by cosine, of directions whose mean, by cosine, is `mean_world` (2/3 … 1 long).
    ///
    /// [`Ambient::radiance`] is taken for what an open surface gathers about its normal. For a hemisphere that is so if light from a
    /// direction d is (sky + ground) / 2 + ¾ (sky − ground) d_y, whose mean by cosine about n, where d averages 2/3 n, is just that.
    pub fn gathered(&self, mean_world: Vec3) -> Vec3 {
        match *self {
            Ambient::Constant(radiance) => radiance,
            Ambient::Hemisphere { sky, ground } => {
                (sky + ground) * 0.5 + (sky - ground) * (0.75 * mean_world.y)
            }
        }
    }
}

/// The ambient part of [`Shaded`](super::Shaded) with the diffuse light gathered from elsewhere than about shading normals. Visibility is not
/// in it, so it is composed like the other. Directions are turned as the shading normal is against the geometric one.
///
/// # Panics
/// If a list has not one entry a sample.
pub fn shade_gathered(
    scene: &Scene,
    pose: &Pose,
    camera: &PosedCamera,
    gbuffer: &GBuffer,
    params: &ShadeParams,
    gathering: Gathering<'_>,
) -> Vec<Vec3> {
    let samples = gbuffer.samples().len();
    let (Openings::Bent(directions) | Openings::Traced(directions)) = gathering.openings;
    assert_eq!([gathering.visibility.len(), directions.len()], [samples; 2], "one a sample");
    let eye_world = camera.eye_world();
    let axis_world = camera.world_from_view.transform_vector3(Vec3::Z).normalize_or_zero();
    let shade_one = |i: usize| -> Option<Vec3> {
        let surface = gbuffer.surface(scene, pose, i)?;
        let to_viewer_world = match camera.projection {
            Projection::Perspective { .. } => (eye_world - surface.position_world).normalize_or_zero(),
            Projection::Orthographic { .. } => axis_world,
        };
        let diffuse = diffuse(&params.ambient, gathering, &surface, i);
        let material = scene.materials.get(surface.material as usize).filter(|m| !m.unlit)?;
        let base_color = texture::base_color(scene, material, &surface.uv, surface.color).truncate();
        let reflectance = Reflectance::of(scene, material, &surface.uv, base_color, params.specular);
        let normal = surface.normal_shading_world;
        Some(reflected_ambient(&reflectance, &params.ambient, diffuse, normal, to_viewer_world))
    };
    let samples = (0..samples).into_par_iter().with_min_len(1024);
    samples.map(|i| shade_one(i).unwrap_or(Vec3::ZERO)).collect()
}

/// Length of the mean of open directions of which so much is open, by cosine: 2/3 of a whole hemisphere, 1 of a narrow opening. In between
/// that depends on the opening's form, from which this is nowhere farther than 0.15: a wall leaves 0.72, 0.79 and 0.84 for 0.85, 0.5 and 0.15, a round hole
/// 0.74, 0.86 and 0.96.
fn mean_length(visibility: f32) -> f32 {
    1.0 - visibility / 3.0
}

/// Radiance that the diffuse part of a sample gathers, as if all were open: composing multiplies it by visibility.
fn diffuse(ambient: &Ambient, gathering: Gathering<'_>, surface: &Surface, sample: usize) -> Vec3 {
    let visibility = gathering.visibility[sample];
    let mean = match gathering.openings {
        Openings::Bent(bent) => bent[sample] * mean_length(visibility),
        // Where nothing is open it does not matter.
        Openings::Traced(open) => open[sample] / visibility.max(f32::MIN_POSITIVE),
    };
    if mean == Vec3::ZERO {
        return ambient.radiance(surface.normal_shading_world);
    }
    let turn = Quat::from_rotation_arc(surface.normal_world, surface.normal_shading_world);
    ambient.gathered(turn * mean)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gbuffer::rasterize;
    use crate::shade::{render_shadow_maps, shade};
    use crate::testing::{Stage, matte, sphere, turned};

    const TWO_COLOURS: Ambient =
        Ambient::Hemisphere { sky: Vec3::new(0.9, 0.8, 0.7), ground: Vec3::new(0.1, 0.3, 0.2) };

    /// All samples of a glossy ball, with their own normals and what is gathered about them.
    fn ball() -> (Stage, PosedCamera, GBuffer, ShadeParams, Vec<Vec3>) {
        let mut stage = Stage::new();
        let mut material = matte(Vec3::new(0.5, 0.9, 0.7));
        material.roughness_factor = 0.4;
        let material = stage.add_material(material);
        stage.add(sphere(12, 20), material, turned(0.4, Vec3::ZERO));
        let camera = PosedCamera::look_at(Vec3::new(1.0, 2.0, 3.0), Vec3::ZERO, 0.6);
        let gbuffer = rasterize(&stage.scene, &stage.pose, &camera, 40, 40, 1).unwrap();
        let params = ShadeParams { ambient: TWO_COLOURS, ..ShadeParams::default() };
        let normals = gbuffer.map_surfaces(&stage.scene, &stage.pose, |_, surface| {
            surface.map_or(Vec3::ZERO, |s| s.normal_world)
        });
        (stage, camera, gbuffer, params, normals)
    }

    #[test]
    fn where_all_is_open_it_is_the_light_about_the_shading_normal() {
        let (Stage { scene, pose }, camera, gbuffer, params, normals) = ball();
        let maps = render_shadow_maps(&scene, &pose, &params);
        let plain = shade(&scene, &pose, &camera, &gbuffer, &maps, &params).ambient;
        let open_world: Vec<Vec3> = normals.iter().map(|normal| *normal * (2.0 / 3.0)).collect();
        let visibility = vec![1.0; normals.len()];
        let nothing = vec![Vec3::ZERO; normals.len()];
        let gather = |openings| {
            let gathering = Gathering { visibility: &visibility, openings };
            shade_gathered(&scene, &pose, &camera, &gbuffer, &params, gathering)
        };
        assert_eq!(gather(Openings::Bent(&nothing)), plain, "no bent normals");
        for gathered in [gather(Openings::Bent(&normals)), gather(Openings::Traced(&open_world))] {
            assert!(gathered.iter().zip(&plain).all(|(a, b)| a.distance(*b) < 1e-5));
        }
        // Towards the sky it is brighter than the ball's sides are.
        let up: Vec<Vec3> = normals.iter().map(|n| if *n == Vec3::ZERO { *n } else { Vec3::Y }).collect();
        let lifted = gather(Openings::Bent(&up));
        assert!(lifted.iter().map(|c| c.x).sum::<f32>() > 1.1 * plain.iter().map(|c| c.x).sum::<f32>());
    }

    /// A wall over a floor, or a floor beside a wall: half of the directions is open, and their mean by cosine is (2/3 along the normal,
    /// 4 / (3 π) along the other one), 0.79 long.
    #[test]
    fn what_is_gathered_has_its_closed_form_and_is_near_it_about_the_bent_normal() {
        let across = 4.0 / (3.0 * std::f32::consts::PI);
        for (mean, plain) in
            [(Vec3::new(2.0 / 3.0, across, 0.0), 0.5), (Vec3::new(across, 2.0 / 3.0, 0.0), 0.9)]
        {
            // By summing directions: cosine density about the normal, open where the other component is above 0.
            let (mut sum, count) = (0.0f64, 200);
            for i in 0..count {
                for j in 0..count {
                    let u = (f64::from(i) + 0.5) / f64::from(count);
                    let turn = (f64::from(j) + 0.5) / f64::from(count) * std::f64::consts::PI;
                    let (along, aside) = ((1.0 - u).sqrt(), u.sqrt() * libm::sin(turn));
                    let y = if plain == 0.5 { aside } else { along };
                    sum += 0.5 * (0.9 + 0.1) + 0.75 * (0.9 - 0.1) * y;
                }
            }
            let exact = (sum / f64::from(count * count)) as f32;
            let found = TWO_COLOURS.gathered(mean).x;
            assert!((found - exact).abs() < 1e-3, "{found}, {exact}");
            let about_bent = TWO_COLOURS.gathered(mean.normalize() * mean_length(0.5)).x;
            assert!((about_bent - exact).abs() < 0.04, "{about_bent}, {exact}, plain {plain}");
        }
        let constant = Ambient::Constant(Vec3::new(0.2, 0.4, 0.6));
        assert_eq!(constant.gathered(Vec3::Y), Vec3::new(0.2, 0.4, 0.6));
    }
}
