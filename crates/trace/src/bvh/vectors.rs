//! Which of the machine's instruction sets a tracer uses.

use fearless_simd::Level;

/// An instruction set for vectors that this machine has.
#[derive(Clone, Copy, Debug)]
pub struct Vectors(pub(super) Level);

impl Vectors {
    /// All that this machine has of those that the tracer is built for, the slowest first. [`crate::Tracer`] takes the
    /// last by itself.
    pub fn all() -> Vec<Vectors> {
        let best = Level::new();
        let mut all = vec![Vectors(Level::baseline())];
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        {
            use fearless_simd::Simd;
            all.extend(best.as_sse4_2().map(|simd| Vectors(simd.level())));
            all.extend(best.as_avx2().map(|simd| Vectors(simd.level())));
            all.extend(best.as_avx512().map(|simd| Vectors(simd.level())));
        }
        let _ = best;
        all
    }

    /// Its usual name.
    pub fn name(&self) -> String {
        // The variants are named after their instruction sets: "Avx2(Avx2 { .. })".
        let name = format!("{:?}", self.0);
        name.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or_default().to_lowercase()
    }
}
