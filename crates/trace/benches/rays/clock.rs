//! Time: the wall's and the processor's, so that others on the machine count less.
//!
//! Processor time is the operating system's count for a thread or the process (`clock_gettime` on Unix,
//! `GetThreadTimes` on Windows). Where the system refuses it, it is the wall's time, and that is said once.

use std::sync::Once;
use std::time::{Duration, Instant};

use cpu_time::{ProcessTime, ThreadTime};

/// What a piece of work took, seconds.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Took {
    pub(crate) wall_s: f64,
    pub(crate) cpu_s: f64,
}

/// Runs `work` and counts this thread's processor time.
pub(crate) fn time_thread<T>(work: impl FnOnce() -> T) -> (T, Took) {
    let before = ThreadTime::try_now().ok();
    time(work, || before?.try_elapsed().ok())
}

/// Runs `work` and counts the processor time of all threads of this process.
pub(crate) fn time_process<T>(work: impl FnOnce() -> T) -> (T, Took) {
    let before = ProcessTime::try_now().ok();
    time(work, || before?.try_elapsed().ok())
}

fn time<T>(work: impl FnOnce() -> T, cpu: impl FnOnce() -> Option<Duration>) -> (T, Took) {
    static TOLD: Once = Once::new();
    let start = Instant::now();
    let made = work();
    let cpu = cpu();
    let wall = start.elapsed();
    if cpu.is_none() {
        TOLD.call_once(|| println!("NO PROCESSOR TIME on this system: the wall's is counted instead"));
    }
    (made, Took { wall_s: wall.as_secs_f64(), cpu_s: cpu.unwrap_or(wall).as_secs_f64() })
}

/// The middle of the values (the upper of two); NaN without any.
pub(crate) fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
