//! Arguments of `dapple worker`.

use clap::Args;

use super::serve::ShardText;

pub(crate) const WORKER_EXAMPLES: &str = "\
Examples:
  dapple serve room.glb --workers 2              waits for two workers, puts their light together and serves it
  dapple worker --connect http://127.0.0.1:8000/ --shard 1/2
  dapple worker --connect http://127.0.0.1:8000/ --shard 2/2

Each traces the points of some instances; all instances block rays in each. How it lights is the server's affair. docs/deploy.md tells more.";

#[derive(Debug, Clone, Args)]
pub(crate) struct WorkerArgs {
    /// Address of the server (dapple serve --workers), over plain HTTP.
    #[arg(long, value_name = "URL")]
    pub(crate) connect: String,
    /// Which part of the instances, and of how many: 1/3, 2/3, 3/3.
    #[arg(long, value_name = "K/N")]
    pub(crate) shard: ShardText,
    /// What lets it in (dapple serve --worker-token).
    #[arg(long, value_name = "SECRET", env = "DAPPLE_WORKER_TOKEN", hide_env_values = true)]
    pub(crate) token: Option<String>,
    /// Threads that trace; 0 is one for each core.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) threads: usize,
}
