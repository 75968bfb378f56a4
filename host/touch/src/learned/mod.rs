//! Files of what was learned: one container for every kind, so that one place opens them.
//!
//! The container is safetensors, which Python and others read: named arrays, and text under names, `__metadata__`. That says
//! `tactomo`, the kind of what is inside (`kernel`, `network`), and `version`, that of its layout. All else is the kind's own: a kind has a
//! variant of [`Learned`], which reads itself, checking everything, for nothing of a file is trusted; and a method whose solver takes it from the [`Problem`](crate::solve::Problem) that it is made for.

mod container;
pub(crate) mod kernel;
pub(crate) mod network;

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tactomo_table::file::Format;

pub(crate) use self::container::wrong;
pub use self::container::{Container, ContainerError};
use self::kernel::Kernel;
use self::network::Network;

/// A file of what was learned.
const FORMAT: Format = Format::new("a file of `tactomo-lab learn`", 1 << 27);
/// Name of the text that says the kind.
const KIND: &str = "tactomo";
/// Name of the text that says the version.
const VERSION: &str = "version";

/// What was learned. Cheap to clone.
#[derive(Clone, Debug, PartialEq)]
pub enum Learned {
    /// Places and strengths of presses.
    Kernel(Arc<Kernel>),
    /// Images and contacts of a detector design, by `tools/train_network.py`.
    Network(Arc<Network>),
}

/// Why a file is not one of these.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LearnedError {
    /// It cannot be opened or read.
    #[error("cannot read {path}")]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// It holds something else.
    #[error("cannot use {path}")]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: ContainerError,
    },
}

impl Learned {
    /// Reads a file.
    ///
    /// # Errors
    /// [`LearnedError`], which names the file and what in it is wrong.
    pub fn read(path: &Path) -> Result<Self, LearnedError> {
        Self::read_with_bytes(path).map(|(learned, _)| learned)
    }

    /// Reads a file; with its bytes, as they are.
    ///
    /// # Errors
    /// Those of [`Learned::read`].
    pub fn read_with_bytes(path: &Path) -> Result<(Self, Vec<u8>), LearnedError> {
        let bytes = FORMAT.read(path).map_err(|source| LearnedError::Read { path: path.to_owned(), source })?;
        let learned = Self::parse(&bytes).map_err(|source| LearnedError::Content { path: path.to_owned(), source })?;
        Ok((learned, bytes))
    }

    /// Reads the bytes of a file.
    ///
    /// # Errors
    /// [`ContainerError`], which says what is wrong.
    pub fn parse(bytes: &[u8]) -> Result<Self, ContainerError> {
        if container::text(bytes, KIND)?.as_deref() == Some(Network::KIND) {
            return Ok(Self::Network(Arc::new(Network::from_bytes(bytes)?)));
        }
        let container = Container::parse(bytes)?;
        match (container.text(KIND)?, container.text(VERSION)?) {
            (Kernel::KIND, Kernel::VERSION | Kernel::BEFORE) => {
                Ok(Self::Kernel(Arc::new(Kernel::from_container(&container)?)))
            }
            (kind, version) => Err(ContainerError::Unknown { kind: kind.to_owned(), version: version.to_owned() }),
        }
    }

    /// The bytes of a file for a kernel.
    ///
    /// # Errors
    /// [`ContainerError`] if there is more than a file can hold.
    pub fn bytes_of(kernel: &Kernel) -> Result<Vec<u8>, ContainerError> {
        let mut container = Container::default();
        kernel.to_container(&mut container);
        container.set_text(KIND, Kernel::KIND);
        container.set_text(VERSION, Kernel::VERSION);
        container.bytes()
    }

    /// Readings that it needs.
    pub fn channels(&self) -> usize {
        match self {
            Self::Kernel(kernel) => kernel.channels(),
            Self::Network(network) => network.electrodes().pow(2),
        }
    }
}

impl From<Kernel> for Learned {
    fn from(kernel: Kernel) -> Self {
        Self::Kernel(Arc::new(kernel))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::{Description, Method, Presses, Strength};
    use proptest::prelude::*;

    fn kernel(strength: Option<Strength>) -> Kernel {
        let place = |i: usize| [0.7549, 0.5698].map(|step| (step * (i + 1) as f64).fract());
        let heard = |i: usize| {
            let [x, y] = place(i);
            [0.2, 0.5, 0.9].map(|ear| (1.0 + i as f64 % 3.0) / (0.2 + (x - ear).powi(2) + (y - ear * ear).powi(2)))
        };
        let presses = Presses {
            channels: 3,
            names: ["a", "b", "c \"quoted\""].map(str::to_owned).into(),
            readings_v: (0..40).flat_map(heard).collect(),
            places_m: (0..40).map(|i| [place(i)[0], place(i)[1], 0.0]).collect(),
            strengths: strength.iter().flat_map(|_| (0..40).map(|i| 1.0 + f64::from(i % 3))).collect(),
            strength,
            of: None,
            others: Vec::new(),
            drive_v: None,
        };
        Kernel::train(&presses).unwrap()
    }

    #[test]
    fn what_is_written_is_read_to_the_last_bit() {
        for kernel in [None, Some(Strength::Depth)].map(kernel) {
            let read = Learned::parse(&Learned::bytes_of(&kernel).unwrap()).unwrap();
            assert_eq!(read, Learned::from(kernel));
        }
    }

    #[test]
    fn what_the_version_before_wrote_is_read() {
        let Learned::Kernel(kernel) = Learned::parse(include_bytes!("kernel/version-1.safetensors")).unwrap() else {
            panic!("another kind")
        };
        let press = kernel.press(&[1.5, 0.9, 0.8, 0.6]).unwrap().unwrap();
        // As the program of that version said.
        let told =
            [(press.place_m[0], 0.029_301_9), (press.place_m[1], 0.022_891_5), (press.strength.unwrap(), 1.931_516_5)];
        assert!(told.iter().all(|(found, said)| (found / said - 1.0).abs() < 1e-5), "{told:?}");
        assert_eq!((kernel.description(), press.is_outside), (Description::Directions, false));
    }

    #[test]
    fn a_network_is_known_by_its_kind() {
        let file = include_bytes!("network/square-60.safetensors");
        let learned = Learned::parse(file).unwrap();
        assert_eq!((learned.method(), learned.channels()), (Method::Network, 256));
        let cut = Learned::parse(&file[..file.len() - 1]).unwrap_err().to_string();
        assert!(cut.contains("safetensors") || cut.contains("network"), "{cut}");
    }

    #[test]
    fn other_kinds_and_files_are_refused_by_name() {
        let refused = |text: [(&str, &str); 2]| {
            let mut container = Container::default();
            text.iter().for_each(|(name, text)| container.set_text(name, *text));
            Learned::parse(&container.bytes().unwrap()).unwrap_err().to_string()
        };
        assert!(refused([("tactomo", "poem"), ("version", "1")]).contains("poem"));
        assert!(refused([("tactomo", "kernel"), ("version", "99")]).contains("version 99"));
        assert!(refused([("tactomo", "kernel"), ("version", "2")]).contains("channels"));
        assert!(refused([("title", "kernel"), ("version", "1")]).contains("tactomo"));
        assert!(Learned::parse(b"once upon a time").unwrap_err().to_string().contains("safetensors"));
        let missing = Learned::read(Path::new("no/such.safetensors")).unwrap_err().to_string();
        assert_eq!(missing, "cannot read no/such.safetensors");
    }

    proptest! {
        #[test]
        fn damaged_files_are_refused_or_answer_without_panic(flips in prop::collection::vec((any::<prop::sample::Index>(), 0..8u32), 1..4), cut in any::<prop::sample::Index>(), is_cut in any::<bool>()) {
            thread_local!(static WHOLE: Vec<u8> = Learned::bytes_of(&kernel(Some(Strength::Force))).unwrap());
            let mut bytes = WHOLE.with(Clone::clone);
            for (at, bit) in flips {
                let index = at.index(bytes.len());
                bytes[index] ^= 1 << bit;
            }
            if is_cut {
                bytes.truncate(cut.index(bytes.len()));
            }
            if let Ok(Learned::Kernel(kernel)) = Learned::parse(&bytes) {
                for readings in [[1.0, 2.0, 3.0], [0.0, 0.0, 0.0], [-1e9, 1e300, 4.0]] {
                    _ = kernel.press(&readings);
                }
            }
        }

        #[test]
        fn any_bytes_are_refused_without_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            prop_assert!(Learned::parse(&bytes).is_err());
        }
    }
}
