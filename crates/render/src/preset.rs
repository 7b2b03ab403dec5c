//! Named amounts of work for the screen-space methods: the same names and numbers on a processor and on a graphics card.

use std::str::FromStr;

use crate::alchemy::AlchemyParams;
use crate::gtao::GtaoParams;
use crate::hbao::HbaoParams;
use crate::sao::SaoParams;
use crate::ssao::SsaoParams;

/// How much work a method does. Each README has the numbers; radius, strength and biases are not touched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Preset {
    /// About half of the places, at half resolution.
    Low,
    /// The method's own places, at half resolution.
    Medium,
    /// The defaults of each method's parameters.
    #[default]
    High,
    /// About twice the places.
    Ultra,
}

/// Parameters, and at which resolution they are meant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chosen<P> {
    /// Of the method.
    pub params: P,
    /// Whether to estimate at a quarter of the samples ([`crate::upsample`]).
    pub half_resolution: bool,
}

impl Preset {
    /// All, the cheapest first.
    pub const ALL: [Preset; 4] = [Preset::Low, Preset::Medium, Preset::High, Preset::Ultra];

    /// As commands name it.
    pub fn name(self) -> &'static str {
        match self {
            Preset::Low => "low",
            Preset::Medium => "medium",
            Preset::High => "high",
            Preset::Ultra => "ultra",
        }
    }

    /// The one of four that belongs to this.
    fn of<T>(self, [low, medium, high, ultra]: [T; 4]) -> T {
        match self {
            Preset::Low => low,
            Preset::Medium => medium,
            Preset::High => high,
            Preset::Ultra => ultra,
        }
    }

    fn chosen<P>(self, params: P) -> Chosen<P> {
        Chosen { params, half_resolution: matches!(self, Preset::Low | Preset::Medium) }
    }

    /// Of SSAO.
    pub fn ssao(self) -> Chosen<SsaoParams> {
        let (samples, blur_width) = self.of([(8, 3), (16, 3), (16, 5), (32, 5)]);
        self.chosen(SsaoParams { samples, blur_width, ..SsaoParams::default() })
    }

    /// Of AlchemyAO.
    pub fn alchemy(self) -> Chosen<AlchemyParams> {
        // As many turns as make neighbours on the spiral lie apart.
        let (samples, turns, blur_taps) = self.of([(6, 5, 3), (12, 7, 3), (12, 7, 6), (24, 7, 6)]);
        self.chosen(AlchemyParams { samples, turns, blur_taps, ..AlchemyParams::default() })
    }

    /// Of SAO.
    pub fn sao(self) -> Chosen<SaoParams> {
        let (samples, turns) = self.of([(6, 5), (9, 7), (9, 7), (18, 7)]);
        let (blur_taps, blur_stride) = self.of([(2, 2), (3, 2), (3, 3), (3, 3)]);
        // Neighbours of a half lie twice as far apart in depth, too.
        let sharpness = self.of([1024.0, 1024.0, 2048.0, 2048.0]);
        self.chosen(SaoParams { samples, turns, blur_taps, blur_stride, sharpness, ..SaoParams::default() })
    }

    /// Of HBAO.
    pub fn hbao(self) -> Chosen<HbaoParams> {
        self.horizons(HbaoParams::hbao())
    }

    /// Of HBAO+.
    pub fn hbao_plus(self) -> Chosen<HbaoParams> {
        self.horizons(HbaoParams::hbao_plus())
    }

    fn horizons(self, params: HbaoParams) -> Chosen<HbaoParams> {
        let (directions, steps, blur_taps) = self.of([(4, 4, 2), (8, 4, 2), (8, 4, 3), (12, 6, 3)]);
        self.chosen(HbaoParams { directions, steps, blur_taps, ..params })
    }

    /// Of GTAO.
    pub fn gtao(self) -> Chosen<GtaoParams> {
        let (slices, steps, blur_taps) = self.of([(2, 4, 2), (3, 6, 2), (3, 6, 3), (5, 8, 3)]);
        self.chosen(GtaoParams { slices, steps, blur_taps, ..GtaoParams::default() })
    }
}

impl std::fmt::Display for Preset {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// No preset has this name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("write low, medium, high or ultra")]
pub struct UnknownPreset;

impl FromStr for Preset {
    type Err = UnknownPreset;

    fn from_str(name: &str) -> Result<Preset, UnknownPreset> {
        Preset::ALL.into_iter().find(|preset| preset.name() == name).ok_or(UnknownPreset)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn high_is_the_defaults_and_names_come_back() {
        assert_eq!(Preset::default(), Preset::High);
        let high = Preset::High;
        assert_eq!(high.ssao().params, SsaoParams::default());
        assert_eq!(high.alchemy().params, AlchemyParams::default());
        assert_eq!(high.sao().params, SaoParams::default());
        assert_eq!(high.hbao().params, HbaoParams::hbao());
        assert_eq!(high.hbao_plus().params, HbaoParams::hbao_plus());
        assert_eq!(high.gtao().params, GtaoParams::default());
        for preset in Preset::ALL {
            assert_eq!(preset.name().parse(), Ok(preset));
        }
        assert_eq!("High".parse::<Preset>(), Err(UnknownPreset));
    }

    /// Places that are looked at, times the part of the samples that look.
    #[test]
    fn more_is_more_work_and_all_are_in_range() {
        let work = |places: u32, half: bool| f64::from(places) * if half { 0.25 } else { 1.0 };
        for pair in Preset::ALL.windows(2) {
            let all = |preset: Preset| {
                let (s, a, o) = (preset.ssao(), preset.alchemy(), preset.sao());
                let (h, p, g) = (preset.hbao(), preset.hbao_plus(), preset.gtao());
                s.params.check().unwrap();
                a.params.check().unwrap();
                o.params.check().unwrap();
                h.params.check().unwrap();
                p.params.check().unwrap();
                g.params.check().unwrap();
                [
                    work(s.params.samples, s.half_resolution),
                    work(a.params.samples, a.half_resolution),
                    work(o.params.samples, o.half_resolution),
                    work(h.params.directions * h.params.steps, h.half_resolution),
                    work(p.params.directions * p.params.steps, p.half_resolution),
                    work(g.params.slices * g.params.steps, g.half_resolution),
                ]
            };
            let (less, more) = (all(pair[0]), all(pair[1]));
            assert!(less.iter().zip(&more).all(|(a, b)| a < b), "{less:?}, {more:?}");
        }
    }
}
