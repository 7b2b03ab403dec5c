//! Methods as `eval` and `render` name them.

use std::str::FromStr;

use crate::screen_space::ScreenSpace;

/// A method as `render` names it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RenderMethod {
    /// Points, reconstructed by moving least squares.
    Psao,
    /// Points, reconstructed by the paper's kernel.
    PsaoHat,
    /// Rays at every pixel: the truth.
    Rtao,
    /// From the picture alone.
    Screen(ScreenSpace),
    None,
}

impl FromStr for RenderMethod {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        match s {
            "psao" => Ok(RenderMethod::Psao),
            "psao-hat" => Ok(RenderMethod::PsaoHat),
            "rtao" => Ok(RenderMethod::Rtao),
            "none" => Ok(RenderMethod::None),
            name => ScreenSpace::from_name(name)
                .map(RenderMethod::Screen)
                .ok_or_else(|| format!("known methods: psao, psao-hat, rtao, {}, none", ScreenSpace::KNOWN)),
        }
    }
}

/// A method as `eval` names it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Method {
    /// Through the visibility atlas.
    Psao,
    /// The same, and direct light of area lights, whose visibility is streamed along.
    Slc,
    /// Least squares at every sample.
    PsaoMls,
    /// With the radius in units of the spacing.
    PsaoHat {
        radius: f32,
    },
    /// The paper's whole scheme, server, wire and client.
    PsaoPaper,
    /// The paper's scheme with least squares at every sample.
    PsaoPaperMls,
    /// Shading atlas streaming, with so many pixels of a side to a texel.
    Sas {
        bias: u32,
    },
    Rtao {
        rays: u32,
    },
    /// From the picture's depth and normals alone.
    Screen(ScreenSpace),
    None,
}

impl Method {
    /// Whether it depends on points and server rate.
    pub(crate) fn uses_points(self) -> bool {
        matches!(self, Method::Psao | Method::Slc | Method::PsaoMls | Method::PsaoHat { .. })
            || self.is_paper()
    }

    /// Whether its server and its stream are the paper's.
    pub(crate) fn is_paper(self) -> bool {
        matches!(self, Method::PsaoPaper | Method::PsaoPaperMls)
    }
}

impl std::fmt::Display for Method {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Method::Psao => write!(f, "psao"),
            Method::Slc => write!(f, "slc"),
            Method::PsaoMls => write!(f, "psao-mls"),
            Method::PsaoHat { radius: 1.0 } => write!(f, "psao-hat"),
            Method::PsaoHat { radius } => write!(f, "psao-hat-{radius}"),
            Method::PsaoPaper => write!(f, "psao-paper"),
            Method::PsaoPaperMls => write!(f, "psao-paper-mls"),
            Method::Sas { bias } => write!(f, "sas-{bias}"),
            Method::Rtao { rays } => write!(f, "rtao-{rays}"),
            Method::Screen(method) => write!(f, "{}", method.name()),
            Method::None => write!(f, "none"),
        }
    }
}

impl FromStr for Method {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        match s {
            "psao" => Ok(Method::Psao),
            "slc" => Ok(Method::Slc),
            "psao-mls" => Ok(Method::PsaoMls),
            "psao-hat" => Ok(Method::PsaoHat { radius: 1.0 }),
            "psao-paper" => Ok(Method::PsaoPaper),
            "psao-paper-mls" => Ok(Method::PsaoPaperMls),
            "none" => Ok(Method::None),
            "rtao" => Ok(Method::Rtao { rays: 16 }),
            _ => {
                if let Some(method) = ScreenSpace::from_name(s) {
                    return Ok(Method::Screen(method));
                }
                let rays = s.strip_prefix("rtao-").and_then(|r| r.parse().ok());
                let radius = s.strip_prefix("psao-hat-").and_then(|r| r.parse::<f32>().ok());
                let bias = s.strip_prefix("sas-").and_then(|b| b.parse().ok());
                match (rays, radius, bias) {
                    (Some(rays @ 1..=65536), ..) => Ok(Method::Rtao { rays }),
                    (_, Some(radius), _) if (0.1..=8.0).contains(&radius) => Ok(Method::PsaoHat { radius }),
                    (.., Some(bias @ 1..=1024)) => Ok(Method::Sas { bias }),
                    _ => Err(format!(
                        "known methods: psao, psao-mls, psao-hat, psao-hat-F with its radius times F from 0.1 to 8, \
                         psao-paper, psao-paper-mls, slc, sas-B with B from 1 to 1024, rtao-R with R from 1 to 65536 (rtao-16), \
                         {}, none",
                        ScreenSpace::KNOWN
                    )),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn methods_are_read_as_they_are_written_and_nonsense_is_refused() {
        assert_eq!("rtao-512".parse(), Ok(Method::Rtao { rays: 512 }));
        let screen = ScreenSpace::ALL.map(Method::Screen);
        for method in [Method::Slc, Method::PsaoPaper, Method::PsaoPaperMls, Method::PsaoHat { radius: 1.5 }]
            .into_iter()
            .chain(screen)
        {
            assert_eq!(method.to_string().parse(), Ok(method));
        }
        for text in ["rtao-0", "rtao-x", "ssao-16", "magic", ""] {
            assert!(text.parse::<Method>().is_err(), "{text}");
        }
    }
}
