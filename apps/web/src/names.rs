//! What JavaScript calls the choices.

use dapple_client::viewer::{DebugView, Method};
use dapple_render::Preset;
use dapple_render::screen_space::ScreenKind;

/// Which of a browser's two interfaces to graphics cards draws.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Backend {
    /// WebGPU where it works, else WebGL2.
    #[default]
    Auto,
    /// WebGPU or nothing.
    WebGpu,
    /// WebGL2 or nothing.
    WebGl2,
}

/// A name that stands for nothing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownName {
    /// What was to be chosen.
    pub what: &'static str,
    /// The name that came.
    pub found: String,
    /// The names there are, with commas between them.
    pub known: String,
}

impl std::fmt::Display for UnknownName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "there is no {} \"{}\": choose from {}", self.what, self.found, self.known)
    }
}

impl std::error::Error for UnknownName {}

const BACKENDS: [(&str, Backend); 3] =
    [("auto", Backend::Auto), ("webgpu", Backend::WebGpu), ("webgl2", Backend::WebGl2)];

/// The backend of that name: `auto`, `webgpu`, `webgl2`.
pub fn backend(name: &str) -> Result<Backend, UnknownName> {
    find(&BACKENDS, "backend", name)
}

/// The method of that [name](Method::name).
pub fn method(name: &str) -> Result<Method, UnknownName> {
    find(&Method::ALL.map(|method| (method.name(), method)), "method", name)
}

/// What stands in for points, by the name of a method of screen space; `none` for nothing.
pub fn fallback(name: &str) -> Result<Option<ScreenKind>, UnknownName> {
    let kinds = ScreenKind::ALL.into_iter().map(|kind| (kind.name(), Some(kind)));
    find(&kinds.chain([("none", None)]).collect::<Vec<_>>(), "fallback", name)
}

/// The amount of work of that name: `low`, `medium`, `high`, `ultra`.
pub fn effort(name: &str) -> Result<Preset, UnknownName> {
    find(&Preset::ALL.map(|preset| (preset.name(), preset)), "aoPreset", name)
}

/// The view of that [name](DebugView::name).
pub fn view(name: &str) -> Result<DebugView, UnknownName> {
    find(&DebugView::ALL.map(|view| (view.name(), view)), "view", name)
}

fn find<T: Copy>(table: &[(&str, T)], what: &'static str, name: &str) -> Result<T, UnknownName> {
    match table.iter().find(|(known, _)| *known == name) {
        Some((_, value)) => Ok(*value),
        None => {
            let known = table.iter().map(|(known, _)| *known).collect::<Vec<_>>().join(", ");
            Err(UnknownName { what, found: name.to_owned(), known })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stand_for_choices() {
        assert_eq!(backend("webgl2"), Ok(Backend::WebGl2));
        assert_eq!(method("none"), Ok(Method::None));
        assert_eq!(method("hbao-plus"), Ok(Method::Screen(ScreenKind::HbaoPlus)));
        assert_eq!(view("age"), Ok(DebugView::Age));
        assert_eq!(fallback("sao"), Ok(Some(ScreenKind::Sao)));
        assert_eq!(fallback("none"), Ok(None));
        assert_eq!(effort("low"), Ok(Preset::Low));
        assert!(effort("most").unwrap_err().to_string().ends_with("low, medium, high, ultra"));
        let known = "ssao, alchemy, sao, hbao, hbao-plus, gtao, sd-ssao, sd-hbao, sd-hbao-plus, none";
        assert_eq!(
            fallback("psao").unwrap_err().to_string(),
            format!("there is no fallback \"psao\": choose from {known}")
        );
    }

    #[test]
    fn an_unknown_name_lists_those_there_are() {
        let error = backend("vulkan").unwrap_err();
        assert_eq!(error.to_string(), "there is no backend \"vulkan\": choose from auto, webgpu, webgl2");
    }
}
