//! What is under a place of a picture, for who wants to take hold of it. On the processor, without the light.

use dapple_render::gbuffer::surface_at;
use dapple_scene::glam::Vec3;
use dapple_scene::{Edits, PosedCamera, Scene};

/// What is seen at a place of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Picked {
    /// Index into [`Scene::instances`].
    pub instance: u32,
    /// Index into [`Scene::nodes`]: the instance's node, which [`dapple_scene::Edit::Place`] moves (a skinned instance stands where
    /// its joints do, whatever node it hangs from).
    pub node: u32,
    /// The place on its surface, metres.
    pub position_world: Vec3,
}

/// What `camera` sees of an edited scene at `scene_time_s` (seconds) at a place of a picture of `size` pixels, `at` in pixels from its
/// top left corner; transparent surfaces are there where their alpha is at least a half. `None` where there is nothing, and where no
/// picture can be drawn. Takes some milliseconds: it looks at every vertex.
pub fn pick(
    scene: &Scene,
    edits: &Edits,
    camera: &PosedCamera,
    size: (u32, u32),
    at: (f32, f32),
    scene_time_s: f64,
) -> Option<Picked> {
    let pose = scene.pose_edited(scene_time_s, edits);
    let surface = surface_at(scene, &pose, camera, size, at).ok()??;
    let node = scene.instances[surface.instance as usize].node;
    Some(Picked { instance: surface.instance, node, position_world: surface.position_world })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may panic")]
mod tests {
    use dapple_render::gbuffer::rasterize;
    use dapple_scene::{Edit, NoFiles, builtin};

    use super::*;

    /// At every sample what is drawn there, be it moved, bent, edited or gone.
    #[test]
    fn what_is_picked_is_what_is_drawn() {
        let scene = dapple_scene::load("lab.glb", &builtin::glb("lab", 0.05).unwrap(), &NoFiles).unwrap();
        let time_s = 2.3;
        const SIZE: (u32, u32) = (24, 14);
        let camera = scene.camera_paths()[0].camera(&scene, &scene.pose(time_s));
        let mut edits = Edits::new(&scene);
        let (mut bent, mut rigid) = (0, 0);
        for round in 0..3 {
            let pose = scene.pose_edited(time_s, &edits);
            let gbuffer = rasterize(&scene, &pose, &camera, SIZE.0, SIZE.1, 1).unwrap();
            let mut last = None;
            for i in 0..gbuffer.samples().len() {
                let [x, y] = gbuffer.sample_position_px(i);
                let picked = pick(&scene, &edits, &camera, SIZE, (x, y), time_s);
                let drawn = gbuffer.surface(&scene, &pose, i);
                assert_eq!(
                    picked.map(|p| p.instance),
                    drawn.map(|d| d.instance),
                    "({x}, {y}), round {round}"
                );
                let (Some(picked), Some(drawn)) = (picked, drawn) else { continue };
                let away_m = picked.position_world.distance(camera.eye_world());
                let error_m = picked.position_world.distance(drawn.position_world);
                assert!(error_m < 1e-3 * away_m, "{error_m} m at ({x}, {y})");
                assert_eq!(scene.instances[picked.instance as usize].node, picked.node);
                let bends = scene.is_deformable(picked.instance as usize);
                (bent, rigid) = (bent + u32::from(bends), rigid + u32::from(!bends));
                last = Some(picked);
            }
            // What is in front goes, and something else comes in its place.
            let gone = last.unwrap().instance;
            edits.apply(&scene, &Edit::Remove { instance: gone }).unwrap();
            let other = (0..scene.instances.len()).find(|&i| i as u32 != gone && !scene.is_deformable(i));
            let node = scene.instances[other.unwrap()].node;
            if let Some(mut placement) = scene.placement(node, time_s, &edits) {
                placement.translation = (camera.eye_world()
                    + camera.world_from_view.transform_vector3(Vec3::NEG_Z) * 3.0)
                    .to_array();
                edits.apply(&scene, &Edit::Place { node, placement }).unwrap();
            }
        }
        assert!(bent > 0 && rigid > 100, "{bent} bent, {rigid} rigid");
        for at in [(-0.1, 3.0), (3.0, 14.1), (f32::NAN, 3.0)] {
            assert_eq!(pick(&scene, &edits, &camera, SIZE, at, time_s), None);
        }
        assert_eq!(pick(&scene, &edits, &camera, (0, 5), (0.0, 0.0), time_s), None);
    }
}
