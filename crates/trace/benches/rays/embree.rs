//! Embree 4 through its C interface, loaded at run time: the one place of this workspace with unsafe code.
//!
//! # Why this is sound
//!
//! - **Layout.** The structures below repeat `rtcore_ray.h` and `rtcore_scene.h` of Embree 4; sizes are checked when
//!   this compiles, the major version when the library is loaded. One alignment, 64 bytes, serves all packet widths.
//! - **Functions.** Each signature is that of `rtcore_*.h`. The library is never unloaded.
//! - **Lifetimes.** A [`Scene`] keeps its [`Device`] and the buffers that Embree reads (with 16 readable bytes after
//!   the last vertex), a [`Device`] the counters that the memory monitor writes to. Each is released once, in `drop`.
//! - **Threads.** Embree allows queries of a committed scene from any number of threads, and a [`Scene`] is committed
//!   before anybody gets it and never changed. The memory monitor is called from Embree's threads and only touches atomics.
//! - **Bounds.** Indices of triangles are checked against the number of vertices before Embree sees them.
#![allow(unsafe_code)]

use std::ffi::{CString, c_char, c_int, c_uint, c_void};
use std::mem::ManuallyDrop;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicIsize, Ordering};

use anyhow::{Context, Result, bail};
use dapple_scene::glam::Vec3;
use libloading::Library;

use crate::rays::{Directions, RAYS};

type Handle = *mut c_void;
type Monitor = unsafe extern "C" fn(*mut c_void, isize, bool) -> bool;
type Occluded<const N: usize> =
    unsafe extern "C" fn(*const c_int, Handle, *mut Packet<N>, *mut OccludedArguments);

const VERSION_MAJOR: c_int = 1;
const NATIVE_RAY8: c_int = 33;
const NATIVE_RAY16: c_int = 34;
const GEOMETRY_TRIANGLE: c_int = 0;
const BUFFER_INDEX: c_int = 0;
const BUFFER_VERTEX: c_int = 1;
const FORMAT_UINT3: c_int = 0x5003;
const FORMAT_FLOAT3: c_int = 0x9003;
const QUERY_COHERENT: c_int = 1 << 16;
const FEATURES_ALL: c_uint = u32::MAX;

/// `RTCRay`, `RTCRay8`, `RTCRay16`: the same fields, N numbers each.
#[repr(C, align(64))]
struct Packet<const N: usize> {
    origin: [[f32; N]; 3],
    t_near: [f32; N],
    direction: [[f32; N]; 3],
    time: [f32; N],
    /// −∞ after a query that found the ray blocked.
    t_far: [f32; N],
    mask: [c_uint; N],
    id: [c_uint; N],
    flags: [c_uint; N],
}

const _: () = assert!(std::mem::offset_of!(Packet<1>, flags) == 44 && size_of::<Packet<1>>() == 64);
const _: () = assert!(std::mem::offset_of!(Packet<8>, t_far) == 256 && size_of::<Packet<8>>() == 384);
const _: () = assert!(std::mem::offset_of!(Packet<16>, t_far) == 512 && size_of::<Packet<16>>() == 768);

#[repr(C, align(64))]
struct Valid<const N: usize>([c_int; N]);

#[repr(C)]
struct OccludedArguments {
    flags: c_int,
    feature_mask: c_uint,
    context: *mut c_void,
    filter: *mut c_void,
    occluded: *mut c_void,
    /// Read only by an Embree that was built with a least width of curves.
    min_width_distance_factor: f32,
}

macro_rules! functions {
    ($($name:ident = $symbol:literal: $signature:ty,)*) => {
        struct Functions { $($name: $signature,)* }

        impl Functions {
            /// # Safety
            /// `library` must be Embree 4.
            unsafe fn load(library: &Library) -> Result<Functions, libloading::Error> {
                // SAFETY: the signatures are those of the header; the caller vouches for the library.
                unsafe { Ok(Functions { $($name: *library.get::<$signature>($symbol)?,)* }) }
            }
        }
    };
}

functions! {
    new_device = b"rtcNewDevice\0": unsafe extern "C" fn(*const c_char) -> Handle,
    release_device = b"rtcReleaseDevice\0": unsafe extern "C" fn(Handle),
    device_error = b"rtcGetDeviceError\0": unsafe extern "C" fn(Handle) -> c_int,
    device_property = b"rtcGetDeviceProperty\0": unsafe extern "C" fn(Handle, c_int) -> isize,
    monitor_memory = b"rtcSetDeviceMemoryMonitorFunction\0": unsafe extern "C" fn(Handle, Monitor, *mut c_void),
    new_scene = b"rtcNewScene\0": unsafe extern "C" fn(Handle) -> Handle,
    release_scene = b"rtcReleaseScene\0": unsafe extern "C" fn(Handle),
    set_quality = b"rtcSetSceneBuildQuality\0": unsafe extern "C" fn(Handle, c_int),
    set_flags = b"rtcSetSceneFlags\0": unsafe extern "C" fn(Handle, c_int),
    commit_scene = b"rtcCommitScene\0": unsafe extern "C" fn(Handle),
    join_commit_scene = b"rtcJoinCommitScene\0": unsafe extern "C" fn(Handle),
    new_geometry = b"rtcNewGeometry\0": unsafe extern "C" fn(Handle, c_int) -> Handle,
    release_geometry = b"rtcReleaseGeometry\0": unsafe extern "C" fn(Handle),
    set_buffer = b"rtcSetSharedGeometryBuffer\0":
        unsafe extern "C" fn(Handle, c_int, c_uint, c_int, *const c_void, usize, usize, usize),
    commit_geometry = b"rtcCommitGeometry\0": unsafe extern "C" fn(Handle),
    attach_geometry = b"rtcAttachGeometry\0": unsafe extern "C" fn(Handle, Handle) -> c_uint,
    occluded1 = b"rtcOccluded1\0": unsafe extern "C" fn(Handle, *mut Packet<1>, *mut OccludedArguments),
    occluded8 = b"rtcOccluded8\0": Occluded<8>,
    occluded16 = b"rtcOccluded16\0": Occluded<16>,
}

/// The library. It stays loaded to the end of the process, because its threads may outlive its devices.
pub(crate) struct Embree {
    functions: Functions,
    _library: ManuallyDrop<Library>,
}

impl Embree {
    /// Loads the library from its file, or from a folder that holds it (or whose `embreex.libs` does).
    pub(crate) fn load(path: &Path) -> Result<Arc<Embree>> {
        let file = library_file(path)?;
        let shown = file.display();
        // SAFETY: code of the library runs when it is loaded; whoever names it asks for that.
        let library = unsafe { Library::new(&file) }.with_context(|| {
            format!("{shown} cannot be loaded as a library (its libtbb must lie in the same folder)")
        })?;
        // SAFETY: a library that has all these symbols is Embree; its version is checked below, by a function that all
        // versions have in common.
        let functions = unsafe { Functions::load(&library) }
            .with_context(|| format!("{shown} is a library, but not Embree 4"))?;
        let embree = Arc::new(Embree { functions, _library: ManuallyDrop::new(library) });
        let major = Device::new(&embree, 1)?.property(VERSION_MAJOR);
        if major != 4 {
            bail!("{shown} is Embree {major}; this bench speaks to Embree 4");
        }
        Ok(embree)
    }
}

/// The library itself: wheels give it a name that ends in a checksum.
fn library_file(path: &Path) -> Result<PathBuf> {
    if !path.is_dir() {
        if !path.exists() {
            let here = std::env::current_dir().unwrap_or_default();
            bail!("there is no {} (Embree's library; seen from {})", path.display(), here.display());
        }
        // A name without a folder would be looked for in the system's folders.
        return path.canonicalize().with_context(|| format!("cannot find {}", path.display()));
    }
    for folder in [path.to_owned(), path.join("embreex.libs")] {
        let Ok(entries) = std::fs::read_dir(folder) else { continue };
        let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
        files.sort();
        let is_embree = |file: &PathBuf| {
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            name.trim_start_matches("lib").starts_with("embree4")
                && [".so", ".dll", ".dylib"].iter().any(|extension| name.contains(extension))
        };
        if let Some(file) = files.into_iter().find(is_embree) {
            return file.canonicalize().with_context(|| format!("cannot find {}", file.display()));
        }
    }
    bail!("the folder {} holds no libembree4", path.display());
}

/// What the memory monitor counts.
#[derive(Default)]
struct Memory {
    bytes: AtomicIsize,
    most: AtomicIsize,
}

unsafe extern "C" fn count_memory(memory: *mut c_void, bytes: isize, _post: bool) -> bool {
    // SAFETY: this is the pointer that `Device::new` gave, to counters that live as long as the device.
    let memory = unsafe { &*memory.cast::<Memory>() };
    let now = memory.bytes.fetch_add(bytes, Ordering::Relaxed) + bytes;
    memory.most.fetch_max(now, Ordering::Relaxed);
    true
}

/// A device: its threads are those that build.
pub(crate) struct Device {
    embree: Arc<Embree>,
    handle: Handle,
    /// Whether one thread builds.
    alone: bool,
    memory: Box<Memory>,
}

// SAFETY: Embree's devices may be used from any thread.
unsafe impl Send for Device {}
// SAFETY: as above.
unsafe impl Sync for Device {}

impl Device {
    /// A device that builds with so many threads, 0 for all. Queries always run on the threads that ask.
    pub(crate) fn new(embree: &Arc<Embree>, threads: usize) -> Result<Arc<Device>> {
        let config = CString::new(if threads == 0 { String::new() } else { format!("threads={threads}") })?;
        let functions = &embree.functions;
        // SAFETY: `config` is a C string that lives through the call.
        let handle = unsafe { (functions.new_device)(config.as_ptr()) };
        if handle.is_null() {
            // SAFETY: null asks for the error of a failed creation.
            let error = unsafe { (functions.device_error)(handle) };
            bail!("Embree makes no device here: {}", error_name(error));
        }
        let (embree, alone) = (Arc::clone(embree), threads == 1);
        let device = Device { embree, handle, alone, memory: Box::default() };
        let (memory, functions): (*const Memory, _) = (&*device.memory, &device.embree.functions);
        // SAFETY: the counters are boxed and live as long as the device, which its drop releases first.
        unsafe { (functions.monitor_memory)(handle, count_memory, memory.cast_mut().cast()) };
        Ok(Arc::new(device))
    }

    fn property(&self, property: c_int) -> isize {
        // SAFETY: the device lives.
        unsafe { (self.embree.functions.device_property)(self.handle, property) }
    }

    /// Whether packets of 8 and of 16 rays are traced as packets; otherwise Embree takes them apart.
    pub(crate) fn native_packets(&self) -> [bool; 2] {
        [NATIVE_RAY8, NATIVE_RAY16].map(|property| self.property(property) != 0)
    }

    fn check(&self, doing: &str) -> Result<()> {
        // SAFETY: the device lives.
        match unsafe { (self.embree.functions.device_error)(self.handle) } {
            0 => Ok(()),
            error => bail!("Embree failed {doing}: {}", error_name(error)),
        }
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: released once, and before the counters and the library.
        unsafe { (self.embree.functions.release_device)(self.handle) };
    }
}

fn error_name(error: c_int) -> &'static str {
    let names = [
        "no error",
        "unknown error",
        "invalid argument",
        "invalid operation",
        "out of memory",
        "unsupported processor",
        "cancelled",
    ];
    usize::try_from(error).ok().and_then(|i| names.get(i)).copied().unwrap_or("an error without a name")
}

/// `RTCBuildQuality`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Quality {
    Medium = 1,
    High = 2,
}

/// `RTCSceneFlags`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SceneFlags {
    Fastest = 0,
    Robust = 1 << 2,
}

/// What Embree reads while it builds.
pub(crate) struct Geometry {
    /// One more than there are, because Embree reads 16 bytes at each.
    vertices: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl Geometry {
    pub(crate) fn new(positions: &[Vec3], triangles: &[[u32; 3]]) -> Result<Arc<Geometry>> {
        if triangles.iter().flatten().any(|&i| i as usize >= positions.len()) {
            bail!("a triangle names a vertex that is not there");
        }
        let vertices = positions.iter().copied().chain([Vec3::ZERO]).map(|v| v.to_array()).collect();
        Ok(Arc::new(Geometry { vertices, triangles: triangles.to_vec() }))
    }
}

/// A committed scene of one triangle mesh.
pub(crate) struct Scene {
    device: Arc<Device>,
    handle: Handle,
    _geometry: Arc<Geometry>,
}

// SAFETY: a committed scene is only read, from any thread.
unsafe impl Send for Scene {}
// SAFETY: as above.
unsafe impl Sync for Scene {}

impl Scene {
    /// Builds: everything that counts as Embree's building time.
    pub(crate) fn new(
        device: &Arc<Device>,
        geometry: &Arc<Geometry>,
        quality: Quality,
        flags: SceneFlags,
    ) -> Result<Scene> {
        let f = &device.embree.functions;
        // SAFETY: handles are used in their lifetimes; buffers are as long as is said here and are kept by the scene.
        unsafe {
            let handle = (f.new_scene)(device.handle);
            device.check("making a scene")?;
            let scene = Scene { device: Arc::clone(device), handle, _geometry: Arc::clone(geometry) };
            (f.set_quality)(handle, quality as c_int);
            (f.set_flags)(handle, flags as c_int);
            let mesh = (f.new_geometry)(device.handle, GEOMETRY_TRIANGLE);
            let buffer = |kind, format, at, items| {
                (f.set_buffer)(mesh, kind, 0, format, at, 0, size_of::<[f32; 3]>(), items);
            };
            let (vertices, triangles) = (&geometry.vertices, &geometry.triangles);
            buffer(BUFFER_VERTEX, FORMAT_FLOAT3, vertices.as_ptr().cast(), vertices.len() - 1);
            buffer(BUFFER_INDEX, FORMAT_UINT3, triangles.as_ptr().cast(), triangles.len());
            (f.commit_geometry)(mesh);
            (f.attach_geometry)(handle, mesh);
            (f.release_geometry)(mesh);
            // Where one thread is to build, it does so itself: Embree's own way is a task of its scheduler, one of whose
            // threads then spins on, next to whatever is measured later.
            (if device.alone { f.join_commit_scene } else { f.commit_scene })(handle);
            device.check("building")?;
            Ok(scene)
        }
    }

    /// Bytes that the scene's device holds now, and the most it held. What it was given (vertices, indices) is not in it.
    pub(crate) fn memory(&self) -> (usize, usize) {
        let of = |bytes: &AtomicIsize| bytes.load(Ordering::Relaxed).max(0) as usize;
        (of(&self.device.memory.bytes), of(&self.device.memory.most))
    }

    /// Which of a point's rays are blocked, asked in packets of `N`: 1, 8 or 16.
    #[inline]
    pub(crate) fn occlusion<const N: usize>(
        &self,
        origin: Vec3,
        directions: &Directions,
        t_max: f32,
        coherent: bool,
    ) -> u64 {
        const { assert!((N == 1 || N == 8 || N == 16) && RAYS == 64) };
        let f = &self.device.embree.functions;
        let mut arguments = OccludedArguments {
            flags: if coherent { QUERY_COHERENT } else { 0 },
            feature_mask: FEATURES_ALL,
            context: std::ptr::null_mut(),
            filter: std::ptr::null_mut(),
            occluded: std::ptr::null_mut(),
            min_width_distance_factor: 0.0,
        };
        let valid = Valid([-1; N]);
        let mut packet = Packet::<N> {
            origin: origin.to_array().map(|x| [x; N]),
            t_near: [0.0; N],
            direction: [[0.0; N]; 3],
            time: [0.0; N],
            t_far: [t_max; N],
            mask: [u32::MAX; N],
            id: [0; N],
            flags: [0; N],
        };
        let mut blocked = 0;
        for first in (0..RAYS).step_by(N) {
            for (to, from) in packet.direction.iter_mut().zip(directions) {
                to.copy_from_slice(&from[first..first + N]);
            }
            packet.t_far = [t_max; N];
            let (valid, packet_at) = (valid.0.as_ptr(), &raw mut packet);
            // SAFETY: the packet is N wide (so the cast changes nothing), aligned, and lives through the call, as
            // `valid` and `arguments` do; the scene is committed.
            unsafe {
                match N {
                    1 => (f.occluded1)(self.handle, packet_at.cast(), &raw mut arguments),
                    8 => (f.occluded8)(valid, self.handle, packet_at.cast(), &raw mut arguments),
                    _ => (f.occluded16)(valid, self.handle, packet_at.cast(), &raw mut arguments),
                }
            }
            for (lane, t_far) in packet.t_far.iter().enumerate() {
                blocked |= u64::from(*t_far < 0.0) << (first + lane);
            }
        }
        blocked
    }
}

impl Drop for Scene {
    fn drop(&mut self) {
        // SAFETY: released once, and before its device and buffers.
        unsafe { (self.device.embree.functions.release_scene)(self.handle) };
    }
}
