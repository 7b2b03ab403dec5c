//! Any messages of viewers to a host, and of a host to a viewer: neither end breaks, and the scene's state stays one that fits the scene.

use std::sync::{Arc, LazyLock};

use dapple_scene::glam::Vec3;
use dapple_scene::{Instance, NoFiles, Scene};
use dapple_session::host::{Arrival, Host, HostConfig, Next, hex};
use dapple_session::work::{FromWorker, ToWorker};
use dapple_session::{
    FromHost, FromViewer, Guest, GuestConfig, Hello, LightHead, News, PROTOCOL, Role, SceneClock, Status,
};

/// A scene with a triangle in two places, a light and an animation.
static SCENE: LazyLock<Arc<Scene>> = LazyLock::new(|| {
    let glb = crate::corpus::small_scene();
    let mut scene = dapple_scene::load("scene.glb", &glb, &NoFiles).expect("a sound file");
    let rigid = |instance: &Instance| instance.skin.is_none();
    let like = scene.instances.iter().position(rigid).expect("one of them stands still") as u32;
    scene.add_spares(&[dapple_scene::Spare { instance: like, count: 2 }]).expect("a rigid instance");
    Arc::new(scene)
});

/// Lines of `data` go to a host as a viewer's messages, and to a viewer as a host's: text as it is, lines that begin with `L` or `P` as light too.
/// Nothing may panic; a message that is understood is, said again, the same; the host's edits fit the scene throughout, and a viewer that hears
/// the host ends with its state.
pub fn live_session(data: &[u8]) {
    let scene = SCENE.clone();
    let mut host = Host::new(scene.clone(), HostConfig { events_per_s: 1000, ..HostConfig::default() }, 0);
    let hello = Hello {
        protocol: PROTOCOL,
        wire: dapple_stream::codec::VERSION,
        scene: hex(&scene.hash().0),
        ..Hello::default()
    };
    let arrival = |key: &str| Arrival {
        key: key.to_owned(),
        is_reliable: true,
        is_foreign: false,
        shares: false,
        unix_us: 0,
    };
    let watcher = host.join(&hello, arrival("watcher"), 0).expect("it fits");
    let mut listener = Guest::new(scene.clone(), GuestConfig::default());
    listener.connected(0);
    let mut victim = Guest::new(scene.clone(), GuestConfig { in_parts: true, ..GuestConfig::default() });
    victim.connected(0);
    // It sees something, so that it says which parts of the light it needs.
    victim.look(&dapple_scene::PosedCamera::look_at(Vec3::new(0.0, 1.0, 5.0), Vec3::ZERO, 1.0), 1.5);

    let mut link = host.join(&hello, arrival("0"), 0).expect("it fits");
    for (number, line) in data.split(|byte| *byte == b'\n').take(64).enumerate() {
        let now_us = 100_000 * (number as u64 + 1);
        if let Ok((head, piece)) = LightHead::parse(line) {
            assert!(head.offset as usize + piece.len() <= head.total as usize);
        }
        let _ = victim.receive_bytes(line, now_us);
        if let Ok(text) = std::str::from_utf8(line) {
            if let Ok(message) = FromViewer::parse(text) {
                assert_eq!(FromViewer::parse(&message.to_text()).as_ref().ok(), Some(&message), "said again");
            }
            if let Ok(message) = FromHost::parse(text) {
                let again = FromHost::parse(&message.to_text()).expect("what was read can be written");
                assert_eq!(again.to_text(), message.to_text());
            }
            if let Ok(message) = FromWorker::parse(text) {
                assert_eq!(FromWorker::parse(&message.to_text()).ok(), Some(message));
            }
            if let Ok(message) = ToWorker::parse(text) {
                let again = ToWorker::parse(&message.to_text()).expect("what was read can be written");
                assert_eq!(again.to_text(), message.to_text());
            }
            if let Ok(message) = dapple_moq::About::parse(text) {
                assert!(message.stream_for(Some(1)) < message.streams.len());
                assert_eq!(dapple_moq::About::parse(&message.to_text()).ok(), Some(message));
            }
            let _ = victim.receive_text(text);
            assert!(victim.edits().check(&scene).is_ok(), "a viewer took edits that do not fit");
            if host.receive(link, text, now_us).is_err() {
                link = host.join(&hello, arrival(&number.to_string()), now_us).expect("there is room");
            }
        }
        let _ = victim.next(now_us);
        let tick = host.begin_step(now_us);
        if let Some(edits) = &tick.edits {
            assert!(edits.check(&scene).is_ok(), "the host made edits that do not fit");
        }
        host.end_step(&tick, now_us, Status::default());
        while let Next::Send(_) = host.next(link, now_us) {}
        hear(&mut host, watcher, &mut listener, now_us);
    }
    let (version, clock, edits) = host.state();
    assert_eq!((listener.version(), listener.clock(), listener.edits()), (version, clock, edits));
    assert!(clock.time_us <= 2 * (SceneClock::MAX_TIME_S * 1e6) as u64);
    assert_eq!(listener.role(), Some(Role::Interact));
}

/// Brings a viewer everything that waits for it.
fn hear(host: &mut Host, link: dapple_session::host::Link, guest: &mut Guest, now_us: u64) {
    // It says now and then that it is there.
    let look = FromViewer::Look(dapple_session::Look { number: now_us, ..Default::default() });
    host.receive(link, &look.to_text(), now_us).expect("a look");
    loop {
        let news = match host.next(link, now_us) {
            Next::Send(dapple_session::host::Outgoing::Text(text)) => guest.receive_text(&text),
            Next::Send(dapple_session::host::Outgoing::Bytes(bytes)) => guest.receive_bytes(&bytes, now_us),
            Next::Wait => return,
            Next::Close(refusal) => panic!("the watcher was let go: {refusal}"),
        };
        assert!(!matches!(news, Err(_) | Ok(News::Rejected(_))), "{news:?}");
    }
}
