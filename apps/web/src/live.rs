//! The page's end of a live session: messages in and out, on the page's clock. The socket is JavaScript's.

use std::sync::Arc;

use dapple_session::{Event, FromViewer, Guest, GuestConfig, GuestError, Held, News, Reason, Role};
use dapple_stream::ReceiveError;
use js_sys::{Error, Reflect};
use wasm_bindgen::prelude::*;

use crate::core::{Core, object};

/// A session, over however many connections.
pub(crate) struct Live {
    pub(crate) guest: Guest,
    /// Whether light came over this connection: what is known of the host's clock is right from then on.
    hears_light: bool,
    /// Whether any light came yet.
    has_light: bool,
}

#[wasm_bindgen]
impl Core {
    /// Makes the viewer one of a live session: the host says what time it is and what was changed. Once, after the scene was
    /// loaded. `bits_per_second` 0 is as many as there are; `seed` spreads the times at which many viewers try again.
    #[wasm_bindgen(js_name = openLive)]
    pub fn open_live(
        &mut self,
        token: Option<String>,
        bits_per_second: f64,
        seed: u32,
    ) -> Result<(), JsError> {
        let scene = self.scene().ok_or_else(|| JsError::new("a live session needs a scene"))?;
        let config = GuestConfig {
            token,
            bits_per_s: (bits_per_second >= 1.0).then_some(bits_per_second as u64),
            in_parts: bits_per_second < 1.0,
            seed: seed.into(),
            ..GuestConfig::default()
        };
        self.live = Some(Live { guest: Guest::new(scene, config), hears_light: false, has_light: false });
        // The host's clock leads.
        self.clock.set_extent(0.0, f64::INFINITY);
        self.clock.set_playing(false);
        self.changed = true;
        Ok(())
    }

    /// The hash of the scene that was loaded, as hexadecimal digits; nothing without a session.
    #[wasm_bindgen(js_name = liveScene)]
    pub fn live_scene(&self) -> Option<String> {
        self.live.as_ref().map(|live| live.guest.hello().scene)
    }

    /// There is a connection.
    #[wasm_bindgen(js_name = liveConnected)]
    pub fn live_connected(&mut self, now_s: f64) {
        if let Some(live) = &mut self.live {
            live.hears_light = false;
            live.guest.connected(micros(now_s));
        }
    }

    /// The connection has broken; seconds to wait before the next.
    #[wasm_bindgen(js_name = liveDisconnected)]
    pub fn live_disconnected(&mut self) -> f64 {
        self.live.as_mut().map_or(0.0, |live| {
            live.hears_light = false;
            live.guest.disconnected() as f64 * 1e-6
        })
    }

    /// Takes a text of the host. Gives `welcome`, `state`, `rejected: …` or nothing to act on. What ends the conversation is an error with
    /// a `reason`, and `retry` where it may be begun anew.
    #[wasm_bindgen(js_name = liveText)]
    pub fn live_text(&mut self, text: &str) -> Result<Option<String>, JsValue> {
        let (Some(live), Some(shown)) = (&mut self.live, &mut self.shown) else { return Ok(None) };
        Ok(match live.guest.receive_text(text).map_err(|error| ended(&error))? {
            News::Welcome(goes_on) => {
                if !goes_on {
                    // What is shown stays until the host's first snapshot.
                    shown.viewer.outdate();
                }
                Some("welcome".to_owned())
            }
            News::State => {
                shown.viewer.set_edits(live.guest.edits());
                self.changed = true;
                Some("state".to_owned())
            }
            News::Rejected(message) => Some(format!("rejected: {message}")),
            News::Nothing | News::Light { .. } => None,
        })
    }

    /// Takes bytes of the host; true if a frame of light was complete and is now held. Errors as of `liveText`.
    #[wasm_bindgen(js_name = liveBytes)]
    pub fn live_bytes(&mut self, bytes: &[u8], now_s: f64) -> Result<bool, JsValue> {
        let (Some(live), Some(shown)) = (&mut self.live, &mut self.shown) else { return Ok(false) };
        self.bytes.add(now_s, bytes.len() as f64);
        let news = live.guest.receive_bytes(bytes, micros(now_s)).map_err(|error| ended(&error))?;
        let News::Light { part, frame } = news else { return Ok(false) };
        live.hears_light = true;
        let held = |held: Option<(u64, u64)>| held.map(|(group, epoch)| Held { group, epoch });
        if frame.is_empty() {
            live.guest.applied(held(shown.viewer.held()), true);
            return Ok(false);
        }
        match shown.viewer.receive_part(part, &frame, now_s) {
            Ok(applied) => {
                live.guest.applied(held(shown.viewer.held()), true);
                live.has_light = true;
                self.points.add(now_s, f64::from(shown.viewer.changed_by(&applied)));
                self.changed = true;
                Ok(true)
            }
            Err(error) if error.snapshot_helps() => {
                live.guest.applied(held(shown.viewer.held()), false);
                Ok(false)
            }
            Err(error) => {
                let reason = match error {
                    ReceiveError::WrongScene { .. } | ReceiveError::Misfit(_) => Reason::Scene,
                    _ => Reason::Malformed,
                };
                Err(failure(reason, false, &error.to_string()))
            }
        }
    }

    /// What is to be said now, if anything: ask until there is nothing.
    #[wasm_bindgen(js_name = liveNext)]
    pub fn live_next(&mut self, now_s: f64) -> Option<String> {
        self.live.as_mut()?.guest.next(micros(now_s))
    }

    /// The last message for a host that is left for good.
    #[wasm_bindgen(js_name = liveBye)]
    pub fn live_bye(&self) -> String {
        Guest::bye()
    }

    /// Bytes of the first light that have come, and all of it: `{ loaded, total }`, zeros once it is there.
    #[wasm_bindgen(js_name = liveProgress)]
    pub fn live_progress(&self) -> JsValue {
        let waits = self.live.as_ref().filter(|live| !live.has_light);
        let (loaded, total) = waits.map_or((0, 0), |live| live.guest.progress());
        object(&[("loaded", (loaded as f64).into()), ("total", (total as f64).into())])
    }

    /// Whether light came over this connection: then more comes at least every second.
    #[wasm_bindgen(js_name = liveHears)]
    pub fn live_hears(&self) -> bool {
        self.live.as_ref().is_some_and(|live| live.hears_light)
    }

    /// What the host lets the viewer do: `view`, `interact`, or nothing before it was let in.
    #[wasm_bindgen(js_name = liveRole)]
    pub fn live_role(&self) -> Option<String> {
        self.live.as_ref()?.guest.role().map(|role| name_of(role).to_owned())
    }

    /// Asks the host for something to happen, as an event of the session in JSON.
    #[wasm_bindgen(js_name = sendEvent)]
    pub fn send_event(&mut self, json: &str) -> Result<(), JsError> {
        let event: Event = serde_json::from_str(json)?;
        self.send(event)
    }

    /// Figures of the session; the names are those of `dapple.d.ts`. null without one.
    #[wasm_bindgen(js_name = liveStatus)]
    pub fn live_status(&self, now_s: f64) -> JsValue {
        let Some(live) = &self.live else { return JsValue::NULL };
        let guest = &live.guest;
        let (status, latency) = (guest.status(), guest.latency());
        let number = |value: Option<f64>| value.map_or(JsValue::NULL, JsValue::from);
        let welcome = guest.welcome();
        let role = guest.role().map(name_of);
        object(&[
            ("connected", welcome.is_some().into()),
            ("role", role.map_or(JsValue::NULL, JsValue::from_str)),
            ("viewer", number(welcome.map(|welcome| welcome.viewer as f64))),
            ("viewers", status.viewers.into()),
            ("hz", number(welcome.map(|welcome| welcome.hz))),
            ("bitsPerSecond", number(welcome.and_then(|welcome| welcome.bits_per_s).map(|bits| bits as f64))),
            ("age", number(guest.age_s(micros(now_s)))),
            ("stepMs", (1e3 * latency.step_s).into()),
            ("queueMs", (1e3 * latency.queue_s).into()),
            ("networkMs", (1e3 * latency.network_s).into()),
            ("behind", status.waiting.into()),
            ("version", (guest.version() as f64).into()),
            ("pending", guest.has_pending().into()),
            ("hasLight", live.has_light.into()),
            ("started", (f64::from(status.started) / 1000.0).into()),
        ])
    }

    /// What was changed of the scene, as JSON.
    pub fn edits(&self) -> Option<String> {
        serde_json::to_string(self.shown.as_ref()?.viewer.edits()).ok()
    }
}

impl Core {
    /// Asks the host for something.
    pub(crate) fn send(&mut self, event: Event) -> Result<(), JsError> {
        let Some(live) = &mut self.live else {
            return Err(JsError::new(
                "this viewer shows no live session: there is nobody to ask for a change",
            ));
        };
        match live.guest.role() {
            Some(Role::Interact) => {}
            Some(Role::View) => {
                return Err(JsError::new("this viewer may look, not change: that needs another token"));
            }
            None => {
                return Err(JsError::new("there is no connection to the server now: nothing can be changed"));
            }
        }
        // A host lets nobody stay who says what is out of range.
        FromViewer::parse(&FromViewer::Event { number: 1, event: event.clone() }.to_text())?;
        if !live.guest.send(event) {
            return Err(JsError::new("the server has not answered what was asked before: wait a little"));
        }
        Ok(())
    }

    /// The scene's time by the host's clock, seconds, while that is known.
    pub(crate) fn host_time_s(&self, now_s: f64) -> Option<f64> {
        let live = self.live.as_ref().filter(|live| live.hears_light)?;
        Some(live.guest.scene_time_s(micros(now_s)))
    }

    /// Goes to the scene's time by the host's clock, while it is known.
    pub(crate) fn follow_host(&mut self, now_s: f64) {
        let Some(time_s) = self.host_time_s(now_s) else { return };
        if time_s != self.clock.time_s() {
            self.clock.seek(time_s);
            let scene = self.shown.as_ref().map(|shown| Arc::clone(&shown.scene));
            self.changed |= scene.is_some_and(|scene| self.steering.follows_time(&scene));
        }
    }
}

fn name_of(role: Role) -> &'static str {
    match role {
        Role::View => "view",
        Role::Interact => "interact",
    }
}

/// Seconds of the page's clock in microseconds.
fn micros(now_s: f64) -> u64 {
    (now_s * 1e6).max(0.0) as u64
}

fn ended(error: &GuestError) -> JsValue {
    match error {
        GuestError::Refused(refusal) => failure(refusal.reason, refusal.reason.may_retry(), &refusal.message),
        GuestError::Message(_) => failure(Reason::Version, false, &error.to_string()),
        GuestError::Edit(_) => failure(Reason::Scene, false, &error.to_string()),
    }
}

/// An error with the reason of a refusal.
fn failure(reason: Reason, may_retry: bool, message: &str) -> JsValue {
    let error = Error::new(message);
    let name = serde_json::to_value(reason).ok().and_then(|value| value.as_str().map(str::to_owned));
    // Setting a field of a fresh error cannot fail.
    let _ = Reflect::set(&error, &"reason".into(), &name.unwrap_or_default().into());
    let _ = Reflect::set(&error, &"retry".into(), &may_retry.into());
    error.into()
}
