//! Which points may not count at which texels, because something solid stands between them.

use super::{MAX_CANDIDATES, MovingLeastSquares, Site};

/// What one end has found out by rays, for the other that has none.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Cuts {
    sets: Vec<SetCuts>,
}

/// The cuts of one instance.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SetCuts {
    /// Index into the scene's instances; strictly increasing from set to set.
    pub instance: u32,
    /// Sites of the instance.
    pub sites: u32,
    /// [`fingerprint`] of the sites and their candidates: the cuts fit no others.
    pub fingerprint: u32,
    /// Sites with something to cut, strictly increasing.
    pub cuts: Vec<SiteCut>,
}

/// What is cut at one site.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SiteCut {
    /// Index of the site in the list of its instance's sites.
    pub site: u32,
    /// Bit i: candidate i ([`Weigher::candidates`](super::Weigher::candidates)) is ruled out. Not 0.
    pub mask: u16,
}

/// Why cuts were refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("cuts: set {set}: {reason}")]
pub struct CutsError {
    /// Position in the list of sets.
    pub set: usize,
    /// What is wrong.
    pub reason: &'static str,
}

const _: () = assert!(MAX_CANDIDATES == u16::BITS as usize);

impl Cuts {
    /// Checks and joins sets.
    pub fn new(sets: Vec<SetCuts>) -> Result<Cuts, CutsError> {
        for (index, set) in sets.iter().enumerate() {
            let bad = |reason| Err(CutsError { set: index, reason });
            if index > 0 && sets[index - 1].instance >= set.instance {
                return bad("instances must increase");
            }
            if set.cuts.windows(2).any(|w| w[0].site >= w[1].site) {
                return bad("sites must increase");
            }
            if set.cuts.last().is_some_and(|last| last.site >= set.sites) {
                return bad("a site does not exist");
            }
            if set.cuts.iter().any(|c| c.mask == 0) {
                return bad("a mask cuts nothing");
            }
        }
        Ok(Cuts { sets })
    }

    /// These cuts without those of the instances `gone` (ascending), and with those of `added` in place of any that there are.
    pub fn with_sets(&self, gone: &[u32], added: &Cuts) -> Cuts {
        let has = |cuts: &Cuts, instance| cuts.sets.binary_search_by_key(&instance, |s| s.instance).is_ok();
        let stays = |set: &&SetCuts| gone.binary_search(&set.instance).is_err() && !has(added, set.instance);
        let mut sets: Vec<SetCuts> = self.sets.iter().filter(stays).chain(&added.sets).cloned().collect();
        sets.sort_unstable_by_key(|set| set.instance);
        Cuts { sets }
    }

    /// The cuts of some instances (ascending) alone.
    pub fn only(&self, instances: &[u32]) -> Cuts {
        let is_kept = |set: &&SetCuts| instances.binary_search(&set.instance).is_ok();
        Cuts { sets: self.sets.iter().filter(is_kept).cloned().collect() }
    }

    /// The sets, in order of instance.
    pub fn sets(&self) -> &[SetCuts] {
        &self.sets
    }

    /// The cuts of an instance, if there are any and they were made for these sites, with candidates by this kernel.
    pub fn for_sites(&self, instance: u32, sites: &[Site], kernel: &MovingLeastSquares) -> Option<&SetCuts> {
        let at = self.sets.binary_search_by_key(&instance, |set| set.instance).ok()?;
        let set = &self.sets[at];
        (set.sites as usize == sites.len() && set.fingerprint == fingerprint(sites, kernel)).then_some(set)
    }

    /// Sites with something to cut, of all sets.
    pub fn site_count(&self) -> usize {
        self.sets.iter().map(|set| set.cuts.len()).sum()
    }
}

impl SetCuts {
    /// What is ruled out at a site.
    pub fn mask(&self, site: u32) -> u16 {
        match self.cuts.binary_search_by_key(&site, |cut| cut.site) {
            Ok(at) => self.cuts[at].mask,
            Err(_) => 0,
        }
    }
}

/// A number that tells lists of sites and kernels apart, to the bit. Cuts made by one end fit the other's sites only if these
/// are the same; and masks count candidates, which are chosen by the kernel.
pub fn fingerprint(sites: &[Site], kernel: &MovingLeastSquares) -> u32 {
    // FNV-1a over words, folded at the end.
    let add = |hash: u64, word: u32| (hash ^ u64::from(word)).wrapping_mul(0x100_0000_01b3);
    let MovingLeastSquares { radius, normal_power, plane } = *kernel;
    let choice = [radius.to_bits(), normal_power, plane.to_bits(), MAX_CANDIDATES as u32];
    let mut hash = choice.into_iter().fold(0xcbf2_9ce4_8422_2325, add);
    for site in sites {
        let [x, y, z] = site.position_rest.to_array().map(f32::to_bits);
        let [nx, ny, nz] = site.normal_rest.to_array().map(f32::to_bits);
        hash = [site.texel, x, y, z, nx, ny, nz].into_iter().fold(hash, add);
    }
    (hash ^ hash >> 32) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn set(instance: u32, cuts: &[(u32, u16)]) -> SetCuts {
        let cuts = cuts.iter().map(|&(site, mask)| SiteCut { site, mask }).collect();
        SetCuts { instance, sites: 10, fingerprint: 7, cuts }
    }

    #[test]
    fn rules_are_checked() {
        assert!(Cuts::new(vec![set(1, &[(0, 1), (9, 0xffff)]), set(2, &[])]).is_ok());
        for (bad, reason) in [
            (vec![set(1, &[]), set(1, &[])], "instances must increase"),
            (vec![set(1, &[(3, 1), (3, 1)])], "sites must increase"),
            (vec![set(1, &[(10, 1)])], "a site does not exist"),
            (vec![set(1, &[(3, 0)])], "a mask cuts nothing"),
        ] {
            assert_eq!(Cuts::new(bad).unwrap_err().reason, reason);
        }
    }

    #[test]
    fn sets_come_and_go() {
        let held = Cuts::new(vec![set(1, &[(3, 1)]), set(2, &[(3, 1)]), set(5, &[(3, 1)])]).unwrap();
        let added = Cuts::new(vec![set(0, &[(4, 1)]), set(2, &[(9, 2)])]).unwrap();
        let now = held.with_sets(&[5, 7], &added);
        assert_eq!(now.sets(), [set(0, &[(4, 1)]), set(1, &[(3, 1)]), set(2, &[(9, 2)])]);
        assert_eq!(now.only(&[0, 2, 3]), added);
    }

    #[test]
    fn cuts_fit_only_the_sites_and_the_kernel_they_were_made_for() {
        let kernel = MovingLeastSquares::default();
        let sites = [1u32, 5, 6].map(|texel| Site {
            texel,
            position_rest: Vec3::new(texel as f32, 0.5, -2.0),
            normal_rest: Vec3::Y,
        });
        let made = SetCuts { sites: 3, fingerprint: fingerprint(&sites, &kernel), ..set(4, &[(1, 6)]) };
        let cuts = Cuts::new(vec![made]).unwrap();
        let found = cuts.for_sites(4, &sites, &kernel).unwrap();
        assert_eq!([0, 1, 2].map(|site| found.mask(site)), [0, 6, 0]);
        let fits = |instance, sites: &[Site]| cuts.for_sites(instance, sites, &kernel).is_some();
        assert!(!fits(3, &sites) && !fits(4, &sites[..2]));
        let mut moved = sites;
        moved[2].position_rest.x += 1e-6;
        assert!(!fits(4, &moved));
        for other in [
            MovingLeastSquares { radius: 2.5, ..kernel },
            MovingLeastSquares { normal_power: 8, ..kernel },
            MovingLeastSquares { plane: 512.0, ..kernel },
        ] {
            assert!(cuts.for_sites(4, &sites, &other).is_none(), "{other:?}");
        }
    }
}
