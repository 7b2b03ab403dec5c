//! Which instances of a scene share their charts.

use std::collections::BTreeMap;

use glam::{Mat3, Vec3};

use super::set::ChartParams;

/// What the charts of an instance depend on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InstanceKey {
    /// Index of the mesh.
    pub mesh: u32,
    /// Rest space from mesh space.
    pub rest_from_mesh: Mat3,
    /// Edge of a texel in rest space, metres.
    pub texel_m: f32,
}

impl InstanceKey {
    /// The mesh's vertices at rest.
    pub fn positions_rest(&self, positions_mesh: &[Vec3]) -> Vec<Vec3> {
        positions_mesh.iter().map(|&p| self.rest_from_mesh * p).collect()
    }

    /// Parameters of its charts: its texel, and whether it is mirrored; the others as in `defaults`.
    pub fn params(&self, defaults: &ChartParams) -> ChartParams {
        let mirrored = self.rest_from_mesh.determinant() < 0.0;
        ChartParams { texel_m: self.texel_m, mirrored, ..*defaults }
    }

    fn bits(&self) -> [u32; 11] {
        let mut bits = [0; 11];
        let columns = self.rest_from_mesh.to_cols_array();
        for (to, from) in bits.iter_mut().zip(columns.iter().chain([&self.texel_m])) {
            *to = from.to_bits();
        }
        bits[10] = self.mesh;
        bits
    }
}

/// The chart sets of a scene: one for all instances whose mesh, rest space and texels are the same to the bit. They are
/// only named here; a caller makes them one at a time, in the order that suits it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneCharts {
    sets: Vec<InstanceKey>,
    set_of_instance: Vec<Option<u32>>,
}

impl SceneCharts {
    /// Finds the sets that the instances need. An instance that carries no light is `None`.
    pub fn plan(instances: impl IntoIterator<Item = Option<InstanceKey>>) -> SceneCharts {
        let mut plan = SceneCharts::default();
        let mut known = BTreeMap::new();
        for key in instances {
            let set = key.map(|key| {
                *known.entry(key.bits()).or_insert_with(|| {
                    plan.sets.push(key);
                    plan.sets.len() as u32 - 1
                })
            });
            plan.set_of_instance.push(set);
        }
        plan
    }

    /// The sets to make, in order of their first instance.
    pub fn sets(&self) -> &[InstanceKey] {
        &self.sets
    }

    /// The set of an instance, as an index into [`SceneCharts::sets`].
    pub fn set_index_of_instance(&self, instance: usize) -> Option<u32> {
        self.set_of_instance.get(instance).copied().flatten()
    }

    /// Indices into [`SceneCharts::sets`], largest first by a size the caller knows (triangles, say).
    pub fn largest_first(&self, size_of: impl Fn(&InstanceKey) -> u64) -> Vec<u32> {
        let mut order: Vec<u32> = (0..self.sets.len() as u32).collect();
        order.sort_by_key(|&i| std::cmp::Reverse(size_of(&self.sets[i as usize])));
        order
    }
}
