//! Methods that look at the picture alone, each made when it is first asked for.

use dapple_gpu::{Gpu, wgpu};
use dapple_render::Chosen;
use dapple_render::forward::{Forward, GpuScene, LookupId};
use dapple_render::gbuffer::GuardBand;
use dapple_render::screen_space::{ScreenKind, ScreenPasses, ScreenView};
use dapple_scene::{Pose, PosedCamera};

use super::options::ScreenOptions;

/// A picture shows at most two methods: each has a look-up of its own, after the paper's.
pub(super) const IDS: [LookupId; 2] = [LookupId::added(1), LookupId::added(2)];

/// One look-up's passes.
enum Slot {
    Unmade,
    Made(Box<ScreenPasses>),
    /// The device cannot, and why.
    Failed(String),
}

/// The passes of a viewer.
pub(super) struct ScreenSpace {
    slots: [Slot; 2],
    /// Of the picture that is being drawn.
    kinds: [Option<ScreenKind>; 2],
    /// Why one of its methods is not there.
    missing: Option<String>,
}

/// What is drawn with the methods.
pub(super) struct Picture<'a> {
    pub(super) scene: &'a mut GpuScene,
    pub(super) pose: &'a Pose,
    pub(super) camera: &'a PosedCamera,
    pub(super) size: (u32, u32),
}

impl ScreenSpace {
    pub(super) fn new() -> ScreenSpace {
        ScreenSpace { slots: [Slot::Unmade, Slot::Unmade], kinds: [None; 2], missing: None }
    }

    /// Records the passes of the methods that a picture shows. What cannot be shown is left out, and [`ScreenSpace::problem`] says why.
    pub(super) fn draw(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        forward: &mut Forward,
        picture: Picture<'_>,
        wanted: &[ScreenKind],
        options: &ScreenOptions,
    ) {
        (self.kinds, self.missing) = ([None; 2], None);
        let Picture { scene, pose, camera, size } = picture;
        let part = options.guard_band.clamp(0.0, GuardBand::MAX_PART);
        let guard = GuardBand::of_height(part, size.1).unwrap_or_default();
        for &kind in wanted {
            if self.kinds.contains(&Some(kind)) {
                continue;
            }
            let Chosen { params, half_resolution } = kind.preset(options.preset);
            if let Err(error) = ScreenPasses::check_device(gpu, &params) {
                self.missing = Some(format!("{}: {error}", kind.name()));
                continue;
            }
            let Some(index) = self.kinds.iter().position(Option::is_none) else { break };
            let slot = &mut self.slots[index];
            if matches!(slot, Slot::Unmade) {
                *slot = match ScreenPasses::new(gpu, IDS[index]) {
                    Ok(passes) => Slot::Made(Box::new(passes)),
                    Err(error) => Slot::Failed(error.to_string()),
                };
            }
            let passes = match slot {
                Slot::Made(passes) => passes,
                Slot::Failed(problem) => {
                    self.missing = Some(problem.clone());
                    continue;
                }
                Slot::Unmade => continue,
            };
            let view = ScreenView {
                camera: *camera,
                size,
                method: params.with_radius(options.radius_m).with_second_camera(options.second_camera),
                guard,
                half_resolution: options.half_resolution.unwrap_or(half_resolution),
            };
            match passes.draw(gpu, encoder, forward, scene, pose, &view) {
                Ok(()) => self.kinds[index] = Some(kind),
                Err(error) => self.missing = Some(format!("{}: {error}", kind.name())),
            }
        }
        for (slot, kind) in self.slots.iter_mut().zip(self.kinds) {
            if let (Slot::Made(passes), None) = (slot, kind) {
                passes.release();
            }
        }
    }

    /// Where the forward pass finds what a method of the last [`ScreenSpace::draw`] has found.
    pub(super) fn lookup(&self, kind: ScreenKind) -> LookupId {
        let index = self.kinds.iter().position(|drawn| *drawn == Some(kind));
        index.map_or(LookupId::NONE, |index| IDS[index])
    }

    /// Why a method of the last picture is not shown, if so.
    pub(super) fn problem(&self) -> Option<&str> {
        self.missing.as_deref()
    }
}
