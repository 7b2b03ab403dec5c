//! Errors that a device reports on its own time, kept until someone asks.

use std::sync::{Arc, Mutex, PoisonError};

/// What went wrong on a device after it was made.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GpuFault {
    /// The device is gone; nothing that was made on it works any more.
    #[error("gpu: the device was lost ({0}): make a new one, and everything on it again")]
    Lost(String),
    /// Memory ran out.
    #[error("gpu: out of memory ({0}): draw a smaller picture, smaller shadow maps or a smaller scene")]
    OutOfMemory(String),
    /// A call was rejected: a mistake of the program.
    #[error("gpu: a call was rejected: {0}")]
    Rejected(String),
}

/// The first fault of a device that nobody has asked for yet, and its loss for good.
#[derive(Clone, Debug, Default)]
pub(crate) struct Faults(Arc<Mutex<Option<GpuFault>>>);

impl Faults {
    /// Watches a device for as long as it lives.
    pub(crate) fn watch(device: &wgpu::Device) -> Faults {
        let faults = Faults::default();
        let errors = faults.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            errors.put(match error {
                wgpu::Error::OutOfMemory { source } => GpuFault::OutOfMemory(chain(source.as_ref())),
                wgpu::Error::Validation { description, .. } | wgpu::Error::Internal { description, .. } => {
                    GpuFault::Rejected(description)
                }
            });
        }));
        let losses = faults.clone();
        device.set_device_lost_callback(move |reason, message| {
            // Letting go of the device is no fault.
            if reason != wgpu::DeviceLostReason::Destroyed {
                losses.put(GpuFault::Lost(message));
            }
        });
        faults
    }

    fn put(&self, fault: GpuFault) {
        let mut first = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        // A loss causes many rejections, and says more than they do. The first one says why.
        let is_lost = matches!(*first, Some(GpuFault::Lost(_)));
        if first.is_none() || (matches!(fault, GpuFault::Lost(_)) && !is_lost) {
            *first = Some(fault);
        }
    }

    /// The fault, which is then forgotten; a loss never is, because it never passes.
    pub(crate) fn take(&self) -> Option<GpuFault> {
        let mut first = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match &*first {
            Some(GpuFault::Lost(_)) => first.clone(),
            _ => first.take(),
        }
    }
}

fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(error) = source {
        text.push_str(": ");
        text.push_str(&error.to_string());
        source = error.source();
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loss_is_told_to_everyone_and_other_faults_once() {
        let faults = Faults::default();
        assert_eq!(faults.take(), None);
        let rejected = |text: &str| GpuFault::Rejected(text.to_owned());
        faults.put(rejected("first"));
        faults.put(rejected("second"));
        assert_eq!([faults.take(), faults.take()], [Some(rejected("first")), None]);
        faults.put(rejected("because of the loss"));
        faults.put(GpuFault::Lost("unplugged".to_owned()));
        faults.put(GpuFault::Lost("again".to_owned()));
        faults.put(rejected("later"));
        let lost = Some(GpuFault::Lost("unplugged".to_owned()));
        assert_eq!([faults.take(), faults.clone().take()], [lost.clone(), lost]);
    }
}
