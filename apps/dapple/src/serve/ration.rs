//! How many rays a step may take, by what rays took of late.

/// Fewest rays of a step: nothing must wait for ever.
const FEWEST: u64 = 2000;

/// Steps with fewer rays say little of what one takes.
const TELLING: u64 = 500;

/// Part of a new sample in what is smoothed.
const NEWEST: f64 = 0.2;

/// Rations rays so that steps take a part of the time between them.
#[derive(Clone, Debug)]
pub(crate) struct Ration {
    step_s: f64,
    fixed: Option<u64>,
    seconds_per_ray: Option<f64>,
}

impl Ration {
    /// Steps may take `step_s` seconds, unless the number of rays is given.
    pub(crate) fn new(step_s: f64, fixed: Option<u64>) -> Ration {
        Ration { step_s, fixed, seconds_per_ray: None }
    }

    /// Rays that the next step may take; `None` before anything is known.
    pub(crate) fn rays(&self) -> Option<u64> {
        self.fixed.or(self.seconds_per_ray.map(|each| ((self.step_s / each) as u64).max(FEWEST)))
    }

    /// A step took so many rays and seconds; everything else that a step does counts as part of its rays.
    pub(crate) fn note(&mut self, rays: u64, seconds: f64) {
        if rays < TELLING || seconds <= 0.0 {
            return;
        }
        let each = seconds / rays as f64;
        let known = self.seconds_per_ray.unwrap_or(each);
        // One slow step is no trend, but a trend is followed within some steps.
        let each = each.clamp(0.25 * known, 4.0 * known);
        self.seconds_per_ray = Some(known + NEWEST * (each - known));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_follows_what_rays_take() {
        let mut ration = Ration::new(0.02, None);
        assert_eq!(ration.rays(), None);
        for _ in 0..50 {
            let rays = ration.rays().unwrap_or(1_000_000).min(300_000);
            ration.note(rays, rays as f64 * 1e-7);
        }
        assert!((190_000..=210_000).contains(&ration.rays().unwrap()), "{:?}", ration.rays());
        // The machine is busy with something else.
        for _ in 0..50 {
            ration.note(ration.rays().unwrap(), ration.rays().unwrap() as f64 * 4e-7);
        }
        assert!((45_000..=55_000).contains(&ration.rays().unwrap()), "{:?}", ration.rays());
        ration.note(0, 1.0);
        ration.note(10, 100.0);
        assert!(ration.rays().unwrap() > 40_000);
        assert_eq!(Ration::new(0.02, Some(5)).rays(), Some(5));
    }
}
