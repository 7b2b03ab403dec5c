//! What arguments of several verbs are written as: sizes, lengths, cameras.

use std::str::FromStr;

use dapple_scene::glam::Vec3;

/// Picture size.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Size {
    pub(crate) width: u32,
    pub(crate) height: u32,
}

impl FromStr for Size {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let parsed = s.split_once(['x', 'X']).and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
        match parsed {
            Some((width @ 1..=16384, height @ 1..=16384)) => Ok(Size { width, height }),
            _ => Err("write WIDTHxHEIGHT in pixels, each 1 to 16384, as in 1280x720".into()),
        }
    }
}

impl std::fmt::Display for Size {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

/// Occlusion distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Radius {
    Auto,
    Metres(f32),
}

impl FromStr for Radius {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        if s == "auto" {
            return Ok(Radius::Auto);
        }
        match s.parse::<f32>() {
            Ok(m) if m.is_finite() && m > 0.0 => Ok(Radius::Metres(m)),
            _ => Err("write a length in metres above 0, or auto".into()),
        }
    }
}

/// A camera given on the command line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CameraText {
    pub(crate) eye: Vec3,
    pub(crate) target: Vec3,
    pub(crate) fov_degrees: f32,
}

impl FromStr for CameraText {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let help = || format!("'{s}' is no camera: write eye=X,Y,Z,target=X,Y,Z,fov=DEGREES");
        // Commas separate both numbers and keys: a part with `=` opens the next key.
        let mut groups: Vec<(&str, Vec<f32>)> = Vec::new();
        for part in s.split(',') {
            let number = match part.split_once('=') {
                Some((key, number)) => {
                    groups.push((key.trim(), Vec::new()));
                    number
                }
                None => part,
            };
            let number = number.trim().parse::<f32>().ok().filter(|n| n.is_finite()).ok_or_else(help)?;
            groups.last_mut().ok_or_else(help)?.1.push(number);
        }
        let (mut eye, mut target, mut fov) = (None, None, 60.0f32);
        for (key, numbers) in groups {
            match (key, numbers.as_slice()) {
                ("eye", &[x, y, z]) => eye = Some(Vec3::new(x, y, z)),
                ("target", &[x, y, z]) => target = Some(Vec3::new(x, y, z)),
                ("fov", &[degrees]) if degrees > 0.0 && degrees < 180.0 => fov = degrees,
                _ => return Err(help()),
            }
        }
        match (eye, target) {
            (Some(eye), Some(target)) if eye != target => Ok(CameraText { eye, target, fov_degrees: fov }),
            _ => Err(help()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_are_read_in_any_order() {
        let expected = CameraText { eye: Vec3::new(1.0, -2.5, 30.0), target: Vec3::ZERO, fov_degrees: 45.0 };
        for text in ["eye=1,-2.5,3e1,target=0,0,0,fov=45", "fov=45,target=0,0,0,eye=1,-2.5,30"] {
            assert_eq!(text.parse(), Ok(expected), "{text}");
        }
        for text in [
            "",
            "eye=1,2,target=0,0,0",
            "eye=0,0,0,target=0,0,0",
            "eye=1,2,3",
            "eye=a,b,c,target=0,0,0",
            "fov=190",
        ] {
            assert!(text.parse::<CameraText>().is_err(), "{text}");
        }
    }

    #[test]
    fn sizes_and_radii_refuse_nonsense() {
        assert_eq!("640x360".parse(), Ok(Size { width: 640, height: 360 }));
        for text in ["0x1", "640", "640x", "99999x1", "-1x2"] {
            assert!(text.parse::<Size>().is_err(), "{text}");
        }
        assert_eq!("auto".parse(), Ok(Radius::Auto));
        for text in ["0", "-1", "nan", "inf", "wide"] {
            assert!(text.parse::<Radius>().is_err(), "{text}");
        }
    }
}
