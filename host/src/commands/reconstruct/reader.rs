//! Frames of a file, less the baseline, and what solves them.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, anyhow, bail, ensure};
use tactomo::board::baseline::{BaselineState, BaselineTracker};
use tactomo::board::frames::{FileFrame, FrameFile, RecordingLoss};
use tactomo::detector::{Detector, ForceLaw};
use tactomo::forward::ImageMesh;
use tactomo::learned::Learned;
use tactomo::readings::Readings;
use tactomo::run::NewestReadings;
use tactomo::solve::{Kernel, Lambda, Method, Presses, Solution, Solver};

use tactomo_protocol::Hello;

use super::by_board::ByBoard;
use super::opened::Opened;
use super::units::{self, Unit};
use tactomo_cli::choice::{DetectorArgs, Model};

/// What is read, and what solves it.
pub struct Input<'a> {
    /// A recording, or a table of readings.
    pub file: &'a Path,
    /// On which detector.
    pub detector: &'a DetectorArgs,
    /// Forward model.
    pub model: Model,
    /// Solver; unless given that of what is taught, or auto, as live has it.
    pub solver: Option<Method>,
    /// Its lambda, if that is not the default.
    pub lambda: Option<Lambda>,
    /// What teaches it, instead of a detector.
    pub taught: Option<Taught<'a>>,
    /// Frames at the start that are the baseline, if that is said.
    pub rest: Option<u32>,
    /// Unit of a table, if that is said.
    pub unit: Option<Unit>,
    /// Law of force in place of the detector's own.
    pub force: Option<ForceLaw>,
    /// Leaves out what the detector's known presses correct.
    pub uncorrected: bool,
    /// Answers frames whose readings a board has not sent by what it has found itself. They have no readings to calibrate by.
    pub keeps_found: bool,
}

/// What teaches a solver, on whatever that is.
#[derive(Clone, Copy)]
pub enum Taught<'a> {
    /// A file of presses.
    Presses(&'a Path),
    /// A file of `tactomo-lab learn`.
    Learned(&'a Path),
}

impl Taught<'_> {
    fn get(self) -> anyhow::Result<Learned> {
        Ok(match self {
            Self::Presses(path) => Kernel::train(&Presses::read(path, &[])?)?.into(),
            Self::Learned(path) => Learned::read(path)?,
        })
    }
}

/// Frames and what solves them.
pub struct Reader {
    path: PathBuf,
    frames: Frames,
    baseline: BaselineTracker,
    /// Frames that were read.
    count: usize,
    /// Frames still to come that are the baseline and nothing else, because the user said so.
    given: u32,
    touch: Touch,
    /// Readings of the newest frame as they are used, before the baseline was taken off (V).
    used_v: Vec<f64>,
    /// The detector as it was chosen, of a solver for a detector.
    detector: Option<Detector>,
    /// What makes answers of frames without readings, and whether the newest is one.
    by_board: ByBoard,
    is_by_board: bool,
}

/// Frames, one after the other.
enum Frames {
    /// Of a recording.
    Recording(FrameFile),
    /// Of a table, all of which is read before the first is solved: their unit is checked on the largest of all.
    Table(std::vec::IntoIter<FileFrame>),
}

/// What solves frames.
pub enum Touch {
    /// A solver for a detector, as the file's board measures it, and the places of its images.
    Solver {
        solver: Box<dyn Solver>,
        detector: Box<Detector>,
        mesh: ImageMesh,
        usual_radius_m: f64,
        rows: Option<Box<RowsBefore>>,
    },
    /// A kernel that has learned from presses, on whatever they were made.
    Kernel(Arc<Kernel>),
}

/// What came before rows of readings.
pub struct RowsBefore {
    newest: NewestReadings,
    /// Board time of the newest (s).
    time_s: f64,
}

impl Reader {
    /// Opens the file and makes what solves it.
    pub fn open(input: &Input) -> anyhow::Result<Self> {
        let taught = input.taught.map(Taught::get).transpose()?;
        let solver = input.solver.or(taught.as_ref().map(Learned::method)).unwrap_or(Method::Auto);
        if let Some(taught) = taught.as_ref().map(Learned::method).filter(|taught| *taught != solver) {
            bail!("what was learned is for the solver {}, not {}: leave out --solver", taught.name(), solver.name());
        }
        let Opened { file, touch, jacobian, chosen } = Opened::of(input, solver, taught)?;
        // It is taken as live takes it, while frames are solved.
        let conversions = file.board().map_or(1, |board| board.settings.conversions());
        let baseline = match (&jacobian, input.rest) {
            (Some(jacobian), None) => BaselineTracker::new(Arc::clone(jacobian), conversions),
            (Some(jacobian), Some(frames)) => BaselineTracker::given(Arc::clone(jacobian), conversions, frames),
            (None, frames) => BaselineTracker::over(frames.unwrap_or(0), file.channels()),
        };
        let frames = Frames::of(file, input, jacobian.as_ref().map(|jacobian| &jacobian.detector))?;
        let (path, given) = (input.file.to_owned(), input.rest.unwrap_or(0));
        Ok(Self {
            path,
            frames,
            baseline,
            count: 0,
            given,
            touch,
            used_v: Vec::new(),
            detector: chosen,
            by_board: ByBoard::default(),
            is_by_board: false,
        })
    }

    /// The detector as it was chosen, before its board was asked; `None` where presses were learned from.
    pub fn detector(&self) -> Option<&Detector> {
        self.detector.as_ref()
    }

    /// The detector as the file's board measures it; `None` where presses were learned from.
    pub fn measured(&self) -> Option<&Detector> {
        match &self.touch {
            Touch::Solver { detector, .. } => Some(detector),
            Touch::Kernel(_) => None,
        }
    }

    /// The board that a recording was taken from.
    pub fn board(&self) -> Option<&Hello> {
        match &self.frames {
            Frames::Recording(file) => file.board(),
            Frames::Table(_) => None,
        }
    }

    /// Whether the file is a recording, whose frames follow each other in time.
    pub fn is_recording(&self) -> bool {
        matches!(self.frames, Frames::Recording(_))
    }

    /// Forgets the frames before: the next one need not follow them.
    pub fn reset(&mut self) {
        if let Touch::Solver { solver, rows, .. } = &mut self.touch {
            *rows = None;
            solver.reset();
        }
    }

    /// The next frame after those of the baseline, with readings (V) less the baseline.
    pub fn next_frame(&mut self) -> anyhow::Result<Option<FileFrame>> {
        while let Some(mut frame) = self.frames.next()? {
            self.count += 1;
            self.is_by_board = frame.found_alone().is_some();
            if self.is_by_board {
                self.used_v.clone_from(&frame.volts);
                return Ok(Some(frame));
            }
            if self.given == 0 {
                frame.note_rest(&mut self.baseline);
                self.used_v.clone_from(&frame.volts);
                self.baseline.subtract(&self.used_v, &mut frame.volts);
                return Ok(Some(frame));
            }
            if frame.volts.iter().any(|volts| !volts.is_finite()) {
                bail!("{}: the baseline needs finite readings, but some of these are not", self.place());
            }
            frame.note_rest(&mut self.baseline);
            self.given -= 1;
        }
        Ok(None)
    }

    /// What is missing in the file, in words; `None` if nothing is.
    pub fn losses(&self) -> Option<String> {
        let loss = self.frames.loss().filter(RecordingLoss::is_any)?;
        Some(format!("{}: {loss}", self.path.display()))
    }

    /// What a person should know of the baseline, in words. That a table begins with a press is no news: most are of presses alone.
    pub fn notice(&self) -> Option<String> {
        let state = self.baseline.state();
        let is_table_of_presses = !self.is_recording() && matches!(state, BaselineState::Pressed(_));
        state.notice().filter(|_| !is_table_of_presses)
    }

    /// Readings of the newest frame as they are used, before the baseline was taken off (V).
    pub fn used_v(&self) -> &[f64] {
        &self.used_v
    }

    /// What the solver gets of a frame (less the baseline): as no channel differs from others; `None` of a frame of another length.
    pub fn touch(&self, frame: &FileFrame) -> Option<Readings> {
        let Touch::Solver { detector, .. } = &self.touch else { return frame.readings() };
        let mut readings = frame.readings().filter(|readings| readings.electrodes() == detector.electrodes.len())?;
        readings.correct_channels(detector);
        Some(readings)
    }

    /// Whether the baseline is being taken.
    pub fn is_taking_baseline(&self) -> bool {
        if self.is_by_board { self.by_board.is_taking_rest } else { self.baseline.state().is_taking() }
    }

    /// Radius that contacts have where it is not known (m).
    pub fn usual_radius_m(&self) -> f64 {
        match &self.touch {
            Touch::Solver { usual_radius_m, .. } => *usual_radius_m,
            Touch::Kernel(_) => 0.0,
        }
    }

    /// What a frame's readings (less the baseline) say.
    pub fn solve(&mut self, frame: &FileFrame) -> anyhow::Result<Solution> {
        if let (Some(found), Touch::Solver { detector, .. }) = (frame.found_alone(), &self.touch) {
            return Ok(self.by_board.solution(found, detector));
        }
        let touch = self.touch(frame);
        match &mut self.touch {
            Touch::Solver { solver, rows, .. } => {
                let readings = touch.context("a frame of another length")?;
                if frame.rows().is_none() {
                    return Ok(solver.solve(&readings)?);
                }
                let time_s = frame.time_s.unwrap_or_default();
                let none = || Box::new(RowsBefore { newest: NewestReadings::new(readings.electrodes()), time_s });
                let before = rows.get_or_insert_with(none);
                let elapsed_s = time_s - std::mem::replace(&mut before.time_s, time_s);
                Ok(solver.solve_rows(&readings, &before.newest.with(&readings), elapsed_s)?)
            }
            Touch::Kernel(kernel) => match kernel.press(&frame.volts) {
                Ok(press) => Ok(press.map(|press| press.solution(kernel.strength())).unwrap_or_default()),
                Err(Some(channel)) => Err(anyhow!("channel {channel} is not a finite number")),
                Err(None) => Err(anyhow!("a frame of another length")),
            },
        }
    }

    /// Name of the solver; where the newest frame has no readings, of the board's own.
    pub fn name(&self) -> &'static str {
        match &self.touch {
            _ if self.is_by_board => Method::Core.name(),
            Touch::Solver { solver, .. } => solver.name(),
            Touch::Kernel(_) => Method::Kernel.name(),
        }
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Frames that were read.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Number of the frame that was read last, from 0.
    pub fn frame(&self) -> usize {
        self.count.saturating_sub(1)
    }

    /// File and number of that frame, for messages.
    pub fn place(&self) -> String {
        format!("{}, frame {}", self.path.display(), self.frame())
    }

    /// Places of images, of a solver that makes some.
    pub fn mesh(&self) -> Option<&ImageMesh> {
        match &self.touch {
            Touch::Solver { mesh, .. } => Some(mesh),
            Touch::Kernel(_) => None,
        }
    }
}

impl Frames {
    /// Of a file, in volts.
    fn of(mut file: FrameFile, input: &Input, detector: Option<&Detector>) -> anyhow::Result<Self> {
        let path = input.file.display();
        if file.board().is_some() {
            ensure!(input.unit.is_none(), "leave out --unit: {path} is a recording, which knows its unit");
            return Ok(Self::Recording(file));
        }
        let unit = input.unit.unwrap_or(Unit::Volt);
        let mut frames = Vec::new();
        while let Some(mut frame) = file.next_frame()? {
            let all = frame.volts.iter_mut().chain(&mut frame.measured_v);
            all.for_each(|value| *value *= unit.volts());
            frames.push(frame);
        }
        if let Some(detector) = detector {
            let volts = frames.iter().flat_map(|frame| frame.volts.iter().copied());
            units::check(volts, unit, detector).map_err(|what| anyhow!("{path}: {what}"))?;
        }
        Ok(Self::Table(frames.into_iter()))
    }

    /// What of the file could not be read so far.
    fn loss(&self) -> Option<RecordingLoss> {
        match self {
            Self::Recording(file) => file.loss(),
            Self::Table(_) => None,
        }
    }

    fn next(&mut self) -> anyhow::Result<Option<FileFrame>> {
        match self {
            Self::Recording(file) => Ok(file.next_frame()?),
            Self::Table(frames) => Ok(frames.next()),
        }
    }
}
