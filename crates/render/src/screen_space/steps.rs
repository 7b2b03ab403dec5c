//! All that one method needs for pictures of one size: textures, and passes that are ready to be recorded.

use std::collections::BTreeMap;

use dapple_gpu::{Gpu, wgpu};

use super::bindings::{Kit, Resource, group};
use super::cameras::Cameras;
use super::passes::ScreenView;
use super::plan::{
    Image, Pass, Shader, Sight, hidden_layers, level_size, levels, padded_size, passes, seen_size,
};
use super::textures::{array_view, hidden_texture, map_view, texture};

/// A method's textures and passes.
#[derive(Debug)]
pub(super) struct Plan {
    /// What it was made for; its camera is the first's.
    view: ScreenView,
    pub(super) normals: wgpu::TextureView,
    pub(super) depths: wgpu::TextureView,
    /// Depths of the stochastic map, four samples each.
    pub(super) maps: Vec<wgpu::TextureView>,
    /// Depths of what the second camera sees, if that is drawn beside its map.
    pub(super) side_depths: Option<wgpu::TextureView>,
    /// Of the second camera's map.
    pub(super) side_maps: Vec<wgpu::TextureView>,
    pub(super) steps: Vec<Step>,
    pub(super) picture: wgpu::Texture,
    /// Distances of hidden surfaces, and of the second camera's.
    #[cfg(test)]
    pub(super) hidden: [wgpu::Texture; 2],
}

/// One pass.
#[derive(Debug)]
pub(super) struct Step {
    pub(super) label: &'static str,
    pub(super) pipeline: wgpu::RenderPipeline,
    pub(super) groups: [wgpu::BindGroup; 2],
    pub(super) target: wgpu::TextureView,
    /// Columns and rows that are written.
    pub(super) size: (u32, u32),
}

/// Distances of hidden surfaces: all layers, and a view of each.
struct HiddenTextures {
    #[cfg(test)]
    texture: wgpu::Texture,
    all: wgpu::TextureView,
    layers: Vec<wgpu::TextureView>,
}

impl HiddenTextures {
    fn new(gpu: &Gpu, size: Option<(u32, u32)>, layers: u32) -> HiddenTextures {
        let layers = if size.is_some() { layers } else { 0 };
        let texture = hidden_texture(gpu, size.filter(|_| layers > 0).unwrap_or((1, 1)), layers);
        let one = |layer| {
            texture.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(wgpu::TextureViewDimension::D2),
                base_array_layer: layer,
                array_layer_count: Some(1),
                ..Default::default()
            })
        };
        HiddenTextures {
            all: array_view(&texture),
            layers: (0..layers).map(one).collect(),
            #[cfg(test)]
            texture,
        }
    }
}

impl Plan {
    pub(super) fn serves(&self, view: &ScreenView) -> bool {
        ScreenView { camera: self.view.camera, ..*view } == self.view
    }

    pub(super) fn new(gpu: &Gpu, kit: &mut Kit, cameras: &Cameras, view: &ScreenView) -> Plan {
        let full = view.guarded();
        let seen = seen_size(full, view.half_resolution);
        let side_size = view.side_size();
        let level_count = levels(&view.method, seen) + 1;
        let distances =
            texture(gpu, Image::Distances(0).format(), padded_size(&view.method, seen), level_count);
        let picture = texture(gpu, Image::Picture.format(), view.size, 1);
        let size_of = |image| match image {
            Image::Picture => view.size,
            Image::Depths | Image::Normals | Image::FullDistances | Image::Map(_) => full,
            Image::Distances(level) => level_size(seen, level),
            Image::HalfNormals | Image::Value(_) | Image::Packed(_) | Image::Hidden(_) => seen,
            Image::SideDepths | Image::SideDistances | Image::SideMap(_) | Image::SideHidden(_) => {
                side_size.unwrap_or((1, 1))
            }
        };
        let passes = passes(&view.method, full, view.guard.pixels(), view.half_resolution, side_size);
        let mut views: BTreeMap<Image, wgpu::TextureView> = BTreeMap::new();
        views.insert(Image::Picture, picture.create_view(&Default::default()));
        for level in 0..level_count {
            let descriptor = wgpu::TextureViewDescriptor {
                base_mip_level: level,
                mip_level_count: Some(1),
                ..Default::default()
            };
            views.insert(Image::Distances(level), distances.create_view(&descriptor));
        }
        let layers = hidden_layers(&view.method);
        let hidden = HiddenTextures::new(gpu, Some(seen), layers);
        let side_hidden = HiddenTextures::new(gpu, side_size, layers);
        for (layer, target) in (0..).zip(&hidden.layers) {
            views.insert(Image::Hidden(layer), target.clone());
            views.insert(Image::Map(layer), map_view(gpu, full));
        }
        for (layer, target) in (0..).zip(&side_hidden.layers) {
            views.insert(Image::SideHidden(layer), target.clone());
            views.insert(Image::SideMap(layer), map_view(gpu, size_of(Image::SideMap(layer))));
        }
        let named = passes.iter().flat_map(|pass| pass.reads.into_iter().chain([pass.writes]));
        for image in named.chain([Image::Normals]) {
            let plain = || texture(gpu, image.format(), size_of(image), 1).create_view(&Default::default());
            views.entry(image).or_insert_with(plain);
        }
        let all_distances = distances.create_view(&Default::default());
        let mut steps = Vec::new();
        for pass in passes {
            let (label, sight) = (pass.label(), pass.sight(view.half_resolution));
            let Pass { shader, reads, writes, params } = pass;
            let (distances, normals) = match (shader, sight) {
                // What they write themselves cannot be read.
                (Shader::Distance | Shader::Minify | Shader::Halve | Shader::Resolve, _) => {
                    (&kit.blank, &kit.blank)
                }
                (_, Sight::Beside) => (&views[&Image::SideDistances], &kit.blank),
                (Shader::Place, _) if view.half_resolution => {
                    (&views[&Image::FullDistances], &views[&Image::Normals])
                }
                (_, Sight::Half) => (&all_distances, &views[&Image::HalfNormals]),
                (_, Sight::Whole) => (&all_distances, &views[&Image::Normals]),
            };
            let uniform = gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: params.len() as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            });
            gpu.queue.write_buffer(&uniform, 0, &params);
            let before = Resource::Texture(reads.map_or(&kit.blank, |image| &views[&image]));
            let own = [
                (0, Resource::Uniform(cameras.screen(sight))),
                (1, Resource::Texture(distances)),
                (2, Resource::Texture(normals)),
            ];
            let mut passed = vec![(0, Resource::Uniform(&uniform))];
            match shader {
                Shader::Resolve => passed.push((3, before)),
                Shader::Distance => passed.extend([(1, before), (4, Resource::Sampler(&kit.nearest))]),
                Shader::SsaoBeside | Shader::HbaoBeside => {
                    let normals = if view.half_resolution { Image::HalfNormals } else { Image::Normals };
                    passed.extend([
                        (1, before),
                        (2, Resource::Texture(&side_hidden.all)),
                        (5, Resource::Uniform(cameras.side())),
                        (6, Resource::Texture(&all_distances)),
                        (7, Resource::Texture(&views[&normals])),
                    ]);
                }
                Shader::Ssao | Shader::Hbao if layers > 0 => {
                    passed.extend([(1, before), (2, Resource::Texture(&hidden.all))]);
                }
                _ => passed.extend([(1, before), (2, Resource::Texture(&kit.nothing_hidden))]),
            }
            let groups = [
                group(&gpu.device, &kit.screen_layout, &own),
                group(&gpu.device, kit.pass_layout(shader), &passed),
            ];
            steps.push(Step {
                label,
                target: views[&writes].clone(),
                pipeline: kit.pipeline(gpu, shader, writes),
                groups,
                size: size_of(writes),
            });
        }
        let [normals, depths] = [Image::Normals, Image::Depths].map(|image| views[&image].clone());
        let in_order = |image: fn(u32) -> Image, of: &HiddenTextures| {
            (0..of.layers.len() as u32).map(|layer| views[&image(layer)].clone()).collect()
        };
        Plan {
            view: *view,
            normals,
            depths,
            maps: in_order(Image::Map, &hidden),
            side_depths: views.get(&Image::SideDepths).cloned(),
            side_maps: in_order(Image::SideMap, &side_hidden),
            steps,
            picture,
            #[cfg(test)]
            hidden: [hidden.texture, side_hidden.texture],
        }
    }
}
