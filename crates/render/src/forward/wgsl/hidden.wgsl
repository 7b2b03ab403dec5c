// The stochastic depth map ([Vermeer2021] Alg. 1): keeps a fragment in some of a pixel's samples, chosen at random. The twin is `sdao::picks`.

// Whether alpha below the material's cutoff is a hole.
override CUTS_HOLES: bool = false;

struct HiddenParams {
    // ⌊α S⌋, and what is left of α S, in 2⁻²⁴.
    whole: u32,
    part: u32,
    // α in 2⁻²⁴; whether each sample is chosen by itself.
    alpha: u32,
    is_independent: u32,
    seed: u32,
    // S, and the first of the samples that this pass has.
    samples: u32,
    first_sample: u32,
    // Whether what `first_depths` shows is left out.
    leaves_first_out: u32,
    // Of each size of sets the first in `subsets`.
    starts: array<vec4<u32>, 5>,
}

@group(3) @binding(0) var<uniform> hidden: HiddenParams;
@group(3) @binding(1) var first_depths: texture_2d<f32>;
// All sets of S samples by size, 256 in a row.
@group(3) @binding(2) var subsets: texture_2d<u32>;

// Of a depth what a card and the twin agree on.
const DEPTH_BITS_LEFT_OUT: u32 = 8u;
// Two drawings of one surface lie no farther apart than this part of its depth.
const SAME_DEPTH: f32 = 1e-6;

fn mixed(word: u32) -> u32 {
    var h = word;
    h = (h ^ (h >> 16u)) * 0x85ebca6bu;
    h = (h ^ (h >> 13u)) * 0xc2b2ae35u;
    return h ^ (h >> 16u);
}

fn fragment_bits(at: vec2<u32>, depth: f32, purpose: u32) -> u32 {
    var h = mixed(hidden.seed + 0x9e3779b9u);
    h = mixed((h ^ purpose) + 0x9e3779b9u);
    h = mixed((h ^ at.x) + 0x9e3779b9u);
    h = mixed((h ^ at.y) + 0x9e3779b9u);
    return mixed((h ^ (bitcast<u32>(depth) >> DEPTH_BITS_LEFT_OUT)) + 0x9e3779b9u);
}

fn start_of(size: u32) -> u32 {
    return hidden.starts[size >> 2u][size & 3u];
}

fn chosen_samples(at: vec2<u32>, depth: f32) -> u32 {
    if hidden.is_independent != 0u {
        var mask = 0u;
        for (var sample = 0u; sample < hidden.samples; sample++) {
            mask |= select(0u, 1u << sample, (fragment_bits(at, depth, 2u + sample) >> 8u) < hidden.alpha);
        }
        return mask;
    }
    let size = hidden.whole + select(0u, 1u, (fragment_bits(at, depth, 0u) >> 8u) < hidden.part);
    let start = start_of(size);
    let count = start_of(size + 1u) - start;
    // The upper word of a product, in words. There are less than 2^16 sets.
    let bits = fragment_bits(at, depth, 1u);
    let chosen = start + (((bits >> 16u) * count + (((bits & 0xffffu) * count) >> 16u)) >> 16u);
    return textureLoad(subsets, vec2(chosen & 255u, chosen >> 8u), 0).r;
}

struct Kept {
    // Of the pixel's middle, whichever samples it is kept in.
    @builtin(frag_depth) depth: f32,
    @builtin(sample_mask) samples: u32,
}

@fragment
fn fragment(v: Varyings) -> Kept {
    let base_texel = textureSample(base_color_texture, base_color_sampler, image_coordinates(material.base_color_use, v.uv));
    if CUTS_HOLES && material.base_color.a * v.color.a * base_texel.a < material.cutoff {
        discard;
    }
    let depth = v.clip.z;
    let at = vec2<u32>(v.clip.xy);
    if hidden.leaves_first_out != 0u && depth >= textureLoad(first_depths, at, 0).r * (1.0 - SAME_DEPTH) {
        discard;
    }
    let mask = (chosen_samples(at, depth) >> hidden.first_sample) & 15u;
    if mask == 0u {
        discard;
    }
    return Kept(depth, mask);
}
