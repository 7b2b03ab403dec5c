//! Arguments of `dapple serve`.

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, ValueEnum};
use dapple_server::shards::Shard;
use dapple_session::Role;

use super::{BitRate, LightArgs, SceneChoice};

pub(crate) const SERVE_EXAMPLES: &str = "\
Examples:
  dapple serve room.glb                          light a scene for everyone on this machine: prints the addresses
  dapple serve --builtin atrium --detail 0.5 --points 512
  dapple serve room.glb --host 0.0.0.0 --token interact=SECRET       others in the network look; with ?token=SECRET they move things
  dapple serve room.glb --host 0.0.0.0 --tls-cert cert.pem --tls-key key.pem
  dapple serve --builtin atrium --spare boulder-0=8 --record session.dapple
  dapple serve --builtin street --area-lights    soft shadows of whatever emits
  dapple serve --builtin street --area-lights=0.5            the same for a third of the bits
  dapple serve --builtin atrium --moq            over QUIC as well (feature moq)
  dapple serve room.glb --relay https://relay.example/dapple?jwt=TOKEN

Ctrl-C or SIGTERM ends it in order. docs/deploy.md tells of more than one machine, docs/live.md specifies the messages.";

#[derive(Debug, Clone, Args)]
pub(crate) struct ServeArgs {
    #[command(flatten)]
    pub(crate) scene: SceneChoice,
    #[command(flatten)]
    pub(crate) light: LightArgs,
    /// Part of the time between two updates that a step may take: rays are rationed by how long they took before. Above 0 to 1;
    /// --ray-budget sets a fixed number instead.
    #[arg(long, value_name = "PART", default_value_t = 0.7)]
    pub(crate) load: f64,
    /// Leaner streams beside the full one, for viewers that ask for fewer bits (?bits=500k): most bits in any second of each.
    #[arg(long, value_name = "BITS/S,…", value_delimiter = ',', default_value = "500k,2M")]
    pub(crate) rungs: Vec<BitRate>,
    /// Begin with scene time standing still.
    #[arg(long)]
    pub(crate) paused: bool,
    /// Spare instances of an object, by the name of its node or of its mesh, which viewers may add to the scene.
    #[arg(long, value_name = "NAME=N")]
    pub(crate) spare: Vec<Named<u32>>,
    /// Keep the light in a recording, by scene time: until the end, or until scene time jumps. What viewers change of the scene is not in it.
    #[arg(long, value_name = "FILE.dapple")]
    pub(crate) record: Option<PathBuf>,
    /// A secret and what it allows: view=SECRET or interact=SECRET. Without any, everyone may do everything; with one for interact alone, the
    /// others may look.
    #[arg(
        long,
        value_name = "ROLE=SECRET",
        env = "DAPPLE_TOKENS",
        value_delimiter = ' ',
        hide_env_values = true
    )]
    pub(crate) token: Vec<Token>,
    /// Trace nothing here, but put together what so many workers trace (dapple worker).
    #[arg(long, value_name = "N", conflicts_with_all = ["max_points", "threads", "bent_normals"])]
    pub(crate) workers: Option<u32>,
    /// A secret that workers must give.
    #[arg(long, value_name = "SECRET", env = "DAPPLE_WORKER_TOKEN", hide_env_values = true)]
    pub(crate) worker_token: Option<String>,
    /// Most viewers at a time.
    #[arg(long, value_name = "N", default_value_t = 1000)]
    pub(crate) max_viewers: u32,
    /// Most events a second of one viewer.
    #[arg(long, value_name = "N", default_value_t = 60)]
    pub(crate) max_events: u32,
    /// Address to listen on; 0.0.0.0 lets others in the network in.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1", env = "DAPPLE_HOST")]
    pub(crate) host: String,
    /// Port to listen on; 0 takes any [default: 8000, or the next that is free].
    #[arg(long, value_name = "PORT", env = "DAPPLE_PORT")]
    pub(crate) port: Option<u16>,
    /// Certificates in PEM for https and wss, the server's own first.
    #[arg(long, value_name = "FILE.pem", requires = "tls_key")]
    pub(crate) tls_cert: Option<PathBuf>,
    /// Their key in PEM.
    #[arg(long, value_name = "FILE.pem", requires = "tls_cert")]
    pub(crate) tls_key: Option<PathBuf>,
    /// Serve over QUIC too (MoQ; browsers: WebTransport), at this UDP port; 0, or no number, takes any. With --tls-cert under that certificate,
    /// otherwise under one made at the start, which viewers of viewer.json trust. Needs the feature moq.
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "0")]
    pub(crate) moq: Option<u16>,
    /// Publish to a MoQ relay, for viewers that it serves: https://RELAY/, with ?jwt=… where it asks for a token, or http://RELAY/ for one that tells
    /// the hash of its certificate. More than once for more relays. Needs the feature moq.
    #[arg(long, value_name = "URL")]
    pub(crate) relay: Vec<String>,
    /// Name of the MoQ broadcast [default: the scene's hash and a random part, told in viewer.json].
    #[arg(long, value_name = "NAME")]
    pub(crate) moq_name: Option<String>,
    /// Address that viewer.json names for MoQ [default: this server's, with --moq; otherwise that of the first relay].
    #[arg(long, value_name = "URL")]
    pub(crate) moq_at: Option<String>,
    /// Folder of the built page [default: target/web].
    #[arg(long, value_name = "DIR")]
    pub(crate) page: Option<PathBuf>,
    /// How lines of the log look.
    #[arg(long, value_enum, default_value = "text")]
    pub(crate) log_format: LogFormat,
    /// Threads that trace; 0 is one for each core.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) threads: usize,
}

/// How lines of the log look.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum LogFormat {
    /// For people.
    Text,
    /// An object a line.
    Json,
}

/// A secret and what it allows.
#[derive(Clone, PartialEq, Eq)]
pub(crate) struct Token {
    pub(crate) role: Role,
    pub(crate) secret: String,
}

impl std::fmt::Debug for Token {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?}=…", self.role)
    }
}

impl FromStr for Token {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let usage = "write view=SECRET or interact=SECRET";
        let (role, secret) = text.split_once('=').ok_or(usage)?;
        let role = match role {
            "view" => Role::View,
            "interact" => Role::Interact,
            _ => return Err(format!("there is no role {role}: {usage}")),
        };
        if secret.is_empty() || secret.len() > 256 {
            return Err("a secret has 1 to 256 bytes".to_owned());
        }
        Ok(Token { role, secret: secret.to_owned() })
    }
}

/// Which part of a scene's instances, and of how many: K/N, from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ShardText(pub(crate) Shard);

impl FromStr for ShardText {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let usage = || {
            format!(
                "write K/N, as in 1/3: the first of three parts, of which there are at most {}",
                Shard::MOST
            )
        };
        let (number, of) = text.split_once('/').ok_or_else(usage)?;
        let number: u32 = number.parse().map_err(|_| usage())?;
        let of: u32 = of.parse().map_err(|_| usage())?;
        if number == 0 || number > of || of > Shard::MOST {
            return Err(usage());
        }
        Ok(ShardText(Shard { number: number - 1, of }))
    }
}

/// NAME=VALUE.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Named<T> {
    pub(crate) name: String,
    pub(crate) value: T,
}

impl<T: FromStr> FromStr for Named<T> {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let usage = || format!("{text}: write NAME=N");
        let (name, value) = text.rsplit_once('=').ok_or_else(usage)?;
        let value = value.parse().map_err(|_| usage())?;
        Ok(Named { name: name.to_owned(), value })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_name_a_role() {
        let token: Token = "interact=a=b".parse().unwrap();
        assert_eq!((token.role, token.secret.as_str()), (Role::Interact, "a=b"));
        assert!(!format!("{token:?}").contains("a=b"));
        for bad in ["", "view", "view=", "root=x", "=x"] {
            assert!(bad.parse::<Token>().is_err(), "{bad}");
        }
    }

    #[test]
    fn parts_count_from_one() {
        assert_eq!("2/3".parse::<ShardText>().unwrap().0, Shard { number: 1, of: 3 });
        for bad in ["0/3", "4/3", "1/0", "1", "1/1000", "-1/2", "a/b"] {
            assert!(bad.parse::<ShardText>().is_err(), "{bad}");
        }
    }

    #[test]
    fn spares_name_an_object() {
        let spare: Named<u32> = "a=b=3".parse().unwrap();
        assert_eq!((spare.name.as_str(), spare.value), ("a=b", 3));
        assert!("a".parse::<Named<u32>>().is_err());
        assert!("a=-1".parse::<Named<u32>>().is_err());
    }
}
