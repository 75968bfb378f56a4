//! Named arrays and texts, as safetensors keeps them.

use std::collections::BTreeMap;

use safetensors::tensor::{Dtype, TensorView};
use safetensors::{SafeTensors, serialize};

/// What a file of something learned holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Container {
    texts: BTreeMap<String, String>,
    arrays: BTreeMap<String, (Vec<usize>, Vec<f64>)>,
}

/// Why bytes, or what is in them, are not what was learned.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ContainerError {
    /// They are no such file, or a damaged one.
    #[error("this is no safetensors file, or it is damaged ({0}): make one with `tactomo-lab learn`")]
    Format(String),
    /// It is a network that cannot be used.
    #[error(transparent)]
    Network(#[from] super::network::NetworkError),
    /// It is of another kind, or of another version of this program.
    #[error(
        "a `{kind}` of version {version} is not known to this program: learn it anew, or use the program that made it"
    )]
    Unknown {
        /// Its kind.
        kind: String,
        /// Its version.
        version: String,
    },
    /// A text or an array that is not there.
    #[error("`{0}` is missing: the file was not made by `tactomo-lab learn`, or it is damaged")]
    Missing(String),
    /// An array of another shape, or of other numbers.
    #[error("`{name}` has {found}, but {needed} is needed: the file is damaged")]
    Shape {
        /// Its name.
        name: String,
        /// Its shape or numbers.
        found: String,
        /// What is needed.
        needed: String,
    },
    /// A number or text that cannot be.
    #[error("`{name}` cannot be right: {what} is needed; the file is damaged")]
    Value {
        /// Its name.
        name: String,
        /// What is needed.
        what: String,
    },
}

impl Container {
    /// Reads the bytes of a file. Arrays are of single or double precision.
    ///
    /// # Errors
    /// [`ContainerError`] if it is no safetensors file, or if a number is not finite.
    pub fn parse(bytes: &[u8]) -> Result<Self, ContainerError> {
        let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(format)?;
        let tensors = SafeTensors::deserialize(bytes).map_err(format)?;
        let texts = metadata.metadata().iter().flatten();
        let mut container =
            Self { texts: texts.map(|(name, text)| (name.clone(), text.clone())).collect(), arrays: BTreeMap::new() };
        for (name, tensor) in tensors.iter() {
            container.arrays.insert(name.to_owned(), (tensor.shape().to_vec(), numbers(name, &tensor)?));
        }
        Ok(container)
    }

    /// The bytes of a file; arrays are of double precision.
    ///
    /// # Errors
    /// [`ContainerError::Format`] if there is more than a file can hold.
    pub fn bytes(&self) -> Result<Vec<u8>, ContainerError> {
        let raw = |values: &[f64]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
        let all: Vec<(&String, &Vec<usize>, Vec<u8>)> =
            self.arrays.iter().map(|(name, (shape, values))| (name, shape, raw(values))).collect();
        let views = all.iter().map(|(name, shape, bytes)| {
            Ok((name.as_str(), TensorView::new(Dtype::F64, (*shape).clone(), bytes).map_err(format)?))
        });
        let views = views.collect::<Result<Vec<_>, ContainerError>>()?;
        serialize(views, Some(self.texts.clone().into_iter().collect())).map_err(format)
    }

    /// Sets a text.
    pub fn set_text(&mut self, name: &str, text: impl Into<String>) {
        self.texts.insert(name.to_owned(), text.into());
    }

    /// Sets an array of a shape.
    pub fn set_array(&mut self, name: &str, shape: &[usize], values: &[f64]) {
        self.arrays.insert(name.to_owned(), (shape.to_vec(), values.to_vec()));
    }

    /// A text.
    ///
    /// # Errors
    /// [`ContainerError::Missing`].
    pub fn text(&self, name: &str) -> Result<&str, ContainerError> {
        self.texts.get(name).map(String::as_str).ok_or_else(|| ContainerError::Missing(name.to_owned()))
    }

    /// Whether there is a text.
    pub fn has_text(&self, name: &str) -> bool {
        self.texts.contains_key(name)
    }

    /// A text that is a finite number, which `is_right`.
    ///
    /// # Errors
    /// [`ContainerError`] if it is missing or not as `what` says.
    pub fn number(&self, name: &str, is_right: impl Fn(f64) -> bool, what: &str) -> Result<f64, ContainerError> {
        let number: Option<f64> = self.text(name)?.parse().ok();
        number.filter(|number| number.is_finite() && is_right(*number)).ok_or_else(|| wrong(name, what))
    }

    /// A text that is a whole number up to `most`.
    ///
    /// # Errors
    /// [`ContainerError`] if it is missing or something else.
    pub fn count(&self, name: &str, most: usize) -> Result<usize, ContainerError> {
        let number: Option<usize> = self.text(name)?.parse().ok();
        number.filter(|number| *number <= most).ok_or_else(|| wrong(name, &format!("a number up to {most}")))
    }

    /// Lengths of the axes of an array.
    ///
    /// # Errors
    /// [`ContainerError`] if it is missing, or has another number of axes.
    pub fn shape<const AXES: usize>(&self, name: &str) -> Result<[usize; AXES], ContainerError> {
        let (shape, _) = self.arrays.get(name).ok_or_else(|| ContainerError::Missing(name.to_owned()))?;
        shape.as_slice().try_into().map_err(|_| shape_error(name, shape, &format!("{AXES} axes")))
    }

    /// The numbers of an array of this shape, all of them finite, the last axis running fastest.
    ///
    /// # Errors
    /// [`ContainerError`] if it is missing or of another shape.
    pub fn array(&self, name: &str, needed: &[usize]) -> Result<&[f64], ContainerError> {
        let (shape, values) = self.arrays.get(name).ok_or_else(|| ContainerError::Missing(name.to_owned()))?;
        match shape == needed {
            true => Ok(values),
            false => Err(shape_error(name, shape, &shape_text(needed))),
        }
    }

    /// The numbers of an array of this shape, if all of them are right.
    ///
    /// # Errors
    /// [`ContainerError`] also if one is not as `what` says.
    pub fn checked(
        &self,
        name: &str,
        needed: &[usize],
        is_right: impl Fn(f64) -> bool,
        what: &str,
    ) -> Result<&[f64], ContainerError> {
        let values = self.array(name, needed)?;
        if values.iter().all(|value| is_right(*value)) { Ok(values) } else { Err(wrong(name, what)) }
    }
}

fn format(error: safetensors::SafeTensorError) -> ContainerError {
    ContainerError::Format(error.to_string())
}

/// A text in the bytes of a file, whose arrays are not read; `None` if there is none of that name.
///
/// # Errors
/// [`ContainerError::Format`] if it is no safetensors file.
pub fn text(bytes: &[u8], name: &str) -> Result<Option<String>, ContainerError> {
    let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(format)?;
    Ok(metadata.metadata().as_ref().and_then(|texts| texts.get(name).cloned()))
}

/// A number or text that cannot be.
pub fn wrong(name: &str, what: &str) -> ContainerError {
    ContainerError::Value { name: name.to_owned(), what: what.to_owned() }
}

fn shape_text(shape: &[usize]) -> String {
    format!("a shape of [{}]", shape.iter().map(usize::to_string).collect::<Vec<_>>().join(", "))
}

fn shape_error(name: &str, found: &[usize], needed: &str) -> ContainerError {
    ContainerError::Shape { name: name.to_owned(), found: shape_text(found), needed: needed.to_owned() }
}

fn numbers(name: &str, tensor: &TensorView<'_>) -> Result<Vec<f64>, ContainerError> {
    let values: Vec<f64> = match tensor.dtype() {
        Dtype::F64 => tensor.data().as_chunks().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect(),
        Dtype::F32 => tensor.data().as_chunks().0.iter().map(|bytes| f64::from(f32::from_le_bytes(*bytes))).collect(),
        other => {
            let needed = "F32 or F64".to_owned();
            return Err(ContainerError::Shape {
                name: name.to_owned(),
                found: format!("numbers of {other:?}"),
                needed,
            });
        }
    };
    match values.iter().all(|value| value.is_finite()) {
        true => Ok(values),
        false => Err(wrong(name, "a finite number everywhere")),
    }
}
