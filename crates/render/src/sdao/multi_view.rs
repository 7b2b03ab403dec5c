//! HBAO+ and SSAO from two cameras: the second, to the side, sees surfaces along which the first one looks (\[Vermeer2021\] sec. 3.4, Alg. 3).

use dapple_scene::{Pose, PosedCamera, Projection, Scene};
use glam::{Affine3A, DAffine3, DQuat, DVec3, Mat3A, Vec3, Vec3A};

use super::hidden::Lookup;
use super::map::{MapParams, StochasticMap};
use crate::bilateral::Bilateral;
use crate::gbuffer::{MAX_SIDE, Screen, rasterize};
use crate::hbao::{Centre, Estimator, HbaoParams, Horizon};
use crate::ssao::{self, SsaoParams};
use crate::{AfterPass, RenderError, projection};

/// The most of [`SideParams::coarseness`].
const MAX_COARSENESS: u32 = 8;

/// Where the second camera stands, and how fine its picture is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SideParams {
    /// How far to the right of the first one, metres, > 0; default 2.
    pub aside_m: f32,
    /// From which distance on the second camera sees all that the first one can, metres, > 0; default 1. Less opens its lens more.
    pub covers_from_m: f32,
    /// Samples of the first picture along a side of one of the second, 1 (as fine) … 8; default 1. 2 is half the resolution.
    pub coarseness: u32,
}

impl Default for SideParams {
    fn default() -> Self {
        SideParams { aside_m: 2.0, covers_from_m: 1.0, coarseness: 1 }
    }
}

impl SideParams {
    /// Whether every parameter is in its range.
    ///
    /// # Errors
    /// Names the first that is not.
    pub fn check(&self) -> Result<(), RenderError> {
        let positive = |value: f32| value > 0.0 && value.is_finite();
        let checks: [(&'static str, f64, bool, &'static str); 3] = [
            ("sdao: aside_m", self.aside_m.into(), positive(self.aside_m), "finite and above 0"),
            (
                "sdao: covers_from_m",
                self.covers_from_m.into(),
                positive(self.covers_from_m),
                "finite and above 0",
            ),
            (
                "sdao: coarseness",
                self.coarseness.into(),
                (1..=MAX_COARSENESS).contains(&self.coarseness),
                "1 to 8",
            ),
        ];
        match checks.into_iter().find(|(_, _, holds, _)| !holds) {
            Some((name, found, _, range)) => Err(RenderError::Parameter { name, found, range }),
            None => Ok(()),
        }
    }

    /// Of a first picture that has one of four samples: as coarse, up to the coarsest there is.
    pub fn half(self) -> SideParams {
        SideParams { coarseness: self.coarseness.saturating_mul(2).min(MAX_COARSENESS), ..self }
    }

    /// Columns and rows of the second picture, of a first one with so many.
    pub fn size(&self, [columns, rows]: [u32; 2]) -> [u32; 2] {
        [columns, rows].map(|count| count.div_ceil(self.coarseness.max(1)))
    }

    /// The second camera, for a first one whose picture is so many times as wide as high: to the right of it, turned to the left, with a lens that takes in all of
    /// the first one's view from a distance on; of a parallel camera all of its box.
    ///
    /// # Errors
    /// A parameter out of its range, or a view so wide that no lens takes it in from there.
    pub fn camera(&self, camera: &PosedCamera, aspect: f64) -> Result<PosedCamera, RenderError> {
        self.check()?;
        let aside = f64::from(self.aside_m);
        let (yaw, place, projection) = match camera.projection {
            Projection::Perspective { yfov, near } => {
                let tan_y = libm::tan(0.5 * f64::from(yfov));
                let (tan_x, from) = (tan_y * aspect, f64::from(self.covers_from_m));
                // Farthest to the left is the near end of the left side; to the right, the far end of the right one.
                let (left, right) = (libm::atan(tan_x + aside / from), libm::atan(tan_x));
                let (yaw, half) = (0.5 * (left - right), 0.5 * (left + right));
                let (sin, cos) = libm::sincos(yaw);
                // Heights are seen largest at an end of a side: height over distance along the axis of the second camera.
                let ends = [
                    tan_y * from / ((tan_x * from + aside) * sin + from * cos),
                    tan_y * from / ((aside - tan_x * from) * sin + from * cos),
                    tan_y / (cos - tan_x * sin),
                ];
                let tallest = ends.into_iter().fold(0.0, f64::max);
                let lowest = ends.into_iter().fold(f64::INFINITY, f64::min);
                let tan_half = tallest.max(libm::tan(half) / aspect);
                let yfov = (2.0 * libm::atan(tan_half)) as f32;
                if lowest <= 0.0 || !(yfov > 0.0 && yfov < 3.1) {
                    return Err(RenderError::Camera {
                        reason: "its view is too wide for a second camera so far aside: take less, or cover from farther on",
                    });
                }
                (yaw, DVec3::new(aside, 0.0, 0.0), Projection::Perspective { yfov, near })
            }
            Projection::Orthographic { half_height, near, far } => {
                // About the middle of the box, which stays inside from whatever side.
                let [half_height, near, far] = [half_height, near, far].map(f64::from);
                let (half_width, half_depth) = (half_height * aspect, 0.5 * (far - near));
                let middle = DVec3::new(0.0, 0.0, -0.5 * (near + far));
                let yaw = libm::atan2(aside, half_depth);
                let (sin, cos) = libm::sincos(yaw);
                let (wide, deep) = (half_width * cos + half_depth * sin, half_depth * cos + half_width * sin);
                let back = DVec3::new(sin, 0.0, cos);
                let projection = Projection::Orthographic {
                    half_height: half_height.max(wide / aspect) as f32,
                    near: 0.0,
                    far: (2.0 * deep) as f32,
                };
                (yaw, middle + back * deep, projection)
            }
        };
        // To the left is counter-clockwise from above.
        let moved = DAffine3::from_rotation_translation(DQuat::from_rotation_y(yaw), place);
        Ok(PosedCamera {
            world_from_view: narrow(projection::widen(&camera.world_from_view) * moved),
            projection,
        })
    }
}

fn narrow(map: DAffine3) -> Affine3A {
    let axis = |v: DVec3| Vec3A::new(v.x as f32, v.y as f32, v.z as f32);
    let [x, y, z] = [map.matrix3.x_axis, map.matrix3.y_axis, map.matrix3.z_axis].map(axis);
    Affine3A { matrix3: Mat3A::from_cols(x, y, z), translation: axis(map.translation) }
}

/// What the second camera sees.
#[derive(Clone, Debug)]
pub struct SideView {
    /// The second camera.
    pub camera: PosedCamera,
    screen: Screen,
    map: StochasticMap,
    side_from_main: Affine3A,
}

impl SideView {
    /// Draws it for a picture of the first camera with so many samples in a row, and rows. A map without first surfaces is drawn beside a G-buffer of its own.
    ///
    /// # Errors
    /// A parameter out of its range, or what [`rasterize`] refuses.
    pub fn draw(
        scene: &Scene,
        pose: &Pose,
        main: &PosedCamera,
        [columns, rows]: [u32; 2],
        side: &SideParams,
        map: &MapParams,
    ) -> Result<SideView, RenderError> {
        map.check()?;
        let camera = side.camera(main, f64::from(columns) / f64::from(rows.max(1)))?;
        let counts = side.size([columns, rows]);
        // More samples than a picture may have pixels: several to a pixel.
        let per_axis = counts.into_iter().max().unwrap_or(1).div_ceil(MAX_SIDE).max(1);
        let [width, height] = counts.map(|count| count.div_ceil(per_axis));
        let (screen, map) = if map.is_first_left_out {
            let gbuffer = rasterize(scene, pose, &camera, width, height, per_axis)?;
            let map = StochasticMap::draw(scene, pose, &camera, &gbuffer, map)?;
            (gbuffer.screen(scene, pose, &camera)?, map)
        } else {
            let map = StochasticMap::draw_alone(scene, pose, &camera, [width, height], per_axis, map)?;
            (Screen::of_nothing(&camera, [width, height].map(|side| side * per_axis)), map)
        };
        Ok(SideView { camera, screen, map, side_from_main: side_from_main(main, &camera) })
    }

    /// The same with a map that was made elsewhere.
    #[cfg(all(test, feature = "gpu"))]
    pub(crate) fn with_map(self, map: StochasticMap) -> SideView {
        SideView { map, ..self }
    }

    /// What is known of what it sees, and looked at as the first one's.
    fn lookup(&self, main: &Lookup<'_>) -> Lookup<'_> {
        Lookup {
            hidden: super::Hidden::Stochastic(&self.map),
            looks: main.looks,
            compensation: main.compensation,
        }
    }

    /// A place and a normal of the first camera's view space in its own, if it sees that place's point of its picture.
    fn seen(&self, place: Vec3, normal: Vec3) -> Option<(Vec3, Vec3, [f32; 2])> {
        let place = self.side_from_main.transform_point3(place);
        let point = self.screen.point_of(place)?;
        self.screen.sample_in(point)?;
        Some((place, self.side_from_main.transform_vector3(normal).normalize_or_zero(), point))
    }

    /// Where a place of the first picture lies in this one; `None` if it does not.
    fn centre(&self, main: &Centre) -> Option<Centre> {
        let (place, normal, point) = self.seen(main.place, main.normal)?;
        Some(Centre { point, place, normal, turn: main.turn, jitter: main.jitter })
    }
}

/// From the first camera's view space to the second one's.
pub(crate) fn side_from_main(main: &PosedCamera, side: &PosedCamera) -> Affine3A {
    let [main, side] = [main, side].map(|camera| projection::widen(&camera.world_from_view));
    narrow(side.inverse() * main)
}

/// Whether HBAO's kind can be had of two cameras: HBAO+.
///
/// # Errors
/// [`Horizon::Highest`]: the second camera may see a surface from behind, where its tangent has no angle to begin with.
pub(crate) fn check_horizon(params: &HbaoParams) -> Result<(), RenderError> {
    match params.horizon {
        Horizon::Mean => Ok(()),
        Horizon::Highest => Err(RenderError::Parameter {
            name: "sdao: horizon of two cameras",
            found: 0.0,
            range: "HBAO+'s mean",
        }),
    }
}

/// Visibility as of [`hbao::estimate_visibility_with`](crate::hbao::estimate_visibility_with) with HBAO+, the more occlusion of what both cameras see
/// (Alg. 3, line 5). `lookup` is of the first one; `after` is told when each pass is done: `samples`, `blur`.
///
/// # Errors
/// A parameter out of its range, [`Horizon::Highest`], or hidden surfaces of another picture.
pub fn estimate_visibility(
    screen: &Screen,
    params: &HbaoParams,
    lookup: &Lookup<'_>,
    side: &SideView,
    after: AfterPass<'_>,
) -> Result<Vec<f32>, RenderError> {
    params.check()?;
    lookup.check(screen)?;
    check_horizon(params)?;
    let beside = side.lookup(lookup);
    let main = Estimator::new(screen, params, lookup);
    let second = Estimator::new(&side.screen, params, &beside);
    let visibility = screen.map(|at| match main.centre(at) {
        Some(centre) => {
            let beside = side.centre(&centre).map_or(0.0, |centre| second.occlusion(&centre));
            params.visibility(main.occlusion(&centre).max(beside))
        }
        None => 1.0,
    });
    after("samples");
    let visibility = Bilateral::within(params.radius_m, params.blur_taps).smooth(screen, &visibility);
    after("blur");
    Ok(visibility)
}

/// Visibility as of [`ssao::estimate_visibility_with`](crate::ssao::estimate_visibility_with), the more occlusion of what both cameras see, which is Alg. 3's
/// line 5 for places in a hemisphere. `lookup` is of the first one; `after` is told when each pass is done: `samples`, `blur`.
///
/// # Errors
/// A parameter out of its range, or hidden surfaces of another picture.
pub fn estimate_ssao(
    screen: &Screen,
    params: &SsaoParams,
    lookup: &Lookup<'_>,
    side: &SideView,
    after: AfterPass<'_>,
) -> Result<Vec<f32>, RenderError> {
    let beside = side.lookup(lookup);
    ssao::estimate_with_more(screen, params, lookup, after, |estimator, place, normal, turn| {
        let seen = side.seen(place, normal);
        seen.map_or(0.0, |(place, normal, _)| estimator.occlusion(&side.screen, &beside, place, normal, turn))
    })
}
