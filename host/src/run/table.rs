//! A board that finds contacts by itself: it is given the table of its detector before it is asked for them.

use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use tactomo_board::identity::Sensor;
use tactomo_board::link::Link;
use tactomo_board::measured::{self, Mismatch};
use tactomo_board::session::{self, GreetError};
use tactomo_board::source::{Source, SourceError};
use tactomo_board::table::{self, TableError};
use tactomo_physics::causes::with_causes;
use tactomo_physics::detector::{Detector, ForceLaw};
use tactomo_physics::forward::ForwardError;
use tactomo_protocol::{Hello, TableId};
use tactomo_touch::solve::{self, CompileError, CompiledTable, FoundContact, Problem, compile};

use super::calibration::Learning;

/// How long a board has to say Hello.
const PATIENCE: Duration = Duration::from_secs(6);
/// A table's drive may be above the board's by so much (V), as boards allow: theirs are told in whole millivolts.
const SAME_DRIVE_V: f64 = 1e-3;

/// A board that was given no table.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GiveTableError {
    /// It does not say Hello.
    #[error("{link}")]
    Greet {
        /// Name of the link.
        link: String,
        /// Why not.
        #[source]
        error: GreetError,
    },
    /// It is of another detector.
    #[error(transparent)]
    Mismatch(#[from] Mismatch),
    /// The detector has no model.
    #[error(transparent)]
    Model(#[from] ForwardError),
    /// The detector has no table.
    #[error(transparent)]
    Compile(#[from] CompileError),
    /// The table of a file is of another detector.
    #[error(
        "{link}: the table is of {} electrodes and a drive of {:.3} V, and the board has {electrodes} electrodes and a drive of {drive_v:.3} V. \
         Compile the detector that is connected",
        table.electrodes, table.drive_v
    )]
    OtherDetector {
        /// Name of the link.
        link: String,
        /// The table.
        table: Box<CompiledTable>,
        /// Electrodes of the board.
        electrodes: usize,
        /// Its drive (V).
        drive_v: f64,
    },
    /// The table was not taken.
    #[error(transparent)]
    Table(#[from] TableError),
}

/// What a board was given.
#[derive(Clone, Debug, PartialEq)]
pub struct Given {
    /// The board.
    pub hello: Hello,
    /// The table.
    pub bytes: Vec<u8>,
    /// Which table it is.
    pub table: TableId,
    /// Whether it had to be sent.
    pub is_sent: bool,
}

/// Gives the board on `link` a table: this one, or that of a detector as the board measures it. `progress` is told how many bytes of how many are there.
///
/// # Errors
/// [`GiveTableError`] if there is none, or the board does not take it.
pub fn give(link: &mut dyn Link, what: &What, mut progress: impl FnMut(usize, usize)) -> Result<Given, GiveTableError> {
    let name = link.name();
    let hello = session::greet(link, Instant::now() + PATIENCE)
        .map_err(|error| GiveTableError::Greet { link: name.clone(), error })?;
    let bytes = match what {
        What::Table(table) => {
            let (electrodes, drive_v) = (hello.electrodes.into(), f64::from(hello.drive_mv) * 1e-3);
            // A ground that is lifted takes some of the board's drive.
            if table.electrodes != electrodes || table.drive_v > drive_v + SAME_DRIVE_V {
                let table = Box::new(table.clone());
                return Err(GiveTableError::OtherDetector { link: name, table, electrodes, drive_v });
            }
            table.bytes().to_vec()
        }
        What::Detector(detector) => compiled(detector, &hello)?,
        What::Learned(learning) => {
            let (kept, refused) = learning.kept(&Sensor::on(link, &hello));
            refused.iter().for_each(|why| tracing::warn!("{why}"));
            kept.iter()
                .for_each(|kept| tracing::info!("the table is of what was learned before: {}", kept.file.display()));
            compiled(kept.as_ref().map_or(&learning.description, |kept| &kept.detector), &hello)?
        }
    };
    let mut is_sent = false;
    let table = table::send(link, &bytes, |at| {
        is_sent = true;
        progress(at, bytes.len());
    })?;
    Ok(Given { hello, bytes, table, is_sent })
}

/// The table of a detector as a board measures it.
fn compiled(detector: &Detector, board: &Hello) -> Result<Vec<u8>, GiveTableError> {
    Ok(compile(&Problem::of(&measured::as_measured(detector, board)?)?)?)
}

/// What a board is to find contacts by.
#[derive(Clone, Debug)]
pub enum What {
    /// A detector, as the board measures it.
    Detector(Box<Detector>),
    /// What was learned before of the detector on this board, or else its description.
    Learned(Box<Learning>),
    /// A table that was compiled before.
    Table(CompiledTable),
}

/// The table that a board was given last, for those who read what it finds.
#[derive(Clone, Debug, Default)]
pub struct BoardTable(Arc<Kept>);

#[derive(Debug, Default)]
struct Kept {
    bytes: Mutex<Vec<u8>>,
    /// Whether one is compiled of what was recorded.
    is_compiled: OnceLock<()>,
}

impl BoardTable {
    fn put(&self, bytes: Vec<u8>) {
        *self.bytes() = bytes;
    }

    fn bytes(&self) -> MutexGuard<'_, Vec<u8>> {
        self.0.bytes.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Compiles the table of a detector, as its board measures it, once, unless a board was given one: for newtons of contacts that were recorded. A recording
    /// waits for that second.
    pub fn compile_once(&self, detector: &Detector) {
        self.0.is_compiled.get_or_init(|| {
            if !self.bytes().is_empty() {
                return;
            }
            let compiled = || Ok(compile(&Problem::of(detector)?)?);
            match compiled() {
                Ok(bytes) => self.put(bytes),
                Err::<_, GiveTableError>(error) => {
                    tracing::warn!("contacts are without newtons: {}", with_causes(&error))
                }
            }
        });
    }

    /// Adds newtons to contacts that the board has found.
    pub fn add_newtons(&self, law: &ForceLaw, contacts: &mut [FoundContact]) {
        // It was checked when it was given.
        solve::add_newtons(&self.bytes(), law, contacts);
    }
}

/// A source whose board has the table of a detector, each time that it is opened.
pub struct WithTable {
    source: Box<dyn Source>,
    what: What,
    table: BoardTable,
}

impl WithTable {
    /// A board on `source` that finds contacts by `what`; its table is put in `table`.
    pub fn new(source: Box<dyn Source>, what: What, table: BoardTable) -> Self {
        Self { source, what, table }
    }
}

impl Source for WithTable {
    fn name(&self) -> String {
        self.source.name()
    }

    fn open(&mut self) -> Result<Box<dyn Link>, SourceError> {
        let mut link = self.source.open()?;
        let given = give(&mut *link, &self.what, |_, _| {}).map_err(|error| SourceError::Prepared(Box::new(error)))?;
        if given.is_sent {
            tracing::info!("{}: a table of {} bytes was sent to the board", link.name(), given.bytes.len());
        }
        self.table.put(given.bytes);
        Ok(link)
    }

    fn comes_back(&self) -> bool {
        self.source.comes_back()
    }

    fn speed(&self) -> f64 {
        self.source.speed()
    }
}
