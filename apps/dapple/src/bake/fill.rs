//! Fills the texels of an image that nothing was measured for, so that filters and mip maps find nothing foreign beside surfaces.

/// Numbers a texel: one list for each channel.
pub(crate) struct Planes {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) channels: Vec<Vec<f32>>,
    /// Whether a texel's numbers are known.
    pub(crate) known: Vec<bool>,
}

impl Planes {
    pub(crate) fn new(width: usize, height: usize, channels: usize) -> Planes {
        let channels = vec![vec![0.0; width * height]; channels];
        Planes { width, height, channels, known: vec![false; width * height] }
    }

    /// Fills everything: `rings` texels around what is known with the mean of their neighbours, ring by ring; the rest with
    /// means over larger and larger squares. `default` where nothing is known at all.
    pub(crate) fn fill(&mut self, rings: u32, default: &[f32]) {
        for _ in 0..rings {
            self.grow();
        }
        if !self.known.iter().any(|known| *known) {
            for (channel, default) in self.channels.iter_mut().zip(default) {
                channel.fill(*default);
            }
        } else if self.known.iter().any(|known| !known) {
            let coarse = self.halved();
            self.pull(&coarse);
        }
        self.known.fill(true);
    }

    /// One ring: unknown texels beside known ones.
    fn grow(&mut self) {
        let (width, height) = (self.width as isize, self.height as isize);
        let mut found: Vec<(usize, Vec<f32>)> = Vec::new();
        for y in 0..height {
            for x in 0..width {
                let at = (y * width + x) as usize;
                if self.known[at] {
                    continue;
                }
                let mut sums = vec![0.0; self.channels.len()];
                let mut count = 0.0;
                for (dx, dy) in [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)] {
                    let (nx, ny) = (x + dx, y + dy);
                    if nx < 0 || ny < 0 || nx >= width || ny >= height {
                        continue;
                    }
                    let neighbour = (ny * width + nx) as usize;
                    if self.known[neighbour] {
                        count += 1.0;
                        for (sum, channel) in sums.iter_mut().zip(&self.channels) {
                            *sum += channel[neighbour];
                        }
                    }
                }
                if count > 0.0 {
                    found.push((at, sums.into_iter().map(|sum| sum / count).collect()));
                }
            }
        }
        for (at, values) in found {
            self.known[at] = true;
            for (channel, value) in self.channels.iter_mut().zip(values) {
                channel[at] = value;
            }
        }
    }

    /// Half as large, each texel the mean of the known ones it covers; filled in turn.
    fn halved(&self) -> Planes {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let mut half = Planes::new(width, height, self.channels.len());
        let mut counts = vec![0.0f32; width * height];
        for y in 0..self.height {
            for x in 0..self.width {
                let at = y * self.width + x;
                if self.known[at] {
                    let to = y / 2 * width + x / 2;
                    counts[to] += 1.0;
                    for (to_channel, channel) in half.channels.iter_mut().zip(&self.channels) {
                        to_channel[to] += channel[at];
                    }
                }
            }
        }
        for (at, &count) in counts.iter().enumerate().filter(|(_, count)| **count > 0.0) {
            half.known[at] = true;
            for channel in &mut half.channels {
                channel[at] /= count;
            }
        }
        if (width, height) != (self.width, self.height) && half.known.iter().any(|known| !known) {
            let coarse = half.halved();
            half.pull(&coarse);
        }
        half
    }

    /// Takes what is unknown from planes half as large.
    fn pull(&mut self, coarse: &Planes) {
        for y in 0..self.height {
            for x in 0..self.width {
                let at = y * self.width + x;
                if !self.known[at] {
                    let from = y / 2 * coarse.width + x / 2;
                    for (channel, coarse) in self.channels.iter_mut().zip(&coarse.channels) {
                        channel[at] = coarse[from];
                    }
                }
            }
        }
        self.known.fill(true);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_near_takes_after_its_neighbours_and_the_rest_after_the_whole() {
        let mut planes = Planes::new(21, 9, 2);
        for (x, value) in [(2, 0.25), (18, 0.75)] {
            planes.known[4 * 21 + x] = true;
            planes.channels[0][4 * 21 + x] = value;
            planes.channels[1][4 * 21 + x] = 1.0 - value;
        }
        planes.fill(2, &[1.0, 1.0]);
        let at = |x: usize, y: usize| planes.channels[0][y * 21 + x];
        for y in 2..=6 {
            for x in 0..=4 {
                assert_eq!((at(x, y), at(20 - x, y)), (0.25, 0.75), "{x} {y}");
            }
        }
        for (a, b) in planes.channels[0].iter().zip(&planes.channels[1]) {
            assert!((0.25..=0.75).contains(a) && (a + b - 1.0).abs() < 1e-6);
        }
        assert!(planes.known.iter().all(|known| *known));
    }

    #[test]
    fn nothing_known_is_the_default() {
        let mut planes = Planes::new(5, 3, 1);
        planes.fill(2, &[0.5]);
        assert_eq!(planes.channels[0], [0.5; 15]);
        let mut one = Planes::new(1, 1, 1);
        one.fill(3, &[0.25]);
        assert_eq!(one.channels[0], [0.25]);
    }
}
