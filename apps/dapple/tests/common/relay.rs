//! An unmodified MoQ relay beside the tests.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A relay as it comes, if it is installed.
pub(crate) struct Relay {
    child: Child,
    pub(crate) url: String,
}

impl Relay {
    /// Starts one that dials `up`, if that is given; `None` where there is none to be had.
    pub(crate) fn start(folder: &Path, up: Option<&str>) -> Option<Relay> {
        let built = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("relay").join("bin/moq-relay");
        let program = std::env::var_os("MOQ_RELAY").map_or(built, Into::into);
        if !program.is_file() {
            assert!(
                std::env::var_os("REQUIRE_MOQ_RELAY").is_none_or(|value| value.is_empty() || value == "0"),
                "{} is missing: cargo xtask relay",
                program.display()
            );
            println!("skipped: {} is missing: cargo xtask relay", program.display());
            return None;
        }
        // Free for UDP and TCP alike, until it takes both.
        let port = loop {
            let tcp = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
            let port = tcp.local_addr().unwrap().port();
            if std::net::UdpSocket::bind(("127.0.0.1", port)).is_ok() {
                break port;
            }
        };
        let listen = format!("127.0.0.1:{port}");
        let log = std::fs::File::create(folder.join(format!("relay-{port}.log"))).unwrap();
        let mut command = Command::new(program);
        command.args(["--listen", &listen, "--listen-tls-generate", "localhost,127.0.0.1"]);
        command.args(["--web-http-listen", &listen, "--auth-public", "**"]);
        if let Some(up) = up {
            command.args(["--cluster-connect", up]);
        }
        let child =
            command.stdin(Stdio::null()).stdout(log.try_clone().unwrap()).stderr(log).spawn().unwrap();
        let start = Instant::now();
        while std::net::TcpStream::connect(&listen).is_err() {
            assert!(start.elapsed() < Duration::from_secs(20), "the relay does not listen on {listen}");
            std::thread::sleep(Duration::from_millis(50));
        }
        Some(Relay { child, url: format!("http://{listen}/") })
    }
}

impl Drop for Relay {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
