//! The paper's own structure on the card, made when it is first asked for and kept up to date from then on.

use dapple_gpu::{Gpu, wgpu};
use dapple_render::forward::{Forward, Lookup, LookupId};
use dapple_render::psao::hash::PointHash;
use dapple_render::psao::{Hat, TableError, TableTextures};
use dapple_store::points::{Change, PointLayout, PointStore};
use dapple_stream::ValueChange;

/// Place among the look-ups of a viewer's forward pass.
pub(super) const ID: LookupId = LookupId::added(0);

/// Nothing until it is needed.
#[derive(Default)]
pub(super) struct PaperLookup(Option<(PointHash, TableTextures)>);

impl PaperLookup {
    /// What the forward pass must be made with.
    pub(super) fn lookup(gpu: &Gpu) -> Lookup {
        PointHash::lookup(&gpu.device)
    }

    /// The points are other ones.
    pub(super) fn forget(&mut self) {
        self.0 = None;
    }

    pub(super) fn apply(&mut self, changes: &[ValueChange]) {
        if let Some((hash, _)) = &mut self.0 {
            let changes: Vec<Change> =
                changes.iter().map(|c| Change { point: c.point, visibility: c.new }).collect();
            hash.apply(&changes);
        }
    }

    /// Makes the tables (of no points, where there is no store) and writes what changed.
    pub(super) fn prepare(
        &mut self,
        gpu: &Gpu,
        forward: &mut Forward,
        store: Option<&PointStore>,
    ) -> Result<(), TableError> {
        if self.0.is_none() {
            let hash = match store {
                Some(store) => PointHash::new(store.layout(), store.visibility(), Hat::default())?,
                None => PointHash::new(&PointLayout::default(), &[], Hat::default())?,
            };
            let textures = hash.make_textures(&gpu.device)?;
            let [grids, buckets, cells] = textures.views();
            let entry = |binding, view| wgpu::BindGroupEntry {
                binding,
                resource: wgpu::BindingResource::TextureView(view),
            };
            let layout = PointHash::lookup(&gpu.device).layout;
            if let Some(layout) = &layout {
                let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                    label: Some("the paper's look-up"),
                    layout,
                    entries: &[entry(0, grids), entry(1, buckets), entry(2, cells)],
                });
                forward.bind_lookup(ID, group);
            }
            self.0 = Some((hash, textures));
        }
        if let Some((hash, textures)) = &mut self.0 {
            hash.upload(&gpu.queue, textures);
        }
        Ok(())
    }
}
