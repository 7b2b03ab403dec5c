//! The two ends of a pair: Dapple's own, or those of the paper's scheme, which is evaluated beside it.

use std::sync::Arc;

use anyhow::{Context, Result, bail};
use dapple_client::paper::PaperClient;
use dapple_client::{Client, Drawn, Reconstruction};
use dapple_render::psao::Kernel;
use dapple_scene::Scene;
use dapple_server::Server;
use dapple_server::paper::{Look, PaperConfig, PaperServer};
use dapple_stream::Limits;
use dapple_stream::cells::CellLimits;
use dapple_trace::psao::paper::PaperParams;
use dapple_trace::psao::update::{StepCounts, StepInput};

use super::stage::Stage;

/// The sending end.
pub(super) enum AnyServer {
    Own(Box<Server>),
    Paper(Box<PaperServer>),
}

/// The receiving end.
pub(super) enum AnyClient {
    Own(Box<Client>),
    Paper(Box<PaperClient>),
}

/// What a step sent, and what it did.
pub(super) struct AnyStep {
    pub(super) frame: Option<Arc<[u8]>>,
    pub(super) counts: StepCounts,
}

impl AnyServer {
    /// Either of them, from a server at its start.
    pub(super) fn new(server: Server, is_paper: bool, threshold: u8) -> Result<AnyServer> {
        if !is_paper {
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
        }
    }

    /// What a client gets on joining.
    pub(super) fn join(&mut self) -> Result<Arc<[u8]>> {
        match self {
            AnyServer::Own(server) => match server.join()? {
                Some(snapshot) => Ok(snapshot.bytes),
                None => bail!("the server has published nothing"),
            },
            AnyServer::Paper(server) => Ok(server.join()?.bytes.into()),
        }
    }

    pub(super) fn step(&mut self, time_s: f64, input: &StepInput<'_>, stage: &Stage<'_>) -> Result<AnyStep> {
        match self {
            AnyServer::Own(server) => {
                let report = server.step_with(time_s, input)?;
                Ok(AnyStep { frame: report.frame.map(|frame| frame.bytes), counts: report.counts })
            }
            AnyServer::Paper(server) => {
                let (scene, size) = (stage.scene(), stage.settings.size);
                let camera = stage.path.camera(scene, &scene.pose_undeformed(time_s));
                let look = Look { camera, aspect: size.width as f32 / size.height as f32 };
                let report = server.step(time_s, Some(&look), input)?;
                Ok(AnyStep { frame: report.frame.map(|frame| frame.bytes.into()), counts: report.counts })
            }
        }
    }

    pub(super) fn points(&self) -> u64 {
        match self {
            AnyServer::Own(server) => server.store().layout().len() as u64,
            AnyServer::Paper(server) => server.points() as u64,
        }
    }

    /// How many bytes of what a client gets on joining are cuts.
    pub(super) fn cut_bytes(&self) -> u64 {
        match self {
            AnyServer::Own(server) => server.cut_bytes() as u64,
            AnyServer::Paper(_) => 0,
        }
    }
}

impl AnyClient {
    /// The client of a server.
    pub(super) fn of(server: &AnyServer) -> AnyClient {
        let scene = server.scene().clone();
        match server {
            AnyServer::Own(_) => AnyClient::Own(Box::new(Client::new(scene, Limits::default()))),
            AnyServer::Paper(_) => AnyClient::Paper(Box::new(PaperClient::new(scene, CellLimits::default()))),
        }
    }

    pub(super) fn receive(&mut self, bytes: &[u8]) -> Result<()> {
        match self {
            AnyClient::Own(client) => drop(client.receive(bytes)?),
            AnyClient::Paper(client) => drop(client.receive(bytes)?),
        }
        Ok(())
    }

    /// Visibility of each sample. The paper's client has no atlas and takes its kernel instead.
    pub(super) fn visibility(&self, drawn: &Drawn, reconstruction: &Reconstruction) -> Vec<f32> {
        match (self, reconstruction) {
            (AnyClient::Own(client), _) => client.visibility(drawn, reconstruction),
            (AnyClient::Paper(client), Reconstruction::Direct(kernel)) => client.visibility(drawn, kernel),
            (AnyClient::Paper(client), Reconstruction::Atlas) => {
                client.visibility(drawn, &Kernel::Hat(Default::default()))
            }
        }
    }

    /// Makes what is made once a session.
    pub(super) fn make_atlas(&self) {
        if let AnyClient::Own(client) = self {
            client.atlas();
        }
    }
}
