//! Which parts of the light a viewer needs: those with something in its view, or near it.

use std::sync::Arc;

use dapple_scene::glam::Vec3;
use dapple_scene::{Aabb, Edits, Pose, Scene};

use crate::{LookCamera, MAX_PARTS};

/// What the view is wider by on each side, radians: a camera that turns finds light there.
const WIDER: f32 = 0.26;

/// What lies this near counts as seen, metres: a camera that goes back sees it soon.
const NEAR_M: f32 = 1.0;

/// A part that is seen no more is kept for so long, microseconds: who looks about does not ask for it again and again.
const KEPT_US: u64 = 5_000_000;

/// Tells which parts have something in view.
pub(super) struct Sight {
    scene: Arc<Scene>,
    /// Boxes of meshes at rest, in mesh space, with room for what their morph targets do at weights of 1.
    boxes: Vec<Aabb>,
    /// The part of each instance, if it has one.
    part_of: Vec<Option<u8>>,
    /// When each part was seen last.
    seen_us: Vec<Option<u64>>,
}

impl Sight {
    /// Of parts that have these instances, as ranges. Numbers that the scene does not have are nothing, nor is what comes after as many as it has.
    pub(super) fn new(scene: &Arc<Scene>, parts: &[Vec<[u32; 2]>]) -> Sight {
        let boxes = scene.meshes.iter().map(|mesh| {
            let reach = mesh
                .morph_targets
                .iter()
                .map(|target| target.positions.iter().map(|offset| offset.length()).fold(0.0, f32::max));
            Aabb::from_points(mesh.positions.iter().copied()).inflated(reach.sum())
        });
        let count = scene.instances.len() as u32;
        let mut part_of = vec![None; count as usize];
        let numbered = (0..=u8::MAX).zip(parts);
        let ranges = numbered.flat_map(|(number, ranges)| ranges.iter().map(move |range| (number, range)));
        let all = ranges.flat_map(|(number, &[first, end])| {
            (first..end.min(count)).map(move |instance| (number, instance as usize))
        });
        for (number, instance) in all.take(part_of.len()) {
            part_of[instance] = Some(number);
        }
        let seen_us = vec![None; parts.len().min(MAX_PARTS)];
        Sight { scene: scene.clone(), boxes: boxes.collect(), part_of, seen_us }
    }

    /// The parts that are needed from now on, ascending, at least one: who takes no light does not hear how old it is.
    pub(super) fn parts(
        &mut self,
        camera: Option<&LookCamera>,
        time_s: f64,
        edits: &Edits,
        now_us: u64,
    ) -> Vec<u8> {
        if let Some(camera) = camera {
            self.see(camera, time_s, edits, now_us);
        }
        let kept = |seen_us: &Option<u64>| seen_us.is_some_and(|at| now_us.saturating_sub(at) <= KEPT_US);
        let numbered = || (0..=u8::MAX).zip(&self.seen_us);
        let parts: Vec<u8> = numbered().filter(|(_, seen)| kept(seen)).map(|(number, _)| number).collect();
        if !parts.is_empty() {
            return parts;
        }
        let last = numbered().max_by_key(|(number, seen)| (**seen, std::cmp::Reverse(*number)));
        last.map(|(number, _)| number).into_iter().collect()
    }

    fn see(&mut self, camera: &LookCamera, time_s: f64, edits: &Edits, now_us: u64) {
        let pose = self.scene.pose_undeformed_edited(time_s, edits);
        let cone = Cone::of(camera);
        for instance in 0..self.part_of.len() {
            let Some(part) = self.part_of[instance].map(usize::from) else { continue };
            if self.seen_us[part] != Some(now_us) && cone.may_see(&self.bounds_world(&pose, instance)) {
                self.seen_us[part] = Some(now_us);
            }
        }
    }

    /// A box that an instance is within, empty if it is not there. Visits no vertex.
    fn bounds_world(&self, pose: &Pose, instance: usize) -> Aabb {
        let posed = &pose.instances[instance];
        if !posed.is_there() {
            return Aabb::EMPTY;
        }
        let Some((mesh, skin)) = self.scene.instances.get(instance).map(|i| (i.mesh as usize, i.skin)) else {
            return Aabb::EMPTY;
        };
        match skin {
            None => self.boxes[mesh].transformed(&posed.world_from_mesh),
            // A vertex lies between the places that its joints bring it to.
            Some(skin) => {
                let joints = self.scene.world_from_bind(pose, skin as usize);
                joints.iter().fold(Aabb::EMPTY, |all, joint| all.union(self.boxes[mesh].transformed(joint)))
            }
        }
    }
}

/// What a camera sees, widened: the space before up to four planes through its eye.
struct Cone {
    eye: Vec3,
    /// Normals of the planes, to the inside.
    inward: Vec<Vec3>,
}

impl Cone {
    fn of(camera: &LookCamera) -> Cone {
        let axes = camera.posed().world_from_view.matrix3;
        let [right, up, back] = [axes.x_axis, axes.y_axis, axes.z_axis].map(Vec3::from);
        let half_y = 0.5 * camera.yfov;
        let half_x = (half_y.tan() * camera.aspect).atan();
        let mut inward = Vec::new();
        for (side, half) in [(right, half_x), (up, half_y)] {
            let half = half + WIDER;
            // From there on it sees more than a half space.
            if half < std::f32::consts::FRAC_PI_2 {
                let ahead = -back * half.sin();
                inward.extend([ahead + side * half.cos(), ahead - side * half.cos()]);
            }
        }
        Cone { eye: camera.eye.into(), inward }
    }

    /// False only where nothing of the box is seen, or near the eye.
    fn may_see(&self, bounds: &Aabb) -> bool {
        if bounds.is_empty() {
            return false;
        }
        let (center, half) = (bounds.center(), 0.5 * (bounds.max - bounds.min));
        let farthest = |normal: &Vec3| (center - self.eye).dot(*normal) + half.dot(normal.abs());
        self.inward.iter().all(|normal| farthest(normal) >= -NEAR_M)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dapple_scene::{Edit, NoFiles, Placement, builtin};

    fn camera(eye: [f32; 3], forward: [f32; 3]) -> LookCamera {
        LookCamera { eye, forward, up: [0.0, 1.0, 0.0], yfov: 1.0, aspect: 1.5 }
    }

    fn one_each(scene: &Scene) -> Vec<Vec<[u32; 2]>> {
        (0..scene.instances.len() as u32).map(|instance| vec![[instance, instance + 1]]).collect()
    }

    fn load(name: &str) -> Arc<Scene> {
        let glb = builtin::glb(name, 0.1).unwrap();
        Arc::new(dapple_scene::load("test.glb", &glb, &NoFiles).unwrap())
    }

    /// Every instance of which a vertex is in the picture must be in a part that is asked for.
    #[test]
    fn what_is_in_the_picture_is_asked_for() {
        let mut asked = (0, 0);
        for name in ["lab", "atrium", "station"] {
            let scene = load(name);
            let mut parts = one_each(&scene);
            parts.truncate(crate::MAX_PARTS);
            let edits = Edits::new(&scene);
            let bounds = scene.bounds_world(&scene.pose(0.0));
            for turn in 0..12 {
                let (angle, time_s) = (f64::from(turn) * 0.52, f64::from(turn) * 0.7);
                let forward = [angle.cos() as f32, -0.1, angle.sin() as f32];
                let camera = camera(bounds.center().to_array(), forward);
                let seen = Sight::new(&scene, &parts).parts(Some(&camera), time_s, &edits, 1);
                asked = (asked.0 + seen.len(), asked.1 + parts.len());
                let pose = scene.pose(time_s);
                let view = camera.posed().view_from_world();
                for instance in 0..parts.len() {
                    let world = pose.instances[instance].world_from_mesh;
                    let is_seen = scene.vertex_positions(&pose, instance).iter().any(|position| {
                        let at = view.transform_point3(world.transform_point3(*position));
                        let tan = (0.5 * camera.yfov).tan() * -at.z;
                        at.z < 0.0 && at.y.abs() < tan && at.x.abs() < tan * camera.aspect
                    });
                    assert!(
                        !is_seen || seen.contains(&(instance as u8)),
                        "{name}: {instance} at turn {turn}"
                    );
                }
            }
        }
        assert!(asked.1 > 0 && asked.0 * 4 < asked.1 * 3, "{asked:?}: all is asked for anyway");
    }

    #[test]
    fn parts_are_kept_for_a_while_and_follow_what_moves() {
        let scene = load("cornell");
        let mut sight = Sight::new(&scene, &one_each(&scene));
        let mut edits = Edits::new(&scene);
        let far = |x: f32| Placement {
            translation: [x, 0.0, 0.0],
            rotation: [0.0, 0.0, 0.0, 1.0],
            scale: [1.0; 3],
        };
        let node = scene.instances[1].node;
        edits.apply(&scene, &Edit::Place { node, placement: far(1e4) }).unwrap();
        let (there, away) =
            (camera([9.9e3, 0.0, 0.0], [1.0, 0.0, 0.0]), camera([9e3, 0.0, 0.0], [0.0, 1.0, 0.1]));
        assert_eq!(sight.parts(None, 0.0, &edits, 0), [0], "one in any case");
        assert_eq!(sight.parts(Some(&there), 0.0, &edits, 0), [1]);
        assert_eq!(sight.parts(Some(&away), 0.0, &edits, KEPT_US), [1]);
        let back = camera([0.0, 2.0, 10.0], [0.0, 0.0, -1.0]);
        let seen = sight.parts(Some(&back), 0.0, &edits, 2 * KEPT_US);
        assert!(!seen.contains(&1) && seen.len() > 1, "{seen:?}");
        assert_eq!(sight.parts(Some(&there), 0.0, &edits, 4 * KEPT_US), [1]);
        // What is gone is not seen, and there is nothing else: the last stays.
        edits.apply(&scene, &Edit::Remove { instance: 1 }).unwrap();
        assert_eq!(sight.parts(Some(&there), 0.0, &edits, 6 * KEPT_US), [1]);
        // What a host says of instances that there are not is nothing to fall over.
        let mut odd = Sight::new(&scene, &[vec![[5, 2], [1 << 30, u32::MAX]], vec![]]);
        assert_eq!(odd.parts(Some(&there), 0.0, &edits, 0), [0]);
        assert!(Sight::new(&scene, &[]).parts(Some(&there), 0.0, &edits, 0).is_empty());
    }
}
