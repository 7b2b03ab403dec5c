//! `viewer.json`: what lies in a folder that a page, or `dapple view --url`, shows.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use serde::{Deserialize, Serialize};

/// Its name in the folder.
pub(crate) const FILE_NAME: &str = "viewer.json";

/// What to show. The page knows more settings; those are left to it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct ViewerJson {
    /// Address of a self-contained scene, relative to the folder.
    pub(crate) scene: String,
    /// Address of its recorded stream.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) stream: Option<String>,
    /// Address of a live session of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) live: Option<String>,
    /// Where the same session is over MoQ.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) moq: Option<MoqJson>,
    /// How far away what blocks may be, metres: of its light, and so of methods that look at the picture alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) radius: Option<f32>,
    /// The animation that plays, if that is not the file's first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) animation: Option<u32>,
    /// Spare instances that the scene gets when it is loaded.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) spares: Vec<Spares>,
}

/// A live session over Media over QUIC.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct MoqJson {
    /// Address of the host itself or of a relay, `https://…`; `{viewer}` in it stands for the viewer's name.
    pub(crate) url: String,
    /// The name of its broadcast.
    pub(crate) name: String,
    /// SHA-256 of its certificate, hexadecimal, where nobody vouches for that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) certificate: Option<String>,
}

/// Stands in an address for the name under which whoever it asked reaches the server.
pub(crate) const HOST: &str = "{host}";

/// Stands in an address for the name that the viewer has drawn.
#[cfg(feature = "moq")]
pub(crate) const VIEWER: &str = "{viewer}";

/// So many spare instances like one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Spares {
    /// The instance.
    pub(crate) instance: u32,
    /// How many.
    pub(crate) count: u32,
}

impl ViewerJson {
    pub(crate) fn parse(bytes: &[u8]) -> Result<ViewerJson> {
        serde_json::from_slice(bytes).context(
            r#"viewer.json must name a scene and a stream: {"scene": "FILE.glb", "stream": "FILE.dapple"}"#,
        )
    }
}

/// The folder of the built page.
pub(crate) fn built_page(given: Option<&Path>) -> Result<PathBuf> {
    let built = |folder: &Path| folder.join("index.html").is_file();
    let advice = "build it with `cargo xtask wasm`, which writes target/web, or name its folder with --page";
    if let Some(folder) = given {
        if !built(folder) {
            bail!("there is no page in {}: {advice}", folder.display());
        }
        return Ok(folder.to_owned());
    }
    let here = PathBuf::from("target/web");
    // Beside this program's own build folder.
    let beside = std::env::current_exe().ok().and_then(|exe| Some(exe.parent()?.parent()?.join("web")));
    [Some(here), beside]
        .into_iter()
        .flatten()
        .find(|folder| built(folder))
        .with_context(|| format!("there is no page in target/web: {advice}"))
}

/// The address of something in the folder at `base`, or elsewhere on its host.
pub(crate) fn resolve(base: &str, address: &str) -> Result<String> {
    let folder = folder_of(base)?;
    if address.contains("://") {
        return Ok(address.to_owned());
    }
    let host_end = folder[7..].find('/').map_or(folder.len(), |at| 7 + at);
    Ok(match address.strip_prefix('/') {
        Some(rooted) => format!("{}/{rooted}", &folder[..host_end]),
        None => format!("{folder}{}", address.strip_prefix("./").unwrap_or(address)),
    })
}

/// The folder that an address lies in, with a slash at its end and without a query.
fn folder_of(address: &str) -> Result<String> {
    let plain = address.split(['?', '#']).next().unwrap_or_default();
    let Some(rest) = plain.strip_prefix("http://") else {
        if plain.starts_with("https://") {
            bail!(
                "{address}: dapple view speaks plain HTTP only; open the page in a browser, or fetch its files"
            );
        }
        bail!("{address} is no address: write http://HOST/FOLDER/");
    };
    if rest.is_empty() || rest.starts_with('/') {
        bail!("{address} names no host: write http://HOST/FOLDER/");
    }
    let last = rest.rfind('/').map_or("", |at| &rest[at + 1..]);
    // A last part with a dot is a file of the folder; the host's name is not a last part.
    Ok(match (plain.ends_with('/'), rest.contains('/') && last.contains('.')) {
        (true, _) => plain.to_owned(),
        (false, true) => plain[..plain.len() - last.len()].to_owned(),
        (false, false) => format!("{plain}/"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_those_a_page_would_fetch() {
        for (base, address, expected) in [
            ("http://host:8000/", "a.glb", "http://host:8000/a.glb"),
            ("http://host:8000", "data/a.glb", "http://host:8000/data/a.glb"),
            ("http://host/demo", "./a.glb", "http://host/demo/a.glb"),
            ("http://host/demo/index.html?paused=1", "a.glb", "http://host/demo/a.glb"),
            ("http://host/demo/x/", "/a.glb", "http://host/a.glb"),
            ("http://my.host", "/a.glb", "http://my.host/a.glb"),
            ("http://host/", "http://other/b.glb", "http://other/b.glb"),
        ] {
            assert_eq!(resolve(base, address).unwrap(), expected, "{base} {address}");
        }
        for bad in ["host/", "https://host/", "http:///x", "", "ftp://host/"] {
            assert!(resolve(bad, "a.glb").is_err(), "{bad}");
        }
    }

    #[test]
    fn other_settings_are_left_to_the_page() {
        let json = br#"{"scene": "a.glb", "stream": "a.dapple", "method": "none", "paused": true}"#;
        let expected =
            ViewerJson { scene: "a.glb".into(), stream: Some("a.dapple".into()), ..ViewerJson::default() };
        assert_eq!(ViewerJson::parse(json).unwrap(), expected);
        assert_eq!(ViewerJson::parse(&serde_json::to_vec(&expected).unwrap()).unwrap(), expected);
        assert!(ViewerJson::parse(br#"{"stream": "a.dapple"}"#).is_err());
    }
}
