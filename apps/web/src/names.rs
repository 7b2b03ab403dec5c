//! What JavaScript calls the choices.

use dapple_client::viewer::{DebugView, Method};

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

const METHODS: [(&str, Method); 3] =
    [("psao", Method::Psao), ("psao-paper", Method::PsaoPaper), ("none", Method::None)];

const VIEWS: [(&str, DebugView); 8] = [
    ("beauty", DebugView::Beauty),
    ("visibility", DebugView::Visibility),
    ("normal", DebugView::Normal),
    ("points", DebugView::Points),
    ("texels", DebugView::Texels),
    ("weights", DebugView::Weights),
    ("age", DebugView::Age),
    ("error", DebugView::Error),
];

/// The backend of that name: `auto`, `webgpu`, `webgl2`.
pub fn backend(name: &str) -> Result<Backend, UnknownName> {
    find(&BACKENDS, "backend", name)
}

/// The method of that name: `psao`, `psao-paper`, `none`.
pub fn method(name: &str) -> Result<Method, UnknownName> {
    find(&METHODS, "method", name)
}

/// The view of that name: `beauty`, `visibility`, `normal`, `points`, `texels`, `weights`, `age`, `error`.
pub fn view(name: &str) -> Result<DebugView, UnknownName> {
    find(&VIEWS, "view", name)
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
        assert_eq!(view("age"), Ok(DebugView::Age));
    }

    #[test]
    fn an_unknown_name_lists_those_there_are() {
        let error = backend("vulkan").unwrap_err();
        assert_eq!(error.to_string(), "there is no backend \"vulkan\": choose from auto, webgpu, webgl2");
    }
}
