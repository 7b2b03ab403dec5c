//! Studies: what a suite measures beside the pictures of its cases (`[[study]]`, docs/suites.md). One file a kind; each gives tables and plots.
//!
//! A kind is a [`Study`] and a line in [`KINDS`].

mod compensation;
mod guard_band;
mod hidden_layers;
mod layers;
mod light;
mod map_cost;
mod map_rules;
mod medians;
mod mip_filters;
mod multi_view;
mod passes;
mod pop_in;
mod precision;
mod presets;
mod radius;
#[cfg(test)]
mod tests;
mod traffic;
mod z_precision;

use std::cell::RefCell;

use anyhow::{Context, Result, bail};
use dapple_render::gbuffer::{GBuffer, GuardBand, Screen};
use dapple_render::image::Rgb8Image;
use dapple_scene::{Pose, PosedCamera};
use serde::de::DeserializeOwned;

use super::figures::psnr_of;
use super::results::{StudyAxis, StudyColumn, StudyLine, StudyPlot, StudyRow, StudyTable};
use super::stage::Stage;
use super::truth::Cache;
use crate::args::Method;
use crate::screen_space::{Layered, ScreenSpace, Sight, Stochastic};

/// A kind of study with its own settings.
pub(super) trait Study: std::fmt::Debug {
    /// What the report calls it.
    fn title(&self) -> &'static str;

    /// Whether it looks at a scene.
    fn has_scene(&self) -> bool {
        true
    }

    /// About how much work it is, in rays.
    fn work(&self, stage: Option<&Stage<'_>>) -> f64 {
        stage.map_or(1e7, |stage| stage.frame_times_s.len() as f64 * stage.samples() as f64 * 200.0)
    }

    /// Measures.
    fn run(&self, subject: &Subject<'_>) -> Result<Findings>;
}

/// Reads a kind's own settings out of a `[[study]]`, and leaves the rest.
type Reader = fn(&mut toml::Table) -> Result<Box<dyn Study>>;

/// Every kind by its name.
const KINDS: [(&str, Reader); 16] = [
    ("z-precision", |table| own::<z_precision::ZPrecision>(table, &["distances", "triangles"])),
    ("mip-filters", |table| own::<mip_filters::MipFilters>(table, &[])),
    ("radius", |table| own::<radius::Radius>(table, &["radii", "line-bytes"])),
    ("passes", |table| own::<passes::Passes>(table, &["sizes", "repeats"])),
    ("presets", |table| own::<presets::Presets>(table, &[])),
    ("guard-band", |table| own::<guard_band::GuardBands>(table, &["parts"])),
    ("layers", |table| own::<layers::LayersStudy>(table, &[])),
    ("map-cost", |table| own::<map_cost::MapCost>(table, &["repeats"])),
    ("map-rules", |table| own::<map_rules::MapRules>(table, &[])),
    ("compensation", |table| own::<compensation::Compensation>(table, &["factors", "samples"])),
    ("hidden-layers", |table| own::<hidden_layers::HiddenLayers>(table, &["plates"])),
    ("multi-view", |table| own::<multi_view::MultiView>(table, &["repeats"])),
    ("light-methods", |table| {
        own::<light::table::LightMethods>(table, &["steps", "truth-samples", "environment"])
    }),
    ("light-viewers", |table| {
        own::<light::viewers::LightViewers>(table, &["viewers", "steps", "truth-samples", "environment"])
    }),
    ("light-ablation", |table| {
        own::<light::ablation::LightAblation>(
            table,
            &["updates", "truth-samples", "sizes", "speeds", "environment"],
        )
    }),
    ("pop-in", |table| own::<pop_in::PopIn>(table, &["steps"])),
];

/// The study of a name, with its settings.
pub(super) fn read(kind: &str, table: &mut toml::Table) -> Result<Box<dyn Study>> {
    match KINDS.iter().find(|(name, _)| *name == kind) {
        Some((_, read)) => read(table),
        None => {
            let known: Vec<&str> = KINDS.iter().map(|(name, _)| *name).collect();
            bail!("there is no study of kind {kind}: known are {}", known.join(", "))
        }
    }
}

fn own<S: Study + DeserializeOwned + 'static>(
    table: &mut toml::Table,
    keys: &[&str],
) -> Result<Box<dyn Study>> {
    let taken: toml::Table =
        keys.iter().filter_map(|key| Some(((*key).to_owned(), table.remove(*key)?))).collect();
    let study = S::deserialize(taken)?;
    Ok(Box::new(study))
}

/// What a study gives.
#[derive(Debug, Default)]
pub(super) struct Findings {
    pub(super) notes: Vec<String>,
    pub(super) tables: Vec<StudyTable>,
    pub(super) plots: Vec<StudyPlot>,
}

/// What a study looks at.
pub(super) struct Subject<'a> {
    /// The scene along a path; none for a study without.
    pub(super) stage: Option<&'a Stage<'a>>,
    pub(super) cache: &'a Cache,
    /// Gets the part that is done.
    pub(super) progress: &'a (dyn Fn(f64) + Sync),
    /// Takes pictures that show what tables say.
    pub(super) shots: &'a RefCell<Vec<Shot>>,
}

/// A picture of a study.
pub(super) struct Shot {
    /// A few words.
    pub(super) title: String,
    pub(super) picture: Rgb8Image,
}

/// A moment of the path, without its picture.
pub(super) struct Moment {
    pub(super) pose: Pose,
    pub(super) camera: PosedCamera,
}

impl<'a> Subject<'a> {
    pub(super) fn stage(&self) -> Result<&'a Stage<'a>> {
        self.stage.context("this kind of study needs scene = \"FILE\" or builtin = \"NAME\"")
    }

    /// Keeps a picture for the report.
    pub(super) fn show(&self, title: impl Into<String>, picture: Rgb8Image) {
        self.shots.borrow_mut().push(Shot { title: title.into(), picture });
    }

    /// The moments of the path that are compared.
    pub(super) fn moments(&self) -> Result<Vec<Moment>> {
        let stage = self.stage()?;
        let moment =
            |&time_s: &f64| Moment { pose: stage.scene().pose(time_s), camera: stage.camera(time_s) };
        Ok(stage.frame_times_s.iter().map(moment).collect())
    }

    /// The screen-space methods that are asked for; all if none is.
    pub(super) fn methods(&self) -> Result<Vec<ScreenSpace>> {
        let asked = self.stage()?.settings.methods.iter().filter_map(|method| match method {
            Method::Screen(method) => Some(*method),
            _ => None,
        });
        let asked: Vec<ScreenSpace> = asked.collect();
        Ok(if asked.is_empty() { ScreenSpace::ALL.to_vec() } else { asked })
    }

    /// The methods that can look behind the first surface, of those that are asked for; all if none of them is.
    pub(super) fn layered(&self) -> Result<Vec<Layered>> {
        let methods = self.methods()?;
        let asked: Vec<Layered> =
            Layered::ALL.into_iter().filter(|method| methods.contains(&method.single())).collect();
        Ok(if asked.is_empty() { Layered::ALL.to_vec() } else { asked })
    }

    /// What is seen in a picture of so many pixels, one sample a pixel, with the guard band around it.
    pub(super) fn look(&self, moment: &Moment, size: [u32; 2], band: GuardBand) -> Result<(GBuffer, Screen)> {
        let scene = self.stage()?.scene();
        let gbuffer = band.rasterize(scene, &moment.pose, &moment.camera, size, 1)?;
        let screen = gbuffer.screen(scene, &moment.pose, &band.camera(&moment.camera, size[1]))?;
        Ok((gbuffer, screen))
    }

    pub(super) fn sight<'b>(&'b self, moment: &'b Moment, gbuffer: &'b GBuffer) -> Result<Sight<'b>> {
        let stage = self.stage()?;
        Ok(stage.sight(stage.scene(), &moment.pose, &moment.camera, gbuffer))
    }
}

/// The size that a study's stage asks for.
pub(super) fn size_of(stage: &Stage<'_>) -> [u32; 2] {
    [stage.settings.size.width, stage.settings.size.height]
}

/// A table's column.
pub(super) fn column(title: &str, unit: &str, digits: usize) -> StudyColumn {
    StudyColumn { title: title.to_owned(), unit: unit.to_owned(), digits }
}

/// A table's row.
pub(super) fn row(name: impl Into<String>, values: impl IntoIterator<Item = f64>) -> StudyRow {
    let finite = |value: f64| Some(value).filter(|v| v.is_finite());
    StudyRow { name: name.into(), values: values.into_iter().map(finite).collect() }
}

/// A plot's axis.
pub(super) fn axis(title: &str, unit: &str, is_log: bool) -> StudyAxis {
    StudyAxis { title: title.to_owned(), unit: unit.to_owned(), is_log }
}

/// A plot's line.
pub(super) fn line(name: impl Into<String>, points: impl IntoIterator<Item = [f64; 2]>) -> StudyLine {
    StudyLine { name: name.into(), points: points.into_iter().collect() }
}

/// Samples of a stochastic depth map.
pub(super) const SAMPLES: [u32; 5] = [1, 2, 4, 8, 16];

/// A method over a stochastic depth map.
pub(super) fn stochastic(method: Layered, samples: u32, paper: bool) -> ScreenSpace {
    ScreenSpace::Stochastic(method, Stochastic { samples, two_cameras: false, paper })
}

/// PSNR of a mean squared error with peak 1, in dB; infinite where there is none.
pub(super) fn psnr_db(mse: f64) -> f64 {
    psnr_of(mse).unwrap_or(f64::INFINITY)
}

/// Squared errors of several pictures.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Errors {
    squares: f64,
    sum: f64,
    absolute: f64,
    count: f64,
}

impl Errors {
    pub(super) fn add(&mut self, found: f32, expected: f32) {
        let off = f64::from(found) - f64::from(expected);
        self.squares += off * off;
        self.sum += off;
        self.absolute += off.abs();
        self.count += 1.0;
    }

    /// Adds all pixels that show something.
    pub(super) fn add_covered(&mut self, found: &[f32], expected: &[f32], covered: &[bool]) {
        let pixels = found.iter().zip(expected).zip(covered).filter(|(_, covered)| **covered);
        pixels.for_each(|((found, expected), _)| self.add(*found, *expected));
    }

    /// Mean absolute difference.
    pub(super) fn mean(&self) -> f64 {
        self.absolute / self.count
    }

    /// Infinite where nothing is off.
    pub(super) fn psnr_db(&self) -> f64 {
        psnr_db(self.squares / self.count)
    }

    /// Positive where what was found is lighter.
    pub(super) fn bias(&self) -> f64 {
        self.sum / self.count
    }
}
