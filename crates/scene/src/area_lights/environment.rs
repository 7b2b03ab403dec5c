//! Light from all around, as an equirectangular picture.

use std::f32::consts::{FRAC_1_PI, PI, TAU};

use glam::{Mat3, Vec3};

use super::luminance;

/// Radiance from infinitely far by direction, and directions chosen in proportion to it.
///
/// The picture's middle column lies towards −Z, its top row about +Y, and columns go to the right for who looks along −Z (glTF's front
/// of a camera); `world_from_environment` turns it.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    width: usize,
    height: usize,
    /// Rows from the top.
    texels: Vec<Vec3>,
    world_from_environment: Mat3,
    /// Running sums of weight along each row.
    along: Vec<f32>,
    /// Running sums of the rows' weights.
    rows: Vec<f32>,
    mean: Vec3,
}

/// Why a picture is no environment.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EnvironmentError {
    /// Sides or list do not fit.
    #[error(
        "an environment of {width} × {height} texels with {texels} values: sides must be 1 … {MAX_SIDE}, and there must be one value a texel"
    )]
    Size {
        /// Texels.
        width: usize,
        /// Texels.
        height: usize,
        /// Values given.
        texels: usize,
    },
    /// A value that no light has.
    #[error("the environment's texel ({x}, {y}) is {value}: radiance must be a number, 0 … 1e30")]
    Value {
        /// Column.
        x: usize,
        /// Row from the top.
        y: usize,
        /// What it holds.
        value: Vec3,
    },
    /// The file is none that can be read.
    #[error(
        "the environment cannot be read as a Radiance HDR picture: {0}; give an equirectangular .hdr file"
    )]
    File(String),
}

/// Longest side of an environment, texels.
pub const MAX_SIDE: usize = 16_384;

/// Largest radiance, W/(m² sr): the sum of all texels has to be a number.
pub const MAX_RADIANCE: f32 = 1e30;

impl Environment {
    /// From radiance in W/(m² sr), rows from the top.
    ///
    /// # Errors
    /// [`EnvironmentError::Size`] and [`EnvironmentError::Value`].
    pub fn new(
        width: usize,
        height: usize,
        texels: Vec<Vec3>,
        world_from_environment: Mat3,
    ) -> Result<Environment, EnvironmentError> {
        let sides = 1..=MAX_SIDE;
        if !sides.contains(&width) || !sides.contains(&height) || texels.len() != width * height {
            return Err(EnvironmentError::Size { width, height, texels: texels.len() });
        }
        if let Some(i) = texels
            .iter()
            .position(|t| !t.cmpge(Vec3::ZERO).all() || !t.cmple(Vec3::splat(MAX_RADIANCE)).all())
        {
            return Err(EnvironmentError::Value { x: i % width, y: i / width, value: texels[i] });
        }
        let mut this = Environment {
            width,
            height,
            texels,
            world_from_environment,
            along: Vec::with_capacity(width * height),
            rows: Vec::with_capacity(height),
            mean: Vec3::ZERO,
        };
        this.sum();
        Ok(this)
    }

    /// From the bytes of a Radiance `.hdr` file.
    ///
    /// # Errors
    /// [`EnvironmentError`].
    pub fn from_hdr(bytes: &[u8]) -> Result<Environment, EnvironmentError> {
        let mut limits = image::Limits::default();
        limits.max_image_width = Some(MAX_SIDE as u32);
        limits.max_image_height = Some(MAX_SIDE as u32);
        let mut reader =
            image::ImageReader::with_format(std::io::Cursor::new(bytes), image::ImageFormat::Hdr);
        reader.limits(limits);
        let picture = reader.decode().map_err(|e| EnvironmentError::File(e.to_string()))?.into_rgb32f();
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        let texels = picture.pixels().map(|p| Vec3::from_array(p.0)).collect();
        Environment::new(width, height, texels, Mat3::IDENTITY)
    }

    /// Turned; `world_from_environment` must be a rotation.
    pub fn turned(mut self, world_from_environment: Mat3) -> Environment {
        self.world_from_environment = world_from_environment;
        self
    }

    fn sum(&mut self) {
        let (width, height) = (self.width, self.height);
        let (mut total, mut mean, mut solid) = (0.0f32, Vec3::ZERO, 0.0f32);
        for y in 0..height {
            let sine = libm::sinf((y as f32 + 0.5) / height as f32 * PI);
            let mut row = 0.0f32;
            for x in 0..width {
                row += self.weight(x, y);
                self.along.push(row);
                mean += self.texels[y * width + x] * sine;
                solid += sine;
            }
            total += row * sine;
            self.rows.push(total);
        }
        self.mean = mean / solid.max(f32::MIN_POSITIVE);
    }

    /// Weight of a texel: what it and its neighbours can give where they are filtered. Zero only where nothing shines.
    fn weight(&self, x: usize, y: usize) -> f32 {
        let mut sum = 0.0;
        for (dy, wy) in [(-1i64, 0.125), (0, 0.75), (1, 0.125)] {
            let row = (y as i64 + dy).clamp(0, self.height as i64 - 1) as usize;
            for (dx, wx) in [(self.width - 1, 0.125), (0, 0.75), (1, 0.125)] {
                sum += wy * wx * luminance(self.texels[row * self.width + (x + dx) % self.width]);
            }
        }
        sum
    }

    /// Texels.
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// Mean over all directions.
    pub fn mean_radiance(&self) -> Vec3 {
        self.mean
    }

    /// Radiance that arrives from a unit direction, between texels by bilinear filtering.
    pub fn radiance(&self, direction_world: Vec3) -> Vec3 {
        let [u, v] = self.place(direction_world);
        let (x, y) = (u * self.width as f32 - 0.5, v * self.height as f32 - 0.5);
        let (x0, y0) = (x.floor(), y.floor());
        let texel = |x: f32, y: f32| {
            let column = (x as i64).rem_euclid(self.width as i64) as usize;
            self.texels[y.clamp(0.0, self.height as f32 - 1.0) as usize * self.width + column]
        };
        let top = texel(x0, y0).lerp(texel(x0 + 1.0, y0), x - x0);
        let bottom = texel(x0, y0 + 1.0).lerp(texel(x0 + 1.0, y0 + 1.0), x - x0);
        top.lerp(bottom, y - y0)
    }

    /// Where a unit direction lies in the picture, 0 … 1 from the left and from the top.
    fn place(&self, direction_world: Vec3) -> [f32; 2] {
        let d = self.world_from_environment.transpose() * direction_world;
        let u = 0.5 + libm::atan2f(d.x, -d.z) / TAU;
        [u, libm::acosf(d.y.clamp(-1.0, 1.0)) * FRAC_1_PI]
    }

    /// A unit direction chosen by luminance, its radiance and its density, 1/sr; density 0 if nothing shines.
    pub fn sample(&self, u: [f32; 2]) -> (Vec3, Vec3, f32) {
        let total = self.rows.last().copied().unwrap_or(0.0);
        if !(total > 0.0 && total.is_finite()) {
            return (Vec3::Y, Vec3::ZERO, 0.0);
        }
        let (y, fy) = find(&self.rows, u[1]);
        let row = &self.along[y * self.width..(y + 1) * self.width];
        let (x, fx) = find(row, u[0]);
        let (phi, theta) =
            (((x as f32 + fx) / self.width as f32 - 0.5) * TAU, ((y as f32 + fy) / self.height as f32) * PI);
        let (sin_phi, cos_phi) = libm::sincosf(phi);
        let (sin_theta, cos_theta) = libm::sincosf(theta);
        let d = Vec3::new(sin_theta * sin_phi, cos_theta, -sin_theta * cos_phi);
        let direction = (self.world_from_environment * d).normalize_or(Vec3::Y);
        let density = self.density_at(x, y, sin_theta);
        (direction, self.radiance(direction), density)
    }

    /// Density by solid angle with which [`Environment::sample`] chooses a unit direction, 1/sr.
    pub fn density_per_sr(&self, direction_world: Vec3) -> f32 {
        let [u, v] = self.place(direction_world);
        let x = ((u * self.width as f32) as usize).min(self.width - 1);
        let y = ((v * self.height as f32) as usize).min(self.height - 1);
        self.density_at(x, y, libm::sinf(v * PI))
    }

    fn density_at(&self, x: usize, y: usize, sin_theta: f32) -> f32 {
        let total = self.rows.last().copied().unwrap_or(0.0);
        if total <= 0.0 || sin_theta <= 0.0 {
            return 0.0;
        }
        let row_sine = libm::sinf((y as f32 + 0.5) / self.height as f32 * PI);
        let texels = (self.width * self.height) as f32;
        self.weight(x, y) * row_sine / total * texels / (2.0 * PI * PI * sin_theta)
    }
}

/// The interval of running sums that `u` falls into, and where in it, 0 … 1.
fn find(sums: &[f32], u: f32) -> (usize, f32) {
    let total = sums.last().copied().unwrap_or(0.0);
    let at = u.clamp(0.0, 1.0) * total;
    let mut i = sums.partition_point(|sum| *sum <= at);
    if i == sums.len() {
        i = sums.partition_point(|sum| *sum < total);
    }
    let before = if i == 0 { 0.0 } else { sums[i - 1] };
    (i, ((at - before) / (sums[i] - before)).clamp(0.0, 1.0))
}
