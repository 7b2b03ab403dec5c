//! Time: the wall's, and that of all threads of this process.

use std::time::Instant;

/// What a piece of work took, milliseconds.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Took {
    pub(crate) wall_ms: f64,
    /// Of all threads; on a software adapter that is the work itself, whatever else the machine does.
    pub(crate) cpu_ms: Option<f64>,
}

/// Runs `work` and says how long it took.
pub(crate) fn time(work: impl FnOnce()) -> Took {
    let (start, before) = (Instant::now(), cpu_ms());
    work();
    let wall_ms = start.elapsed().as_secs_f64() * 1e3;
    Took { wall_ms, cpu_ms: before.zip(cpu_ms()).map(|(before, after)| after - before) }
}

/// Processor time of all threads that live, where Linux tells it.
fn cpu_ms() -> Option<f64> {
    let threads = std::fs::read_dir("/proc/self/task").ok()?;
    let nanoseconds = threads.flatten().filter_map(|thread| {
        let text = std::fs::read_to_string(thread.path().join("schedstat")).ok()?;
        text.split_whitespace().next()?.parse::<u64>().ok()
    });
    Some(nanoseconds.sum::<u64>() as f64 * 1e-6)
}

/// The middle of the values; NaN without any.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
