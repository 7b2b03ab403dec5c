//! Surfaces that are seen from both sides have texels for both.

use super::Site;

/// Adds to the sites of charts of `texel_count` texels those of the back: the same places with the normal turned round, whose texels
/// follow after all of the front's.
pub fn add_back_sites(sites: &mut Vec<Site>, texel_count: u32) {
    let backs: Vec<Site> = sites
        .iter()
        .map(|site| Site { texel: site.texel + texel_count, normal_rest: -site.normal_rest, ..*site })
        .collect();
    sites.extend(backs);
}
