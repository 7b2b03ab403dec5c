//! Spares: instances that are not there until somebody wants another of something.

use crate::{Instance, Node, Scene};

/// Most spares that can be added to a scene in one call.
pub const MAX_SPARES: u32 = 4096;

/// How many more there may be of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Spare {
    /// Index into [`Scene::instances`].
    pub instance: u32,
    /// How many, 0 … [`MAX_SPARES`] in all.
    pub count: u32,
}

/// Why no spares were added.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SpareError {
    /// There is no such instance.
    #[error("there is no instance {instance} to have spares of: the scene has {instances}, counted from 0")]
    NoInstance {
        /// What was asked for.
        instance: u32,
        /// How many there are.
        instances: usize,
    },
    /// The instance has a skin.
    #[error(
        "instance {instance} (\"{name}\") is skinned, and a spare would stand where its skeleton does; ask for spares of \
         rigid things only"
    )]
    Skinned {
        /// Index of the instance.
        instance: u32,
        /// Name of its node.
        name: String,
    },
    /// Too many of them.
    #[error("{spares} spares are more than {MAX_SPARES}; ask for fewer")]
    TooMany {
        /// How many were asked for.
        spares: u64,
    },
}

impl Scene {
    /// Adds instances that are not there at first ([`crate::Edits::new`] has them removed), each at a node of its own beside
    /// that of the instance it is like: same mesh, parent, place in the file and rest space, but no animation. Both ends must
    /// add the same: they are part of the scene's hash.
    ///
    /// # Errors
    /// An instance that does not exist, or is skinned; more than [`MAX_SPARES`] in all. Then nothing was added.
    pub fn add_spares(&mut self, spares: &[Spare]) -> Result<(), SpareError> {
        let instances = self.instances.len();
        for &Spare { instance, .. } in spares {
            let Some(model) = self.instances.get(instance as usize) else {
                return Err(SpareError::NoInstance { instance, instances });
            };
            if model.skin.is_some() {
                let name = self.nodes[model.node as usize].name.clone();
                return Err(SpareError::Skinned { instance, name });
            }
        }
        let count: u64 = spares.iter().map(|spare| u64::from(spare.count)).sum();
        if count > u64::from(MAX_SPARES) {
            return Err(SpareError::TooMany { spares: count });
        }
        for &Spare { instance, count } in spares {
            let model = self.instances[instance as usize].clone();
            let like = &self.nodes[model.node as usize];
            let (name, like) = (like.name.clone(), Node { camera: None, light: None, ..like.clone() });
            for number in 1..=count {
                let node = self.nodes.len() as u32;
                self.nodes.push(Node { name: format!("{name} (spare {number})"), ..like.clone() });
                self.instances.push(Instance { node, spare: true, ..model.clone() });
            }
        }
        Ok(())
    }
}
