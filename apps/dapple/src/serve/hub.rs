//! The host, shared by the thread that lights and the tasks that talk to viewers.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use dapple_session::host::{Arrival, Host};
use tokio::sync::watch;

use super::figures::Figures;

/// What all parts of a serving program share.
pub(crate) struct Hub {
    host: Mutex<Host>,
    began: Instant,
    /// Counts steps: tasks wait for the next.
    steps: watch::Sender<u64>,
    phase: watch::Sender<Phase>,
    pub(crate) figures: Figures,
}

/// How far the program is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Phase {
    /// The light of the start is being made: what, and per mille of it.
    Starting(&'static str, u32),
    Serving,
    /// Nobody is let in any more.
    Draining,
    /// The light has ended.
    Failed(String),
}

impl Hub {
    pub(crate) fn new(host: impl FnOnce(u64) -> Host, began: Instant) -> Hub {
        Hub {
            host: Mutex::new(host(began.elapsed().as_micros() as u64)),
            began,
            steps: watch::Sender::new(0),
            phase: watch::Sender::new(Phase::Starting("starting", 0)),
            figures: Figures::default(),
        }
    }

    pub(crate) fn host(&self) -> MutexGuard<'_, Host> {
        // Whoever panicked while it held the host has not left it half changed in a way that matters to others.
        self.host.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Microseconds of the host's clock.
    pub(crate) fn now_us(&self) -> u64 {
        self.began.elapsed().as_micros() as u64
    }

    /// Wakes all tasks.
    pub(crate) fn step_done(&self) {
        self.steps.send_modify(|steps| *steps += 1);
    }

    pub(crate) fn watch_steps(&self) -> watch::Receiver<u64> {
        self.steps.subscribe()
    }

    pub(crate) fn set_phase(&self, phase: Phase) {
        self.phase.send_if_modified(|now| {
            // The end is final, whatever the light still does.
            let is_final = matches!(now, Phase::Failed(_))
                || *now == Phase::Draining && !matches!(phase, Phase::Failed(_));
            !is_final && std::mem::replace(now, phase.clone()) != phase
        });
    }

    pub(crate) fn phase(&self) -> Phase {
        self.phase.borrow().clone()
    }

    pub(crate) fn watch_phase(&self) -> watch::Receiver<Phase> {
        self.phase.subscribe()
    }

    /// What a new connection is told apart by.
    pub(crate) fn arrival(&self, is_reliable: bool, whence: Whence) -> Result<Arrival, getrandom::Error> {
        let Whence { is_foreign, shares } = whence;
        let mut secret = [0; 16];
        getrandom::fill(&mut secret)?;
        let unix_us =
            SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_micros() as u64);
        Ok(Arrival { key: dapple_session::host::hex(&secret), is_reliable, is_foreign, shares, unix_us })
    }
}

/// Where a viewer's words come from: see [`Arrival`].
#[derive(Clone, Copy, Default)]
pub(crate) struct Whence {
    pub(crate) is_foreign: bool,
    pub(crate) shares: bool,
}

/// Shared.
pub(crate) type SharedHub = Arc<Hub>;
