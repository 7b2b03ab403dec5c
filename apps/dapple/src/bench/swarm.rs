//! Viewers without pictures.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use dapple_session::{Guest, GuestConfig, Held, News};
use dapple_stream::{FrameHeader, Limits, Subscriber};
use tokio::sync::watch;

use crate::live::{Address, LinkState, SharedGuest, keep};

use super::served::Served;

/// A viewer that decodes what it gets, or only counts it.
pub(crate) struct Bot {
    pub(crate) shared: SharedGuest,
    log: Mutex<Log>,
    pub(crate) state: watch::Sender<LinkState>,
}

/// What has come.
#[derive(Default)]
pub(crate) struct Log {
    /// Decodes every frame, where that is wanted.
    pub(crate) subscriber: Option<Subscriber>,
    /// Ages of light as it came, seconds, while they are wanted.
    pub(crate) ages_s: Vec<f64>,
    pub(crate) keeps_ages: bool,
    pub(crate) bytes: u64,
    pub(crate) frames: u64,
    /// From the start to the first light, seconds.
    pub(crate) first_s: Option<f64>,
    pub(crate) first_bytes: u64,
    pub(crate) failures: Vec<String>,
}

impl Bot {
    pub(crate) fn new(served: &Served, config: GuestConfig, decodes: bool) -> Arc<Bot> {
        let subscriber = decodes.then(|| {
            let most = u32::try_from(served.scene.instances.len()).unwrap_or(u32::MAX);
            let limits = Limits::default();
            Subscriber::new(
                Some(served.scene.hash().0),
                Limits { max_sets: limits.max_sets.max(most), ..limits },
            )
        });
        Arc::new(Bot {
            shared: SharedGuest::new(Guest::new(served.scene.clone(), config)),
            log: Mutex::new(Log { subscriber, ..Log::default() }),
            state: watch::Sender::new(LinkState::Connecting),
        })
    }

    pub(crate) fn log(&self) -> MutexGuard<'_, Log> {
        self.log.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Views until told to stop.
    pub(crate) async fn view(&self, address: &Address, stop: watch::Receiver<bool>) {
        let start = Instant::now();
        keep(address, &self.shared, &self.state, stop, |guest, news| self.take(guest, news, start)).await;
    }

    fn take(&self, guest: &mut Guest, news: News, start: Instant) {
        let mut log = self.log();
        match news {
            News::Light { frame, .. } => {
                if log.keeps_ages
                    && let (Some(welcome), Some(head)) = (guest.welcome(), guest.newest())
                {
                    // Both are on one machine, whose clock both read.
                    let made_us = welcome.unix_us + head.stamp_us.saturating_sub(welcome.clock_us);
                    log.ages_s.push(unix_us().saturating_sub(made_us) as f64 * 1e-6);
                }
                if !frame.is_empty() {
                    log.light(guest, &frame, start);
                }
            }
            News::Welcome(goes_on) => {
                if let (false, Some(subscriber)) = (goes_on, &mut log.subscriber) {
                    subscriber.outdate();
                }
            }
            _ => {}
        }
    }
}

impl Log {
    fn light(&mut self, guest: &mut Guest, frame: &[u8], start: Instant) {
        self.bytes += frame.len() as u64;
        self.frames += 1;
        if self.first_s.is_none() {
            (self.first_s, self.first_bytes) = (Some(start.elapsed().as_secs_f64()), frame.len() as u64);
        }
        let Some(subscriber) = &mut self.subscriber else {
            match FrameHeader::parse(frame, &Limits::default()) {
                Ok(FrameHeader { group, epoch, .. }) => guest.applied(Some(Held { group, epoch }), true),
                Err(error) => self.failures.push(error.to_string()),
            }
            return;
        };
        let applied = subscriber.receive(frame);
        let held = subscriber.group().zip(subscriber.epoch()).map(|(group, epoch)| Held { group, epoch });
        guest.applied(held, applied.is_ok());
        if let Err(error) = applied {
            // Over a link that keeps the order nothing is ever missing.
            self.failures.push(error.to_string());
        }
    }
}

fn unix_us() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_micros() as u64)
}
