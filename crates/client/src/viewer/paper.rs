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
pub(super) enum PaperLookup {
    #[default]
    Unmade,
    Made(Box<(PointHash, TableTextures)>),
    /// The points do not fit, and why.
    Failed(String),
}

impl PaperLookup {
    /// What the forward pass must be made with.
    pub(super) fn lookup(gpu: &Gpu) -> Lookup {
        PointHash::lookup(&gpu.device)
    }

    /// The points are other ones.
    pub(super) fn forget(&mut self) {
        *self = PaperLookup::Unmade;
    }

    pub(super) fn apply(&mut self, changes: &[ValueChange]) {
        if let PaperLookup::Made(made) = self {
            let changes: Vec<Change> =
                changes.iter().map(|c| Change { point: c.point, visibility: c.new }).collect();
            made.0.apply(&changes);
        }
    }

    /// Why it cannot show the points, if so: until there are others.
    pub(super) fn problem(&self) -> Option<&str> {
        match self {
            PaperLookup::Failed(problem) => Some(problem),
            _ => None,
        }
    }

    /// Makes the tables (of no points, where there is no store), unless that failed before, and writes what changed.
    pub(super) fn prepare(&mut self, gpu: &Gpu, forward: &mut Forward, store: Option<&PointStore>) {
        if matches!(self, PaperLookup::Unmade) {
            *self = match make(gpu, forward, store) {
                Ok(made) => PaperLookup::Made(Box::new(made)),
                Err(error) => PaperLookup::Failed(error.to_string()),
            };
        }
        if let PaperLookup::Made(made) = self {
            let (hash, textures) = &mut **made;
            hash.upload(&gpu.queue, textures);
        }
    }
}

fn make(
    gpu: &Gpu,
    forward: &mut Forward,
    store: Option<&PointStore>,
) -> Result<(PointHash, TableTextures), TableError> {
    let hash = match store {
        Some(store) => PointHash::new(store.layout(), store.visibility(), Hat::default())?,
        None => PointHash::new(&PointLayout::default(), &[], Hat::default())?,
    };
    let textures = hash.make_textures(&gpu.device)?;
    let [grids, buckets, cells] = textures.views();
    let entry =
        |binding, view| wgpu::BindGroupEntry { binding, resource: wgpu::BindingResource::TextureView(view) };
    if let Some(layout) = &PointHash::lookup(&gpu.device).layout {
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("the paper's look-up"),
            layout,
            entries: &[entry(0, grids), entry(1, buckets), entry(2, cells)],
        });
        forward.bind_lookup(ID, group);
    }
    Ok((hash, textures))
}
