//! The viewer in a browser tab: the same client as elsewhere, compiled to WebAssembly, behind a small JavaScript handle.
