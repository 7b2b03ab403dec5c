//! The two ends of a pair: Dapple's own, or those of the schemes that are evaluated beside it.

use std::sync::Arc;

use anyhow::{Context, Result, bail};
use dapple_client::paper::PaperClient;
use dapple_client::{Client, Drawn, Reconstruction};
use dapple_render::psao::{Hat, Kernel};
use dapple_scene::glam::Vec3;
use dapple_scene::{PosedCamera, Scene};
use dapple_server::Server;
use dapple_server::paper::{Look, PaperConfig, PaperServer};
use dapple_stream::Limits;
use dapple_stream::cells::CellLimits;
use dapple_trace::Tracer;
use dapple_trace::psao::paper::PaperParams;
use dapple_trace::psao::update::{StepCounts, StepInput};
#[cfg(feature = "sas")]
use dapple_trace::rtao::RtaoParams;

#[cfg(feature = "sas")]
use super::sas::{Blocks, SasClient, SasFrame, SasParams, SasServer};
use super::stage::Stage;
use crate::args::Method;

/// The sending end.
pub(super) enum AnyServer {
    Own(Box<Server>),
    Paper(Box<PaperServer>),
    #[cfg(feature = "sas")]
    Sas(Box<SasServer>),
}

/// The receiving end.
pub(super) enum AnyClient {
    Own(Box<Client>),
    Paper(Box<PaperClient>),
    #[cfg(feature = "sas")]
    Sas(Box<SasClient>),
}

/// What is sent: bytes, and what is not counted.
pub(super) struct Packet {
    pub(super) bytes: Arc<[u8]>,
    #[cfg(feature = "sas")]
    blocks: Option<Blocks>,
}

impl From<Arc<[u8]>> for Packet {
    fn from(bytes: Arc<[u8]>) -> Packet {
        Packet {
            bytes,
            #[cfg(feature = "sas")]
            blocks: None,
        }
    }
}

#[cfg(feature = "sas")]
impl From<&SasFrame> for Packet {
    fn from(frame: &SasFrame) -> Packet {
        Packet { bytes: frame.video[..].into(), blocks: Some(frame.blocks.clone()) }
    }
}

/// What a step sent, and what it did.
pub(super) struct AnyStep {
    pub(super) packet: Option<Packet>,
    pub(super) counts: StepCounts,
    pub(super) rays: u64,
    /// Points whose changes wait for bits.
    pub(super) held_back: u32,
    /// Points that there are, and of how many instances they came and went; of a server whose points can.
    pub(super) sets: Option<[u32; 3]>,
}

impl AnyStep {
    fn new(bytes: Option<Arc<[u8]>>, counts: StepCounts) -> AnyStep {
        AnyStep { packet: bytes.map(Packet::from), rays: counts.rays(), counts, held_back: 0, sets: None }
    }
}

/// The camera at a time of the path.
fn camera_at(stage: &Stage<'_>, time_s: f64) -> PosedCamera {
    stage.path.camera(stage.scene(), &stage.scene().pose_undeformed(time_s))
}

impl AnyServer {
    /// Either of them, from a server at its start.
    pub(super) fn new(
        mut server: Server,
        is_paper: bool,
        threshold: u8,
        bits_per_s: Option<u64>,
    ) -> Result<AnyServer> {
        if !is_paper {
            server.set_bits_per_s(bits_per_s);
            return Ok(AnyServer::Own(Box::new(server)));
        }
        let params = PaperParams { threshold, ..PaperParams::default() };
        let config = PaperConfig { params, ..PaperConfig::default() };
        let server = PaperServer::new(server, &config).context("psao-paper")?;
        let unplaced = server.unplaced();
        if unplaced > 0 {
            tracing::info!(
                "psao-paper: {unplaced} of {} points find no place in their cells",
                server.points()
            );
        }
        Ok(AnyServer::Paper(Box::new(server)))
    }

    pub(super) fn scene(&self) -> &Arc<Scene> {
        match self {
            AnyServer::Own(server) => server.scene(),
            AnyServer::Paper(server) => server.scene(),
            #[cfg(feature = "sas")]
            AnyServer::Sas(server) => server.scene(),
        }
    }

    /// The server of a method that has one of its own. `tracer` is the scene's.
    #[cfg(feature = "sas")]
    pub(super) fn served(stage: &Stage<'_>, method: Method, hz: f64, tracer: &Tracer) -> Result<AnyServer> {
        let Method::Sas { bias } = method else { bail!("{method} has no server of its own") };
        let settings = stage.settings;
        // Truth has other directions.
        let seed = u64::from(settings.seed) << 8 | 3;
        let rays = RtaoParams { rays: settings.point_rays, radius_m: stage.radius_m, seed };
        let params = SasParams { bias, hz, size: (settings.size.width, settings.size.height), rays };
        let scene = stage.loaded.scene.clone();
        let server = SasServer::new(scene, tracer.clone(), &camera_at(stage, 0.0), params)?;
        Ok(AnyServer::Sas(Box::new(server)))
    }

    /// Settings refuse such methods where there is no video codec.
    #[cfg(not(feature = "sas"))]
    pub(super) fn served(_: &Stage<'_>, method: Method, _: f64, _: &Tracer) -> Result<AnyServer> {
        bail!("{method} has no server in this program")
    }

    /// What a client gets on joining at the start.
    #[cfg_attr(not(feature = "sas"), expect(unused_variables, reason = "only one of the rivals has to look"))]
    pub(super) fn join(&mut self, stage: &Stage<'_>) -> Result<Packet> {
        match self {
            AnyServer::Own(server) => match server.join()? {
                Some(snapshot) => Ok(snapshot.bytes.into()),
                None => bail!("the server has published nothing"),
            },
            AnyServer::Paper(server) => Ok(Arc::<[u8]>::from(server.join()?.bytes).into()),
            #[cfg(feature = "sas")]
            AnyServer::Sas(server) => match &server.step(0.0, &camera_at(stage, 0.0))?.frame {
                Some(frame) => Ok(frame.into()),
                None => bail!("the server has sent nothing"),
            },
        }
    }

    /// Steps with the scene at a time; the second one is that of the clock, which never falls.
    pub(super) fn step(
        &mut self,
        (time_s, sent_s): (f64, f64),
        input: &StepInput<'_>,
        stage: &Stage<'_>,
    ) -> Result<AnyStep> {
        match self {
            AnyServer::Own(server) => {
                let report = server.step_at(time_s, sent_s, input)?;
                let step = AnyStep::new(report.frame.map(|frame| frame.bytes), report.counts);
                let sets = Some([report.points, report.spawned, report.evicted]);
                let held_back = report.held_back.saturating_add(report.lights_due as u32);
                Ok(AnyStep { held_back, sets, rays: report.rays, ..step })
            }
            AnyServer::Paper(server) => {
                let size = stage.settings.size;
                let look =
                    Look { camera: camera_at(stage, time_s), aspect: size.width as f32 / size.height as f32 };
                let report = server.step(time_s, Some(&look), input)?;
                Ok(AnyStep::new(report.frame.map(|frame| frame.bytes.into()), report.counts))
            }
            #[cfg(feature = "sas")]
            AnyServer::Sas(server) => {
                let step = server.step(time_s, &camera_at(stage, time_s))?;
                let packet = step.frame.as_ref().map(Packet::from);
                Ok(AnyStep {
                    packet,
                    counts: StepCounts::default(),
                    rays: step.rays,
                    held_back: 0,
                    sets: None,
                })
            }
        }
    }

    /// Rays to lights that the start took.
    pub(super) fn first_light_rays(&self) -> u64 {
        match self {
            AnyServer::Own(server) => server.lights().map_or(0, |lights| lights.first_counts().rays),
            _ => 0,
        }
    }

    pub(super) fn points(&self) -> u64 {
        match self {
            AnyServer::Own(server) => server.store().layout().len() as u64,
            AnyServer::Paper(server) => server.points() as u64,
            #[cfg(feature = "sas")]
            AnyServer::Sas(server) => server.texels(),
        }
    }

    /// How many bytes of what a client gets on joining are cuts.
    pub(super) fn cut_bytes(&self) -> u64 {
        match self {
            AnyServer::Own(server) => server.cut_bytes() as u64,
            AnyServer::Paper(_) => 0,
            #[cfg(feature = "sas")]
            AnyServer::Sas(_) => 0,
        }
    }
}

impl AnyClient {
    /// The client of a server.
    pub(super) fn of(server: &AnyServer) -> Result<AnyClient> {
        let scene = server.scene().clone();
        Ok(match server {
            AnyServer::Own(_) => AnyClient::Own(Box::new(Client::new(scene, Limits::default()))),
            AnyServer::Paper(_) => AnyClient::Paper(Box::new(PaperClient::new(scene, CellLimits::default()))),
            #[cfg(feature = "sas")]
            AnyServer::Sas(server) => AnyClient::Sas(Box::new(SasClient::of(server)?)),
        })
    }

    pub(super) fn receive(&mut self, packet: &Packet) -> Result<()> {
        match self {
            AnyClient::Own(client) => drop(client.receive(&packet.bytes)?),
            AnyClient::Paper(client) => drop(client.receive(&packet.bytes)?),
            #[cfg(feature = "sas")]
            AnyClient::Sas(client) => {
                client.receive(&packet.bytes, packet.blocks.clone().unwrap_or_default())?
            }
        }
        Ok(())
    }

    /// Visibility of each sample, as `method` looks it up.
    pub(super) fn visibility(&self, drawn: &Drawn, method: Method) -> Result<Vec<f32>> {
        let hat = |radius| Kernel::Hat(Hat { radius, ..Hat::default() });
        Ok(match (self, method) {
            (AnyClient::Own(client), Method::Psao | Method::Slc) => {
                client.visibility(drawn, &Reconstruction::Atlas)
            }
            (AnyClient::Own(client), Method::PsaoMls) => client.visibility(drawn, &Kernel::default().into()),
            (AnyClient::Own(client), Method::PsaoHat { radius }) => {
                client.visibility(drawn, &hat(radius).into())
            }
            (AnyClient::Paper(client), Method::PsaoPaper) => client.visibility(drawn, &hat(1.0)),
            (AnyClient::Paper(client), Method::PsaoPaperMls) => client.visibility(drawn, &Kernel::default()),
            #[cfg(feature = "sas")]
            (AnyClient::Sas(client), Method::Sas { .. }) => client.visibility(drawn),
            _ => bail!("{method} does not belong to this client"),
        })
    }

    /// What each sample reflects from the surroundings, where the client knows better than by the sample's own normal.
    pub(super) fn ambient(&self, drawn: &Drawn, stage: &Stage<'_>, visibility: &[f32]) -> Option<Vec<Vec3>> {
        match self {
            AnyClient::Own(client) => {
                client.ambient(drawn, &stage.camera_at(drawn), stage.shade(), visibility)
            }
            _ => None,
        }
    }

    /// What each sample reflects of area lights, by how much of them the points around it see.
    pub(super) fn area_light(&self, drawn: &Drawn, stage: &Stage<'_>) -> Option<Vec<Vec3>> {
        match self {
            AnyClient::Own(client) => Some(client.area_light(drawn, &stage.camera_at(drawn), stage.shade())),
            _ => None,
        }
    }

    /// Makes what is made once a session.
    pub(super) fn make_atlas(&self) {
        if let AnyClient::Own(client) = self {
            client.atlas();
        }
    }
}
