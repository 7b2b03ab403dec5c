//! What an estimator sees at a sample of the picture: one surface, and what is known of those behind it.

use glam::Vec3;

use super::map::StochasticMap;
use crate::RenderError;
use crate::gbuffer::{Layers, Screen};

/// What is known of surfaces behind the first ones.
#[derive(Clone, Copy, Debug, Default)]
pub enum Hidden<'a> {
    /// Nothing: a depth buffer's usual single layer.
    #[default]
    Nothing,
    /// Some of them, chosen at random.
    Stochastic(&'a StochasticMap),
    /// All: depth peeling's, the limit of what a picture can tell.
    Peeled(&'a Layers),
}

/// At which samples of the picture an estimator looks at hidden surfaces, too.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Looks {
    /// Everywhere.
    Everywhere,
    /// Where the first surface is too far away to count, and, for HBAO, over the horizon (\[Vermeer2021\] sec. 3.3 and Alg. 2).
    WhereFirstIsFar,
    /// Where the first surface stands over the plane of the centre (for HBAO, over the horizon): what lies behind one that does not is lower still.
    #[default]
    WhereFirstRises,
}

/// What an estimator makes of hidden surfaces.
#[derive(Clone, Copy, Debug)]
pub struct Lookup<'a> {
    /// Which there are; default none.
    pub hidden: Hidden<'a>,
    /// Where they are looked at. SSAO looks where the first surface does not block, whatever this is: elsewhere they change nothing.
    pub looks: Looks,
    /// What occlusion by hidden surfaces is multiplied by, 0 … 16; default 1. Sec. 4 doubles it, for samples that miss occluders.
    pub compensation: f32,
}

impl Default for Lookup<'_> {
    fn default() -> Self {
        Lookup { hidden: Hidden::Nothing, looks: Looks::default(), compensation: 1.0 }
    }
}

impl<'a> Lookup<'a> {
    /// A stochastic map's surfaces.
    pub fn stochastic(map: &'a StochasticMap) -> Lookup<'a> {
        Lookup { hidden: Hidden::Stochastic(map), ..Lookup::default() }
    }

    /// The same as sec. 3.3 looks at them.
    pub fn paper(map: &'a StochasticMap) -> Lookup<'a> {
        Lookup { looks: Looks::WhereFirstIsFar, ..Lookup::stochastic(map) }
    }

    /// All surfaces at every step: the reference.
    pub fn peeled(layers: &'a Layers) -> Lookup<'a> {
        Lookup { hidden: Hidden::Peeled(layers), looks: Looks::Everywhere, ..Lookup::default() }
    }

    /// Whether it belongs to a picture, and its numbers are in range.
    ///
    /// # Errors
    /// Says what is not.
    pub(crate) fn check(&self, screen: &Screen) -> Result<(), RenderError> {
        if !(0.0..=16.0).contains(&self.compensation) {
            let found = self.compensation.into();
            return Err(RenderError::Parameter { name: "sdao: compensation", found, range: "0 to 16" });
        }
        let own = [screen.columns(), screen.rows()];
        let [columns, rows] = match self.hidden {
            Hidden::Nothing => own,
            Hidden::Stochastic(map) => [map.columns(), map.rows()],
            Hidden::Peeled(layers) => [layers.columns(), layers.rows()],
        };
        RenderError::check_length("a row of hidden surfaces", columns as usize, own[0] as usize)?;
        RenderError::check_length("a column of hidden surfaces", rows as usize, own[1] as usize)
    }

    /// Whether nothing hidden is known.
    pub(crate) fn is_empty(&self) -> bool {
        matches!(self.hidden, Hidden::Nothing)
    }

    /// Places of the known hidden surfaces under a sample, in view space; the first surface's may be among them.
    pub(crate) fn places(
        &self,
        screen: &Screen,
        [column, row]: [usize; 2],
    ) -> impl Iterator<Item = Vec3> + use<'a> {
        let index = row * screen.columns() as usize + column;
        let distances: &'a [f32] = match self.hidden {
            Hidden::Nothing => &[],
            Hidden::Stochastic(map) => map.distances_m(index),
            Hidden::Peeled(layers) => layers.distances_m(index),
        };
        let kept = distances.iter().copied().filter(|distance| distance.is_finite());
        let [x, y] = screen.centre([column, row]);
        let place = screen.places_view(x, y);
        kept.map(place)
    }
}
