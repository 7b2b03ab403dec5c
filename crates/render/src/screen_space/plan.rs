//! Which passes a method has, one after the other.

use dapple_gpu::{join, wgpu};

use super::method::{Layered, ScreenMethod, StochasticParams};
use super::uniforms::*;
use crate::alchemy::AlchemyParams;
use crate::bilateral::Bilateral;
use crate::forward::{GeometryTarget, HIDDEN_SAMPLES};
use crate::gtao::GtaoParams;
use crate::hbao::{HbaoParams, Horizon};
use crate::obscurance::Obscurance;
use crate::sao::{MipFilter, SaoParams};
use crate::sdao::Looks;
use crate::ssao::SsaoParams;

pub(super) const SCREEN_WGSL: &str = include_str!("wgsl/screen.wgsl");
const NOISE_WGSL: &str = include_str!("wgsl/noise.wgsl");
const HIDDEN_WGSL: &str = include_str!("../sdao/hidden.wgsl");
const BESIDE_WGSL: &str = include_str!("../sdao/beside.wgsl");
const HEIGHT_WGSL: &str = include_str!("../hbao/height.wgsl");
const PLACES_WGSL: &str = include_str!("../ssao/places.wgsl");
const OBSCURANCE_WGSL: &str = include_str!("../obscurance.wgsl");

/// One fragment stage over the whole picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum Shader {
    Distance,
    Halve,
    /// Four samples of the stochastic map.
    Resolve,
    Minify,
    Ssao,
    /// From the second camera.
    SsaoBeside,
    SsaoBlur,
    Alchemy,
    /// With the rotated grid, or another filter.
    Sao {
        rotated: bool,
    },
    Reconstruct,
    Hbao,
    /// From the second camera.
    HbaoBeside,
    Gtao,
    Bilateral,
    Place,
}

impl Shader {
    #[cfg(test)]
    pub(super) const ALL: [Shader; 16] = [
        Shader::Distance,
        Shader::Halve,
        Shader::Resolve,
        Shader::Minify,
        Shader::Ssao,
        Shader::SsaoBeside,
        Shader::SsaoBlur,
        Shader::Alchemy,
        Shader::Sao { rotated: true },
        Shader::Sao { rotated: false },
        Shader::Reconstruct,
        Shader::Hbao,
        Shader::HbaoBeside,
        Shader::Gtao,
        Shader::Bilateral,
        Shader::Place,
    ];

    /// For messages and timings.
    pub(super) fn label(self) -> &'static str {
        match self {
            Shader::Distance => "distances",
            Shader::Halve => "half",
            Shader::Resolve => "map",
            Shader::Minify => "levels",
            Shader::Ssao | Shader::Alchemy | Shader::Sao { .. } | Shader::Hbao | Shader::Gtao => "samples",
            Shader::SsaoBeside | Shader::HbaoBeside => "second samples",
            Shader::SsaoBlur | Shader::Bilateral | Shader::Reconstruct => "blur",
            Shader::Place => "place",
        }
    }

    /// The joined module and its fragment stage.
    pub(super) fn module(self) -> (String, &'static str) {
        let (files, entry): (&[&str], _) = match self {
            Shader::Distance => (&[include_str!("wgsl/distance.wgsl")], "distance_fragment"),
            Shader::Halve => (&[include_str!("wgsl/halve.wgsl")], "halve_fragment"),
            Shader::Minify => (&[include_str!("../sao/minify.wgsl")], "minify_fragment"),
            Shader::Resolve => (&[include_str!("../sdao/resolve.wgsl")], "resolve_fragment"),
            Shader::Ssao => (&[HIDDEN_WGSL, PLACES_WGSL, include_str!("../ssao/ssao.wgsl")], "ssao_fragment"),
            Shader::SsaoBeside => (
                &[HIDDEN_WGSL, PLACES_WGSL, BESIDE_WGSL, include_str!("../ssao/beside.wgsl")],
                "ssao_beside_fragment",
            ),
            Shader::SsaoBlur => (&[include_str!("../ssao/blur.wgsl")], "blur_fragment"),
            Shader::Alchemy => {
                (&[NOISE_WGSL, OBSCURANCE_WGSL, include_str!("../alchemy/alchemy.wgsl")], "alchemy_fragment")
            }
            Shader::Sao { .. } => {
                (&[NOISE_WGSL, OBSCURANCE_WGSL, include_str!("../sao/sample.wgsl")], "sao_fragment")
            }
            Shader::Reconstruct => (&[include_str!("../sao/reconstruct.wgsl")], "reconstruct_fragment"),
            Shader::Hbao => {
                (&[NOISE_WGSL, HIDDEN_WGSL, HEIGHT_WGSL, include_str!("../hbao/hbao.wgsl")], "hbao_fragment")
            }
            Shader::HbaoBeside => (
                &[NOISE_WGSL, HIDDEN_WGSL, HEIGHT_WGSL, BESIDE_WGSL, include_str!("../hbao/beside.wgsl")],
                "hbao_beside_fragment",
            ),
            Shader::Gtao => (&[NOISE_WGSL, include_str!("../gtao/gtao.wgsl")], "gtao_fragment"),
            Shader::Bilateral => (&[include_str!("wgsl/bilateral.wgsl")], "bilateral_fragment"),
            Shader::Place => (&[include_str!("wgsl/place.wgsl")], "place_fragment"),
        };
        let files: Vec<&str> = [SCREEN_WGSL].into_iter().chain(files.iter().copied()).collect();
        (join(&files), entry)
    }

    pub(super) fn constants(self) -> Vec<(&'static str, f64)> {
        match self {
            Shader::Sao { rotated } => vec![("USES_ROTATED_GRID", f64::from(u8::from(rotated)))],
            _ => Vec::new(),
        }
    }
}

/// A texture that passes read and write.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Image {
    /// Depths of the geometry.
    Depths,
    /// Normals of the geometry.
    Normals,
    /// Distances of all samples, where the method sees half of the resolution.
    FullDistances,
    /// A level of the distances that the method sees.
    Distances(u32),
    /// Normals at half resolution.
    HalfNormals,
    /// Four samples of the stochastic map, as depths.
    Map(u32),
    /// The same as distances.
    Hidden(u32),
    /// Depths of what the second camera sees.
    SideDepths,
    /// The same as distances.
    SideDistances,
    /// Four samples of the second camera's map, as depths.
    SideMap(u32),
    /// The same as distances.
    SideHidden(u32),
    /// One value a sample, in turns.
    Value(usize),
    /// Value and distance in bytes, in turns.
    Packed(usize),
    /// What the forward pass reads.
    Picture,
}

impl Image {
    pub(super) fn format(self) -> wgpu::TextureFormat {
        match self {
            Image::Depths | Image::SideDepths | Image::Map(_) | Image::SideMap(_) => {
                GeometryTarget::DEPTH_FORMAT
            }
            Image::Hidden(_) | Image::SideHidden(_) => wgpu::TextureFormat::Rgba32Float,
            Image::Distances(_) | Image::FullDistances | Image::SideDistances => {
                wgpu::TextureFormat::R32Float
            }
            Image::Normals | Image::HalfNormals => GeometryTarget::NORMAL_FORMAT,
            Image::Value(_) => wgpu::TextureFormat::R16Float,
            Image::Packed(_) => wgpu::TextureFormat::Rgba8Unorm,
            Image::Picture => wgpu::TextureFormat::Rg16Float,
        }
    }
}

/// The picture whose lens and samples a pass sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sight {
    Whole,
    /// A quarter of the samples.
    Half,
    /// The second camera's.
    Beside,
}

/// One pass: what it reads beside distances and normals, what it writes, and its parameters' bytes.
#[derive(Clone, Debug)]
pub(super) struct Pass {
    pub(super) shader: Shader,
    pub(super) reads: Option<Image>,
    pub(super) writes: Image,
    pub(super) params: Vec<u8>,
}

impl Pass {
    /// For messages and timings.
    pub(super) fn label(&self) -> &'static str {
        match self.writes {
            Image::SideDistances | Image::SideHidden(_) => "second map",
            _ => self.shader.label(),
        }
    }

    /// Of a method that sees half the resolution, or all of it.
    pub(super) fn sight(&self, half_resolution: bool) -> Sight {
        match (self.shader, self.writes) {
            (Shader::SsaoBeside | Shader::HbaoBeside, _) => Sight::Beside,
            (_, Image::SideDistances | Image::SideHidden(_)) => Sight::Beside,
            // The picture is placed among all samples.
            (_, Image::Picture) => Sight::Whole,
            _ if half_resolution => Sight::Half,
            _ => Sight::Whole,
        }
    }
}

fn pass<P: bytemuck::Pod>(shader: Shader, reads: Option<Image>, writes: Image, params: P) -> Pass {
    Pass { shader, reads, writes, params: bytemuck::bytes_of(&params).to_vec() }
}

/// How many columns and rows a level of the pyramid has.
pub(super) fn level_size((columns, rows): (u32, u32), level: u32) -> (u32, u32) {
    (columns.div_ceil(1 << level), rows.div_ceil(1 << level))
}

/// Levels above the first that a method reads from a picture of this size: fewer where one has a single texel.
pub(super) fn levels(method: &ScreenMethod, size: (u32, u32)) -> u32 {
    let ScreenMethod::Sao(params) = method else { return 0 };
    let longest = size.0.max(size.1).max(1);
    params.levels.min(longest.next_power_of_two().ilog2())
}

/// Of the texture of distances. The twin's levels are rounded up, a card's down: its first one is larger then, and passes write parts alone.
pub(super) fn padded_size(method: &ScreenMethod, seen: (u32, u32)) -> (u32, u32) {
    let whole = 1u32 << levels(method, seen);
    let padded = |side: u32| side.checked_next_multiple_of(whole).unwrap_or(u32::MAX);
    (padded(seen.0), padded(seen.1))
}

/// Textures of four samples that a method's stochastic map takes.
pub(super) fn hidden_layers(method: &ScreenMethod) -> u32 {
    match method {
        ScreenMethod::Stochastic(_, stochastic) => stochastic.map.samples.div_ceil(HIDDEN_SAMPLES),
        _ => 0,
    }
}

/// Columns and rows that a method sees of a picture.
pub(super) fn seen_size(size: (u32, u32), half_resolution: bool) -> (u32, u32) {
    if half_resolution { level_size(size, 1) } else { size }
}

/// All passes of a method over a picture of this size, the guard band included, whose samples on each side are `guard`; `side_size` is that of the second camera's
/// picture, if there is one.
pub(super) fn passes(
    method: &ScreenMethod,
    full_size: (u32, u32),
    guard: u32,
    half_resolution: bool,
    side_size: Option<(u32, u32)>,
) -> Vec<Pass> {
    let distances = if half_resolution { Image::FullDistances } else { Image::Distances(0) };
    let mut all = vec![pass(Shader::Distance, Some(Image::Depths), distances, [0.0f32; 4])];
    if half_resolution {
        let params = HalveUniform { full_size: [full_size.0 as i32, full_size.1 as i32], pad: [0.0; 2] };
        all.push(pass(Shader::Halve, Some(Image::FullDistances), Image::Distances(0), params));
        all.push(pass(Shader::Halve, Some(Image::Normals), Image::HalfNormals, params));
    }
    let size = seen_size(full_size, half_resolution);
    let last = match method {
        ScreenMethod::Ssao(params) => ssao(params, None, &mut all),
        ScreenMethod::Alchemy(params) => alchemy(params, &mut all),
        ScreenMethod::Sao(params) => sao(params, size, levels(method, size), &mut all),
        ScreenMethod::Hbao(params) => hbao(params, None, &mut all),
        ScreenMethod::Gtao(params) => gtao(params, &mut all),
        ScreenMethod::Stochastic(layered, stochastic) => {
            for layer in 0..hidden_layers(method) {
                let params = ResolveUniform {
                    full_size: [full_size.0 as i32, full_size.1 as i32],
                    is_half: u32::from(half_resolution),
                    pad: 0,
                };
                all.push(pass(Shader::Resolve, Some(Image::Map(layer)), Image::Hidden(layer), params));
            }
            if let Some(size) = side_size {
                beside(stochastic, size, &mut all);
            }
            match layered {
                Layered::Ssao(params) => ssao(params, Some(stochastic), &mut all),
                Layered::Hbao(params) => hbao(params, Some(stochastic), &mut all),
            }
        }
    };
    let is_half = u32::from(half_resolution);
    let params = PlaceUniform { guard: [guard as i32; 2], is_half, pad: 0.0 };
    all.push(pass(Shader::Place, Some(last), Image::Picture, params));
    all
}

/// What the second camera sees as distances. Where its map has the first surfaces among the others nothing else is drawn, and nothing is read: the background.
fn beside(stochastic: &StochasticParams, size: (u32, u32), all: &mut Vec<Pass>) {
    let depths = stochastic.map.is_first_left_out.then_some(Image::SideDepths);
    all.push(pass(Shader::Distance, depths, Image::SideDistances, [0.0f32; 4]));
    let params = ResolveUniform { full_size: [size.0 as i32, size.1 as i32], is_half: 0, pad: 0 };
    for layer in 0..stochastic.map.samples.div_ceil(HIDDEN_SAMPLES) {
        all.push(pass(Shader::Resolve, Some(Image::SideMap(layer)), Image::SideHidden(layer), params));
    }
}

/// The sampling pass of the first camera, and of the second one over what that has found, if there is one.
fn samples<P: bytemuck::Pod>(
    [first, second]: [Shader; 2],
    hidden: Option<&StochasticParams>,
    params: P,
    all: &mut Vec<Pass>,
) {
    if hidden.is_some_and(|hidden| hidden.second.is_some()) {
        all.push(pass(first, None, Image::Value(1), params));
        all.push(pass(second, Some(Image::Value(1)), Image::Value(0), params));
    } else {
        all.push(pass(first, None, Image::Value(0), params));
    }
}

const AXES: [[i32; 2]; 2] = [[1, 0], [0, 1]];

fn ssao(params: &SsaoParams, hidden: Option<&StochasticParams>, all: &mut Vec<Pass>) -> Image {
    let (offsets, turns) = crate::ssao::pattern(params);
    let mut uniform = SsaoUniform {
        radius_m: params.radius_m,
        samples: params.samples,
        height_m: params.bias * params.radius_m,
        hidden_layers: hidden.map_or(0, |hidden| hidden.map.samples.div_ceil(HIDDEN_SAMPLES)),
        compensation: hidden.map_or(1.0, |hidden| hidden.compensation),
        pad_a: 0.0,
        pad_b: [0.0; 2],
        offsets: [[0.0; 4]; 256],
        turns: [[0.0; 4]; 128],
    };
    for (out, offset) in uniform.offsets.iter_mut().zip(offsets) {
        *out = offset.extend(0.0).to_array();
    }
    for (out, pair) in uniform.turns.iter_mut().zip(turns.chunks_exact(2)) {
        *out = [pair[0].x, pair[0].y, pair[1].x, pair[1].y];
    }
    samples([Shader::Ssao, Shader::SsaoBeside], hidden, uniform, all);
    let middle = crate::ssao::middle_weight(params);
    for (which, axis) in AXES.into_iter().enumerate() {
        let blur = BlurUniform {
            axis,
            half_width: params.blur_width / 2,
            inverse_sigma: 1.0 / params.blur_sigma,
            middle,
            pad_a: 0.0,
            pad_b: [0.0; 2],
        };
        all.push(pass(Shader::SsaoBlur, Some(Image::Value(which)), Image::Value(1 - which), blur));
    }
    Image::Value(0)
}

fn obscurance(radius_m: f32, estimator: &Obscurance) -> ObscuranceUniform {
    ObscuranceUniform {
        radius_m,
        sigma_m: estimator.sigma_m,
        bias_m: estimator.bias_m,
        beta: estimator.beta,
        exponent: estimator.exponent,
        samples: estimator.samples,
        turns: estimator.turns,
        switch_log2: 0,
        top_level: 0,
        farthest_m: 0.0,
        pad: [0.0; 2],
    }
}

fn alchemy(params: &AlchemyParams, all: &mut Vec<Pass>) -> Image {
    let uniform = obscurance(params.radius_m, &params.estimator());
    all.push(pass(Shader::Alchemy, None, Image::Value(0), uniform));
    bilateral(params.radius_m, params.blur_taps, all)
}

fn sao(params: &SaoParams, size: (u32, u32), levels: u32, all: &mut Vec<Pass>) -> Image {
    for level in 1..=levels {
        let below = level_size(size, level - 1);
        let uniform = MinifyUniform {
            size: [below.0, below.1],
            filtering: match params.filter {
                MipFilter::RotatedGrid => 0,
                MipFilter::Mean => 1,
                MipFilter::HarmonicMean => 2,
                MipFilter::Farthest => 3,
                MipFilter::Nearest => 4,
            },
            pad: 0,
        };
        let (reads, writes) = (Image::Distances(level - 1), Image::Distances(level));
        all.push(pass(Shader::Minify, Some(reads), writes, uniform));
    }
    let uniform = ObscuranceUniform {
        switch_log2: params.switch_log2,
        top_level: levels,
        farthest_m: params.farthest_m,
        ..obscurance(params.radius_m, &params.estimator())
    };
    let shader = Shader::Sao { rotated: params.filter == MipFilter::RotatedGrid };
    all.push(pass(shader, None, Image::Packed(0), uniform));
    for (axis, writes) in AXES.into_iter().zip([Image::Packed(1), Image::Value(0)]) {
        let uniform = ReconstructUniform {
            axis,
            taps: params.blur_taps,
            stride: params.blur_stride,
            sharpness: params.sharpness,
            pad_a: 0.0,
            pad_b: [0.0; 2],
        };
        let reads = if axis == AXES[0] { Image::Packed(0) } else { Image::Packed(1) };
        all.push(pass(Shader::Reconstruct, Some(reads), writes, uniform));
    }
    Image::Value(0)
}

fn hbao(params: &HbaoParams, hidden: Option<&StochasticParams>, all: &mut Vec<Pass>) -> Image {
    let uniform = HbaoUniform {
        radius_m: params.radius_m,
        directions: params.directions,
        steps: params.steps,
        bias: params.bias_degrees.to_radians(),
        strength: params.strength,
        is_mean: u32::from(params.horizon == Horizon::Mean),
        hidden_layers: hidden.map_or(0, |hidden| hidden.map.samples.div_ceil(HIDDEN_SAMPLES)),
        looks: match hidden.map_or(Looks::default(), |hidden| hidden.looks) {
            Looks::Everywhere => 0,
            Looks::WhereFirstIsFar => 1,
            Looks::WhereFirstRises => 2,
        },
        compensation: hidden.map_or(1.0, |hidden| hidden.compensation),
        pad_a: 0.0,
        pad_b: [0.0; 2],
    };
    samples([Shader::Hbao, Shader::HbaoBeside], hidden, uniform, all);
    bilateral(params.radius_m, params.blur_taps, all)
}

fn gtao(params: &GtaoParams, all: &mut Vec<Pass>) -> Image {
    let uniform = GtaoUniform {
        radius_m: params.radius_m,
        slices: params.slices,
        steps: params.steps,
        thickness_m: params.thickness_of_radius * params.radius_m,
        bias: params.bias,
        pad_a: 0.0,
        pad_b: [0.0; 2],
    };
    all.push(pass(Shader::Gtao, None, Image::Value(0), uniform));
    bilateral(params.radius_m, params.blur_taps, all)
}

/// Smooths the first value through the second.
fn bilateral(radius_m: f32, taps: u32, all: &mut Vec<Pass>) -> Image {
    let blur = Bilateral::within(radius_m, taps);
    if taps == 0 {
        return Image::Value(0);
    }
    for (which, axis) in AXES.into_iter().enumerate() {
        let uniform = BilateralUniform {
            axis,
            taps: blur.taps,
            stride: blur.stride,
            tolerance_m: blur.tolerance_m,
            inverse_sigma: 1.0 / blur.sigma_taps() as f32,
            pad: [0.0; 2],
        };
        all.push(pass(Shader::Bilateral, Some(Image::Value(which)), Image::Value(1 - which), uniform));
    }
    Image::Value(0)
}
