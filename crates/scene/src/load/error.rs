//! What can be wrong with a scene file, said so that its owner can put it right.

/// Why a scene could not be loaded. Every message names the file, the object in it, and what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LoadError {
    /// Nothing in it.
    #[error("{file}: the file is empty; check that it was exported or downloaded completely")]
    Empty {
        /// The scene file.
        file: String,
    },
    /// Neither its first bytes nor its name belong to a supported format.
    #[error(
        "{file}: not a supported scene format; supported are glTF 2.0 (.glb, .gltf) and Wavefront OBJ (.obj): \
         export or convert the scene to one of them"
    )]
    UnknownFormat {
        /// The scene file.
        file: String,
    },
    /// The binary glTF container is damaged.
    #[error("{file}: damaged GLB container: {problem}; export or download the file again")]
    Container {
        /// The scene file.
        file: String,
        /// What is wrong with it.
        problem: String,
    },
    /// The JSON text cannot be parsed.
    #[error("{file}: not valid JSON: {problem}; export the file again, or mend it in a text editor")]
    Json {
        /// The scene file.
        file: String,
        /// The parser's complaint with line and column.
        problem: String,
    },
    /// Not glTF 2.
    #[error("{file}: glTF version {found}, but only 2.0 can be read; export the scene as glTF 2.0")]
    Version {
        /// The scene file.
        file: String,
        /// The version it claims.
        found: String,
    },
    /// The file says that it makes no sense without an extension that is not supported.
    #[error("{file}: requires the glTF extension {extension}, which is not supported; {remedy}")]
    RequiredExtension {
        /// The scene file.
        file: String,
        /// The extension's name.
        extension: String,
        /// What to do.
        remedy: &'static str,
    },
    /// JSON, but not as glTF lays it out: a value of the wrong type, or one that is absent.
    #[error("{file}: {at}: {problem}; export the file again with another tool, or mend it")]
    Schema {
        /// The scene file.
        file: String,
        /// Which value: a path such as `meshes[0].primitives`.
        at: String,
        /// The parser's complaint, with line and column where it knows them.
        problem: String,
    },
    /// A property that glTF demands is absent.
    #[error("{file}: {at} has no {property}, which glTF demands; export the file again, or add it")]
    Missing {
        /// The scene file.
        file: String,
        /// Which object.
        at: String,
        /// The absent property.
        property: &'static str,
    },
    /// A reference to something that does not exist.
    #[error(
        "{file}: {at} refers to {what} {index}, but there are only {count}, counted from 0; export the file again"
    )]
    OutOfRange {
        /// The scene file.
        file: String,
        /// Which reference.
        at: String,
        /// Kind of thing referred to.
        what: &'static str,
        /// The reference.
        index: u64,
        /// How many there are.
        count: u64,
    },
    /// Anything else that makes no sense.
    #[error("{file}: {at}: {problem}")]
    Invalid {
        /// The scene file.
        file: String,
        /// Which object.
        at: String,
        /// What is wrong and what to do.
        problem: String,
    },
    /// NaN, infinity, or so large that computing with it overflows.
    #[error(
        "{file}: {at} is not a finite number (or beyond ±1e15); look for collapsed or exploded geometry there and export again"
    )]
    NotFinite {
        /// The scene file.
        file: String,
        /// Which number.
        at: String,
    },
    /// Fewer bytes than claimed.
    #[error(
        "{file}: {at} needs {needs_bytes} bytes, but only {has_bytes} are there; \
         the data is cut off or its sizes are wrong: export or download it again"
    )]
    Truncated {
        /// The scene file.
        file: String,
        /// Which object.
        at: String,
        /// Claimed.
        needs_bytes: u64,
        /// Present.
        has_bytes: u64,
    },
    /// More memory than the loader is willing to give to a file of this size.
    #[error(
        "{file}: {at} would take {bytes} bytes more, beyond the limit of {limit_bytes} for data of this size; \
         the file repeats the same data too often or claims data it does not have: split or re-export it"
    )]
    TooLarge {
        /// The scene file.
        file: String,
        /// Which object.
        at: String,
        /// What it asks for.
        bytes: u64,
        /// The limit for the whole scene.
        limit_bytes: u64,
    },
    /// A node is its own ancestor.
    #[error("{file}: {node} is its own ancestor; remove it from the children of one of its descendants")]
    NodeCycle {
        /// The scene file.
        file: String,
        /// A node of the cycle.
        node: String,
    },
    /// A node is the child of two nodes.
    #[error(
        "{file}: {node} is a child of both {first} and {second}; a node may have one parent: duplicate it"
    )]
    NodeTwoParents {
        /// The scene file.
        file: String,
        /// The node.
        node: String,
        /// One parent.
        first: String,
        /// The other parent.
        second: String,
    },
    /// A reference to a file that is not allowed.
    #[error("{file}: {at} names '{uri}', {problem}")]
    Uri {
        /// The scene file.
        file: String,
        /// Which object.
        at: String,
        /// The reference (shortened).
        uri: String,
        /// Why it is not read, and what to do.
        problem: String,
    },
    /// A file the scene refers to could not be read.
    #[error("{file}: {at} needs the file '{uri}', which cannot be read ({source}); put it beside {file}")]
    Read {
        /// The scene file.
        file: String,
        /// Which object.
        at: String,
        /// The file.
        uri: String,
        /// The reason.
        source: std::io::Error,
    },
}
