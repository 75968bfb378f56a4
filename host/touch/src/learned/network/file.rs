//! Networks in files: `safetensors`, checked to the last shape.
//!
//! | tensor | shape |
//! |---|---|
//! | `size_m`, `thickness_m`, `electrodes_m` | 2; 1; n x 2: of the detector it was trained for |
//! | `mean`, `deviation` | features, n^2 + n + 1 |
//! | `hidden_0.weight`, `.bias`, `hidden_1` ... | inputs x outputs; outputs |
//! | `image`, `map` | to as many outputs as a square grid has nodes |
//! | `count` | to two outputs or more, the last of which is one shape |
//! | `total`, `echo` | to one output; to the features |
//! | `seen.log_size`, `seen.echo` | two numbers or more, sizes rising |
//!
//! Numbers are `F16` or `F32`. Metadata: `tactomo` is `network`, `version` is `1`, `detector` is a name.

use safetensors::{Dtype, SafeTensors};

use super::Network;
use super::dense::Dense;
use super::features::Features;

/// What `version` has to be.
const VERSION: &str = "1";
/// Most electrodes, hidden layers, outputs of a layer, and nodes along a side of a grid.
const MOST_ELECTRODES: usize = 64;
const MOST_LAYERS: usize = 8;
const MOST_OUTPUTS: usize = 1 << 14;
const SIDES: std::ops::RangeInclusive<usize> = 4..=128;

/// Why there is no network, or it is not one for a detector.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NetworkError {
    /// The file is no `safetensors`.
    #[error("no network: {0}; `tools/train_network.py` writes networks")]
    Format(String),
    /// The metadata are not those of a network.
    #[error("no network: metadata `{field}` has to be {expected}, not {found}")]
    Metadata {
        /// The field.
        field: &'static str,
        /// What it has to be.
        expected: String,
        /// What it is.
        found: String,
    },
    /// A tensor is missing or wrong.
    #[error("no network: tensor `{tensor}` {what}")]
    Tensor {
        /// Its name.
        tensor: String,
        /// What is wrong and what is needed.
        what: String,
    },
    /// It was trained for another detector.
    #[error(
        "the network was trained for {trained}, and {detector} is another detector: {what}. Choose another solver, or train a network for it: \
         see tools/train_network.py"
    )]
    Detector {
        /// Name of the detector that it was trained for.
        trained: String,
        /// Name of the other one.
        detector: String,
        /// What differs.
        what: String,
    },
}

/// Reads a network.
pub(super) fn read(bytes: &[u8]) -> Result<Network, NetworkError> {
    let detector = metadata(bytes)?;
    let tensors = Tensors(SafeTensors::deserialize(bytes).map_err(format)?);
    let electrodes_m = tensors.pairs("electrodes_m", MOST_ELECTRODES)?;
    let size_m = tensors.positive("size_m", &[2])?;
    let thickness_m = f64::from(tensors.positive("thickness_m", &[1])?[0]);
    let features = Features::count(electrodes_m.len());
    let deviation = tensors.positive("deviation", &[features])?;
    let (mut hidden, mut inputs) = (Vec::new(), features);
    while tensors.has(&format!("hidden_{}.weight", hidden.len())) && hidden.len() < MOST_LAYERS {
        let layer = tensors.layer(&format!("hidden_{}", hidden.len()), inputs)?;
        inputs = layer.outputs();
        hidden.push(layer);
    }
    let [image, map] = [tensors.grid("image", inputs)?, tensors.grid("map", inputs)?];
    let count = tensors.layer("count", inputs)?;
    let [total, echo] = [tensors.layer("total", inputs)?, tensors.layer("echo", inputs)?];
    expect("map.bias", map.outputs() == image.outputs(), || {
        format!("has to be as long as image.bias, {}", image.outputs())
    })?;
    expect("count.bias", count.outputs() >= 2, || "has to have two numbers or more".to_owned())?;
    expect("total.bias", total.outputs() == 1, || "has to have one number".to_owned())?;
    expect("echo.bias", echo.outputs() == features, || format!("has to be as long as the features, {features}"))?;
    Ok(Network {
        detector,
        electrodes_m,
        size_m: [f64::from(size_m[0]), f64::from(size_m[1])],
        thickness_m,
        features: Features::new(tensors.numbers("mean", &[features])?, deviation),
        hidden,
        image,
        map,
        count,
        total,
        echo,
        seen: tensors.seen()?,
    })
}

fn format(error: safetensors::SafeTensorError) -> NetworkError {
    NetworkError::Format(error.to_string())
}

/// Name of the detector, if the metadata are those of a network.
fn metadata(bytes: &[u8]) -> Result<String, NetworkError> {
    let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(format)?;
    let field = |field: &str| metadata.metadata().as_ref().and_then(|fields| fields.get(field).cloned());
    for (name, expected) in [("tactomo", Network::KIND), ("version", VERSION)] {
        let found = field(name);
        if found.as_deref() != Some(expected) {
            let found = found.map_or("missing".to_owned(), |found| format!("`{}`", found.escape_debug()));
            return Err(NetworkError::Metadata { field: name, expected: format!("`{expected}`"), found });
        }
    }
    let missing = || NetworkError::Metadata {
        field: "detector",
        expected: "the name of a detector".to_owned(),
        found: "missing".to_owned(),
    };
    field("detector").ok_or_else(missing)
}

fn expect(tensor: &str, is_right: bool, what: impl FnOnce() -> String) -> Result<(), NetworkError> {
    if is_right { Ok(()) } else { Err(NetworkError::Tensor { tensor: tensor.to_owned(), what: what() }) }
}

struct Tensors<'a>(SafeTensors<'a>);

impl Tensors<'_> {
    fn has(&self, name: &str) -> bool {
        self.0.tensor(name).is_ok()
    }

    fn shape(&self, name: &str) -> Result<Vec<usize>, NetworkError> {
        let missing = |_| NetworkError::Tensor { tensor: name.to_owned(), what: "is missing".to_owned() };
        Ok(self.0.tensor(name).map_err(missing)?.shape().to_vec())
    }

    /// All numbers of a tensor of such a shape.
    fn numbers(&self, name: &str, shape: &[usize]) -> Result<Vec<f32>, NetworkError> {
        let found = self.shape(name)?;
        expect(name, found == shape, || format!("has the shape {found:?}, but has to have {shape:?}"))?;
        let tensor = self.0.tensor(name).map_err(format)?;
        let numbers: Vec<f32> = match tensor.dtype() {
            Dtype::F32 => tensor.data().as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect(),
            Dtype::F16 => {
                tensor.data().as_chunks::<2>().0.iter().map(|bytes| half(u16::from_le_bytes(*bytes))).collect()
            }
            other => {
                return expect(name, false, || format!("is of {other:?}, but F16 or F32 is needed"))
                    .map(|()| Vec::new());
            }
        };
        expect(name, numbers.iter().all(|number| number.is_finite()), || "has a number that is not finite".to_owned())?;
        Ok(numbers)
    }

    fn positive(&self, name: &str, shape: &[usize]) -> Result<Vec<f32>, NetworkError> {
        let numbers = self.numbers(name, shape)?;
        expect(name, numbers.iter().all(|number| *number > 0.0), || "has a number that is not above zero".to_owned())?;
        Ok(numbers)
    }

    /// Two numbers a row, of so many rows at most.
    fn pairs(&self, name: &str, most: usize) -> Result<Vec<[f64; 2]>, NetworkError> {
        let shape = self.shape(name)?;
        let right = matches!(shape[..], [rows, 2] if (1..=most).contains(&rows));
        expect(name, right, || format!("has the shape {shape:?}, but has to have 1 to {most} rows of 2"))?;
        Ok(self.numbers(name, &shape)?.as_chunks::<2>().0.iter().map(|pair| pair.map(f64::from)).collect())
    }

    fn layer(&self, name: &str, inputs: usize) -> Result<Dense, NetworkError> {
        let bias = format!("{name}.bias");
        let shape = self.shape(&bias)?;
        let right = matches!(shape[..], [outputs] if (1..=MOST_OUTPUTS).contains(&outputs));
        expect(&bias, right, || format!("has the shape {shape:?}, but has to have 1 to {MOST_OUTPUTS} numbers"))?;
        let weights = self.numbers(&format!("{name}.weight"), &[inputs, shape[0]])?;
        Ok(Dense::new(weights, self.numbers(&bias, &shape)?))
    }

    /// A layer to the nodes of a square grid.
    fn grid(&self, name: &str, inputs: usize) -> Result<Dense, NetworkError> {
        let layer = self.layer(name, inputs)?;
        let side = layer.outputs().isqrt();
        let right = side * side == layer.outputs() && SIDES.contains(&side);
        let what = || {
            format!("has to have the square of {} to {} numbers, not {}", SIDES.start(), SIDES.end(), layer.outputs())
        };
        expect(&format!("{name}.bias"), right, what)?;
        Ok(layer)
    }

    fn seen(&self) -> Result<Vec<[f32; 2]>, NetworkError> {
        let shape = self.shape("seen.log_size")?;
        let sizes = self.numbers("seen.log_size", &shape)?;
        let rises = sizes.len() >= 2 && sizes.windows(2).all(|pair| pair[0] < pair[1]);
        expect("seen.log_size", shape.len() == 1 && rises, || "has to have two numbers or more that rise".to_owned())?;
        let errors = self.positive("seen.echo", &shape)?;
        Ok(sizes.into_iter().zip(errors).map(|(size, error)| [size, error]).collect())
    }
}

/// A number of 16 bits (IEEE 754), which 32 bits hold exactly: its fields shifted, with the difference of the exponents' offsets made up for.
fn half(bits: u16) -> f32 {
    const EXPONENT: u16 = 0x7C00;
    if bits & EXPONENT == EXPONENT {
        return f32::NAN;
    }
    let magnitude = f32::from_bits(u32::from(bits & 0x7FFF) << 13) * 2f32.powi(127 - 15);
    if bits & 0x8000 == 0 { magnitude } else { -magnitude }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sixteen_bits_are_what_the_standard_says() {
        let cases = [
            (0x0000, 0.0),
            (0x3C00, 1.0),
            (0xC000, -2.0),
            (0x7BFF, 65504.0),
            (0x0001, 5.960_464_5e-8),
            (0x3555, 0.333_251_95),
        ];
        for (bits, value) in cases {
            assert_eq!(half(bits), value, "{bits:#x}");
        }
        assert!(half(0x7C00).is_nan() && half(0xFE00).is_nan(), "nothing that is not finite passes");
    }
}
