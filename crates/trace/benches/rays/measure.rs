//! Rays a second, and whether everybody gives the same answers.

use crate::clock::{median, time_thread};
use crate::rays::{Batch, RAYS};
use crate::tracers::{Candidate, Column, Job};

/// Threads that ask at the same time.
pub(crate) const THREADS: [usize; 2] = [1, 2];

/// One candidate's figures for rays of one length.
pub(crate) struct Measured {
    pub(crate) name: String,
    pub(crate) column: Column,
    /// Million rays per second of processor time, summed over threads; for each of [`THREADS`].
    pub(crate) mrays: [f64; THREADS.len()],
    pub(crate) blocked: u64,
    /// Rays on which it and our `occlusion` differ: those that only it finds blocked, and those that only ours does.
    pub(crate) differ: [u64; 2],
    /// Rays that it answers otherwise in another repetition or on another thread: 0, or something is broken.
    pub(crate) changed: u64,
}

/// Times all candidates in turn, `repetitions` times, after a first round that only compares answers.
pub(crate) fn measure(
    candidates: &[Candidate],
    batch: &Batch,
    t_max: f32,
    repetitions: usize,
) -> Vec<Measured> {
    let points = batch.len();
    let answers: Vec<Vec<u64>> = candidates
        .iter()
        .map(|candidate| {
            let mut blocked = vec![0; points];
            (candidate.trace)(&Job { batch, t_max, points: 0..points, step: 1 }, &mut blocked);
            blocked
        })
        .collect();

    let mut speeds = vec![[const { Vec::new() }; THREADS.len()]; candidates.len()];
    let mut changed = vec![0; candidates.len()];
    let mut blocked = vec![0; points];
    for _ in 0..repetitions {
        for (i, candidate) in candidates.iter().enumerate() {
            for (speeds, threads) in speeds[i].iter_mut().zip(THREADS) {
                speeds.push(run(candidate, batch, t_max, threads, &mut blocked));
                let timed = blocked.iter().zip(&answers[i]).step_by(candidate.step);
                changed[i] += timed.map(|(a, b)| u64::from((a ^ b).count_ones())).sum::<u64>();
            }
        }
    }

    let count = |masks: &mut dyn Iterator<Item = u64>| masks.map(|m| u64::from(m.count_ones())).sum();
    let both = |i: usize| answers[i].iter().zip(&answers[0]);
    let figures = candidates.iter().zip(speeds).zip(changed).enumerate();
    figures
        .map(|(i, ((candidate, speeds), changed))| Measured {
            name: candidate.name.clone(),
            column: candidate.column,
            mrays: speeds.map(median),
            blocked: count(&mut answers[i].iter().copied()),
            differ: [
                count(&mut both(i).map(|(its, ours)| its & !ours)),
                count(&mut both(i).map(|(its, ours)| ours & !its)),
            ],
            changed,
        })
        .collect()
}

/// Traces all of a candidate's points once, an equal share on each thread, and returns million rays per processor second.
fn run(candidate: &Candidate, batch: &Batch, t_max: f32, threads: usize, blocked: &mut [u64]) -> f64 {
    // Shares begin where one thread alone would be, too.
    let share = batch.len().div_ceil(threads).next_multiple_of(candidate.step);
    let jobs = blocked.chunks_mut(share).enumerate().map(|(i, blocked)| {
        let points = i * share..i * share + blocked.len();
        (Job { batch, t_max, points, step: candidate.step }, blocked)
    });
    let trace = |(job, blocked): (Job, &mut [u64])| {
        let ((), took) = time_thread(|| (candidate.trace)(&job, blocked));
        (job.rays(), took.cpu_s)
    };
    let told: Vec<(usize, f64)> = if threads == 1 {
        jobs.map(trace).collect()
    } else {
        std::thread::scope(|scope| {
            let running: Vec<_> = jobs.map(|job| scope.spawn(move || trace(job))).collect();
            running.into_iter().filter_map(|thread| thread.join().ok()).collect()
        })
    };
    let (rays, seconds) = told.iter().fold((0, 0.0), |(rays, s), (r, cpu)| (rays + r, s + cpu));
    rays as f64 / seconds / 1e6
}

/// All rays of a batch.
pub(crate) fn ray_count(batch: &Batch) -> usize {
    batch.len() * RAYS
}
