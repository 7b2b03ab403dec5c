//! What the program tells those who watch it.

use std::sync::atomic::{AtomicI64, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use dapple_server::StepReport;
use dapple_session::host::HostCounts;
use prometheus_client::encoding::text::encode;
use prometheus_client::metrics::counter::ConstCounter;
use prometheus_client::metrics::gauge::ConstGauge;
use prometheus_client::metrics::histogram::Histogram;
use prometheus_client::registry::{Registry, Unit};

/// Most ages that the percentiles are taken of: the newest.
const AGES: usize = 4096;

/// Sums since the start, and distributions.
pub(crate) struct Figures {
    steps: AtomicU64,
    late_steps: AtomicU64,
    rays: AtomicU64,
    changed: AtomicU64,
    /// Microseconds.
    stepping_us: AtomicU64,
    encoding_us: AtomicU64,
    ray_budget: AtomicI64,
    points: AtomicI64,
    waiting: AtomicI64,
    workers: AtomicI64,
    step_times: Histogram,
    ages: Histogram,
    newest_ages: Mutex<Newest>,
}

#[derive(Default)]
struct Newest {
    ages_us: Vec<u32>,
    next: usize,
}

impl Default for Figures {
    fn default() -> Self {
        let times = [0.001, 0.002, 0.005, 0.01, 0.02, 0.03, 0.05, 0.1, 0.2, 0.5, 1.0];
        let ages = [0.005, 0.01, 0.02, 0.035, 0.05, 0.075, 0.1, 0.15, 0.2, 0.3, 0.5, 1.0, 2.0, 5.0];
        Figures {
            steps: AtomicU64::new(0),
            late_steps: AtomicU64::new(0),
            rays: AtomicU64::new(0),
            changed: AtomicU64::new(0),
            stepping_us: AtomicU64::new(0),
            encoding_us: AtomicU64::new(0),
            ray_budget: AtomicI64::new(0),
            points: AtomicI64::new(0),
            waiting: AtomicI64::new(0),
            workers: AtomicI64::new(0),
            step_times: Histogram::new(times),
            ages: Histogram::new(ages),
            newest_ages: Mutex::default(),
        }
    }
}

impl Figures {
    /// A step was made, in so many microseconds, so many of them for frames of other rungs.
    pub(crate) fn step(&self, report: &StepReport, took_us: u64, encoding_us: u64, is_late: bool) {
        let add = |counter: &AtomicU64, amount| counter.fetch_add(amount, Ordering::Relaxed);
        add(&self.steps, 1);
        add(&self.late_steps, u64::from(is_late));
        add(&self.rays, report.rays);
        add(&self.changed, u64::from(report.changed));
        add(&self.stepping_us, took_us);
        add(&self.encoding_us, encoding_us);
        self.points.store(i64::from(report.points), Ordering::Relaxed);
        self.waiting.store(i64::from(report.counts.backlog), Ordering::Relaxed);
        self.step_times.observe(took_us as f64 * 1e-6);
    }

    pub(crate) fn set_ray_budget(&self, rays: u64) {
        self.ray_budget.store(rays as i64, Ordering::Relaxed);
    }

    pub(crate) fn set_workers(&self, workers: usize) {
        self.workers.store(workers as i64, Ordering::Relaxed);
    }

    /// Ages of light that viewers told of.
    pub(crate) fn ages(&self, ages_us: &[u32]) {
        let mut newest = self.newest_ages.lock().unwrap_or_else(PoisonError::into_inner);
        for age_us in ages_us {
            self.ages.observe(f64::from(*age_us) * 1e-6);
            if newest.ages_us.len() < AGES {
                newest.ages_us.push(*age_us);
            } else {
                let next = newest.next;
                newest.ages_us[next] = *age_us;
                newest.next = (next + 1) % AGES;
            }
        }
    }

    fn percentiles(&self) -> [f64; 3] {
        let mut ages_us = self.newest_ages.lock().unwrap_or_else(PoisonError::into_inner).ages_us.clone();
        ages_us.sort_unstable();
        [0.5, 0.95, 0.99].map(|part| {
            let at = (ages_us.len() as f64 * part) as usize;
            ages_us.get(at.min(ages_us.len().saturating_sub(1))).map_or(0.0, |age| f64::from(*age) * 1e-6)
        })
    }

    /// All of it in the text format of Prometheus.
    pub(crate) fn text(&self, host: &HostCounts) -> String {
        let mut registry = Registry::with_prefix("dapple");
        let load = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        let seconds = |counter: &AtomicU64| load(counter) as f64 * 1e-6;
        let counters: [(&str, &str, u64); 13] = [
            ("steps", "Updates of the light", load(&self.steps)),
            ("late_steps", "Updates that began late", load(&self.late_steps)),
            ("rays", "Rays traced", load(&self.rays)),
            ("points_changed", "Points whose visibility was sent", load(&self.changed)),
            ("viewers_joined", "Viewers let in, again ones included", host.joined),
            ("viewers_resumed", "Viewers that went on after a broken connection", host.resumed),
            ("viewers_refused", "Viewers not let in", host.refused),
            ("viewers_expelled", "Connections ended for what a viewer did or did not do", host.expelled),
            ("events", "Events that took effect", host.events),
            ("events_rejected", "Events that did not", host.rejected),
            ("snapshots_sent", "Snapshots given out", host.snapshots),
            ("deltas_sent", "Frames given out that build on others", host.deltas),
            ("viewers_jumped", "Snapshots given out to viewers that had fallen behind", host.jumps),
        ];
        for (name, help, value) in counters {
            registry.register(name, help, ConstCounter::new(value));
        }
        registry.register_with_unit("sent", "Sent to viewers", Unit::Bytes, ConstCounter::new(host.bytes));
        let spent = ConstCounter::new(seconds(&self.stepping_us));
        registry.register_with_unit("stepping", "Time spent on updates", Unit::Seconds, spent);
        let spent = ConstCounter::new(seconds(&self.encoding_us));
        registry.register_with_unit("encoding_rungs", "Of it, on leaner streams", Unit::Seconds, spent);
        let gauges: [(&str, &str, i64); 5] = [
            ("workers", "Workers that trace for this host", self.workers.load(Ordering::Relaxed)),
            ("viewers", "Viewers connected", i64::from(host.viewers)),
            ("points", "Points that are lit", self.points.load(Ordering::Relaxed)),
            ("points_waiting", "Points that wait for rays", self.waiting.load(Ordering::Relaxed)),
            (
                "ray_budget",
                "Rays that an update may take, 0 for no limit",
                self.ray_budget.load(Ordering::Relaxed),
            ),
        ];
        for (name, help, value) in gauges {
            registry.register(name, help, ConstGauge::new(value));
        }
        let help = "What an update takes";
        registry.register_with_unit("step", help, Unit::Seconds, self.step_times.clone());
        let help = "Age of light as it comes to viewers, from the start of its update, there and back";
        registry.register_with_unit("light_age", help, Unit::Seconds, self.ages.clone());
        let [p50, p95, p99] = self.percentiles();
        for (name, value) in [("light_age_p50", p50), ("light_age_p95", p95), ("light_age_p99", p99)] {
            let help = "Of the newest 4096 ages";
            registry.register_with_unit(name, help, Unit::Seconds, ConstGauge::new(value));
        }
        let mut text = String::new();
        // Writing into a string cannot fail.
        let _ = encode(&mut text, &registry);
        if let Some((cpu_s, resident_bytes)) = process() {
            let process = format!(
                "# TYPE process_cpu_seconds counter\nprocess_cpu_seconds_total {cpu_s}\n\
                 # TYPE process_resident_memory_bytes gauge\nprocess_resident_memory_bytes {resident_bytes}\n"
            );
            let end = text.rfind("# EOF").unwrap_or(text.len());
            text.insert_str(end, &process);
        }
        text
    }
}

/// Linux counts in hundredths of a second for programs, whatever its own clock is.
const TICKS_PER_S: f64 = 100.0;

/// Seconds of processor that this program has taken, and bytes of memory that it holds; on Linux.
pub(crate) fn process() -> Option<(f64, u64)> {
    process_of("self")
}

/// The same of another program.
pub(crate) fn process_of(id: &str) -> Option<(f64, u64)> {
    let stat = std::fs::read_to_string(format!("/proc/{id}/stat")).ok()?;
    // The name may hold anything, but nothing after its parenthesis does.
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = fields.get(11)?.parse::<u64>().ok()? + fields.get(12)?.parse::<u64>().ok()?;
    let status = std::fs::read_to_string(format!("/proc/{id}/status")).ok()?;
    let resident = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kib: u64 = resident.trim().trim_end_matches("kB").trim().parse().ok()?;
    Some((ticks as f64 / TICKS_PER_S, kib * 1024))
}

/// Seconds of processor that a program's threads have taken whose names begin like this.
pub(crate) fn threads_of(id: &str, name: &str) -> Option<f64> {
    let mut ticks = 0;
    for task in std::fs::read_dir(format!("/proc/{id}/task")).ok()? {
        // A thread may end while it is looked at.
        let Ok(stat) = std::fs::read_to_string(task.ok()?.path().join("stat")) else { continue };
        let (head, fields) = stat.rsplit_once(')')?;
        if head.split_once('(').is_some_and(|(_, of_thread)| of_thread.starts_with(name)) {
            let fields: Vec<&str> = fields.split_whitespace().collect();
            ticks += fields.get(11)?.parse::<u64>().ok()? + fields.get(12)?.parse::<u64>().ok()?;
        }
    }
    Some(ticks as f64 / TICKS_PER_S)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_is_what_prometheus_reads() {
        let figures = Figures::default();
        figures.ages(&[10_000, 20_000, 1_000_000]);
        figures.step(&StepReport { rays: 7, ..StepReport::default() }, 2500, 0, true);
        let text = figures.text(&HostCounts { viewers: 3, bytes: 12, ..HostCounts::default() });
        for line in [
            "dapple_rays_total 7",
            "dapple_viewers 3",
            "dapple_sent_bytes_total 12",
            "dapple_late_steps_total 1",
            "dapple_light_age_seconds_count 3",
            "dapple_light_age_p50_seconds 0.02",
            "dapple_light_age_p99_seconds 1.0",
        ] {
            assert!(text.lines().any(|found| found == line), "{line} is missing in\n{text}");
        }
        assert!(text.ends_with("# EOF\n"));
    }

    #[test]
    fn many_ages_take_no_more_room() {
        let figures = Figures::default();
        for age in 0..20_000 {
            figures.ages(&[age]);
        }
        assert_eq!(figures.newest_ages.lock().unwrap().ages_us.len(), AGES);
        assert!(figures.percentiles()[0] > 0.015);
    }
}
