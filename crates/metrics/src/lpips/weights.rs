//! Weights out of a safetensors file: every tensor is looked up by name, and its type, shape and numbers are checked.

use safetensors::{Dtype, SafeTensors};

/// Largest file that is looked at; the weights take 2.9 MB.
pub(super) const MAX_BYTES: usize = 16 << 20;

/// Why a file does not give the weights of LPIPS.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WeightsError {
    /// The file is far larger than weights are.
    #[error(
        "{found} bytes are too many for LPIPS weights (at most {maximum}): give the weights of the variant squeeze"
    )]
    TooLarge {
        /// Bytes given.
        found: usize,
        /// Most that are looked at.
        maximum: usize,
    },
    /// The bytes are no safetensors file.
    #[error("these are no LPIPS weights in the safetensors format ({reason}): convert other formats first")]
    Format {
        /// What the reader says.
        reason: String,
    },
    /// There is no tensor of that name.
    #[error(
        "the weights lack the tensor {name}: LPIPS takes SqueezeNet 1.1 with the linear layers of LPIPS v0.1"
    )]
    Missing {
        /// Its name.
        name: String,
    },
    /// The tensor does not consist of 32-bit floats.
    #[error("the tensor {name} is of type {found}, but must be of F32: convert it")]
    Type {
        /// Its name.
        name: String,
        /// Its type, as the file names it.
        found: String,
    },
    /// The tensor belongs to another network.
    #[error(
        "the tensor {name} has the shape {found:?}, but must have {expected:?}: give the weights of the variant squeeze"
    )]
    Shape {
        /// Its name.
        name: String,
        /// Shape in the file.
        found: Vec<usize>,
        /// Shape in the network.
        expected: Vec<usize>,
    },
    /// A number that no such tensor holds.
    #[error("number {index} of the tensor {name} is {value}, but must be {range}: the file is damaged")]
    Value {
        /// The tensor's name.
        name: String,
        /// Index into the tensor.
        index: usize,
        /// The number found.
        value: f32,
        /// Numbers allowed.
        range: &'static str,
    },
}

/// A file whose table of tensors is sound.
pub(super) struct Weights<'a>(SafeTensors<'a>);

impl<'a> Weights<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Result<Weights<'a>, WeightsError> {
        if bytes.len() > MAX_BYTES {
            return Err(WeightsError::TooLarge { found: bytes.len(), maximum: MAX_BYTES });
        }
        let tensors = SafeTensors::deserialize(bytes);
        tensors.map(Weights).map_err(|error| WeightsError::Format { reason: error.to_string() })
    }

    /// The numbers of a tensor, all of them finite.
    pub(super) fn tensor(&self, name: &str, shape: &[usize]) -> Result<Vec<f32>, WeightsError> {
        self.tensor_within(name, shape, "finite", |_| true)
    }

    /// The numbers of a tensor, all of them finite and such that `allowed` holds, which `range` says in words.
    pub(super) fn tensor_within(
        &self,
        name: &str,
        shape: &[usize],
        range: &'static str,
        allowed: impl Fn(f32) -> bool,
    ) -> Result<Vec<f32>, WeightsError> {
        let name = || name.to_owned();
        let tensor = self.0.tensor(&name()).map_err(|_| WeightsError::Missing { name: name() })?;
        if tensor.dtype() != Dtype::F32 {
            return Err(WeightsError::Type { name: name(), found: format!("{:?}", tensor.dtype()) });
        }
        if tensor.shape() != shape {
            let (found, expected) = (tensor.shape().to_vec(), shape.to_vec());
            return Err(WeightsError::Shape { name: name(), found, expected });
        }
        let numbers = tensor.data().as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes));
        let values: Vec<f32> = numbers.collect();
        match values.iter().position(|v| !v.is_finite() || !allowed(*v)) {
            Some(index) => Err(WeightsError::Value { name: name(), index, value: values[index], range }),
            None => Ok(values),
        }
    }
}
