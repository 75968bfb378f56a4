//! Frames of a file, less the baseline, and what solves them.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, anyhow, bail, ensure};
use tactomo::board::baseline::{BaselineState, BaselineTracker};
use tactomo::board::frames::{FileFrame, FrameFile, LeftOut, RecordingLoss};
use tactomo::detector::{Detector, ForceLaw};
use tactomo::forward::ImageMesh;
use tactomo::learned::Learned;
use tactomo::readings::Readings;
use tactomo::run::NewestReadings;
use tactomo::solve::{Kernel, Lambda, Method, Presses, Solution, Solver, below_rest_v};

use tactomo_protocol::Hello;

use super::by_board::ByBoard;
use super::checks::{Doubts, TableChecks};
use super::opened::Opened;
use super::units::{self, Unit};
use tactomo_cli::choice::{DetectorArgs, Model};
use tactomo_cli::output::message;

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
    rest: Rest,
    /// Frames that were read; of a table rows, those included that are left out.
    count: usize,
    touch: Touch,
    doubts: Doubts,
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
    /// Of a table, all of which is read before the first is solved: it is checked as a whole.
    Table { frames: std::vec::IntoIter<FileFrame>, left_out: Option<LeftOut>, board: Option<Box<Hello>> },
}

/// What readings are at rest.
#[derive(Clone)]
pub struct Rest {
    baseline: BaselineTracker,
    /// Frames still to come that are the baseline and nothing else, because the user said so.
    given: u32,
}

impl Rest {
    /// A frame as it is, and less the baseline; `None` if it is one of the baseline.
    pub fn take(&mut self, frame: &FileFrame) -> Option<FileFrame> {
        frame.note_rest(&mut self.baseline);
        if self.given > 0 {
            self.given -= 1;
            return None;
        }
        let mut less = frame.clone();
        self.baseline.subtract(&frame.volts, &mut less.volts);
        Some(less)
    }
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
        let channels = file.channels();
        let detector = jacobian.as_ref().map(|jacobian| &jacobian.detector);
        let frames = Frames::of(file, input, detector)?;
        let given = input.rest.map(|rest| frames.among_first(rest));
        if let (Some(rest @ 1..), Some(0)) = (input.rest, given) {
            bail!(
                "{}: the first {rest} rows are to be the baseline, and none of them is of numbers",
                input.file.display()
            );
        }
        let baseline = match (&jacobian, given) {
            (Some(jacobian), None) => BaselineTracker::new(Arc::clone(jacobian), conversions),
            (Some(jacobian), Some(frames)) => BaselineTracker::given(Arc::clone(jacobian), conversions, frames),
            (None, frames) => BaselineTracker::over(frames.unwrap_or(0), channels),
        };
        let rest = Rest { baseline, given: given.unwrap_or(0) };
        let checks = TableChecks { unit: input.unit.unwrap_or(Unit::Volt), rest: input.rest };
        let doubts = match (&frames, detector) {
            (Frames::Table { frames, board: None, .. }, Some(detector)) => {
                checks.doubts(frames.as_slice(), rest.clone(), detector)
            }
            _ => checks.none(),
        };
        let left_out = frames.left_out().map(ToString::to_string);
        for what in left_out.into_iter().chain(doubts.of_table()) {
            message!("warning: {}: {what}", input.file.display());
        }
        Ok(Self {
            path: input.file.to_owned(),
            frames,
            rest,
            count: 0,
            touch,
            doubts,
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
            Frames::Table { board, .. } => board.as_deref(),
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
        while let Some(frame) = self.frames.next()? {
            self.count += 1;
            if !self.is_recording() {
                self.count += frame.lost_before as usize;
            }
            self.is_by_board = frame.found_alone().is_some();
            let less = if self.is_by_board { Some(frame.clone()) } else { self.rest.take(&frame) };
            self.used_v = frame.volts;
            if less.is_some() {
                return Ok(less);
            }
        }
        Ok(None)
    }

    /// Says what was missing in a recording, and what is doubtful in the frames that were solved. What is wrong with a table as a whole is said when it
    /// is opened.
    pub fn warn(&self) {
        let loss = self.frames.loss().filter(RecordingLoss::is_any).map(|loss| loss.to_string());
        for what in [loss, self.doubts.of_frames()].into_iter().flatten() {
            message!("warning: {}: {what}", self.path.display());
        }
    }

    /// Checks that no row of a table is left out, for what counts its rows.
    pub fn ensure_every_row(&self) -> anyhow::Result<()> {
        match self.frames.left_out() {
            Some(left_out) => bail!(
                "{}: {left_out}. Presses are told by the number of their row, so each has to be right: mend it, or leave it out with its press",
                self.path.display()
            ),
            None => Ok(()),
        }
    }

    /// What a person should know of the baseline, in words. That a table begins with a press is no news: most are of presses alone.
    pub fn notice(&self) -> Option<String> {
        let state = self.rest.baseline.state();
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
        if self.is_by_board { self.by_board.is_taking_rest } else { self.rest.baseline.state().is_taking() }
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
        let mut solution = self.solved(frame)?;
        if let Some(detector) = self.measured().filter(|_| !self.is_by_board)
            && let Some(touch) = self.touch(frame)
        {
            let below_v = below_rest_v(&touch, detector);
            self.doubts.note(below_v, &self.used_v);
        }
        if self.doubts.is_of_all() {
            solution.doubt();
        }
        Ok(solution)
    }

    fn solved(&mut self, frame: &FileFrame) -> anyhow::Result<Solution> {
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
        let board = file.board().cloned().map(Box::new);
        ensure!(
            board.is_none() || input.unit.is_none(),
            "leave out --unit and --adc: {path} says how its board measures"
        );
        if matches!(file, FrameFile::Recording(_)) {
            return Ok(Self::Recording(file));
        }
        let mut frames = Vec::new();
        while let Some(frame) = file.next_frame()? {
            frames.push(frame);
        }
        let unit = input.unit.unwrap_or(Unit::Volt);
        units::make_volts(&mut frames, unit, detector).map_err(|what| anyhow!("{path}: {what}"))?;
        Ok(Self::Table { frames: frames.into_iter(), left_out: file.left_out().cloned(), board })
    }

    /// How many frames are among so many at the start, those included that are left out of a table.
    fn among_first(&self, rows: u32) -> u32 {
        let Self::Table { frames, .. } = self else { return rows };
        let ends = frames.as_slice().iter().scan(0, |row, frame| {
            *row += 1 + frame.lost_before;
            Some(*row)
        });
        let among = ends.take_while(|end| *end <= u64::from(rows)).count() as u32;
        // A table that is all baseline is told so.
        if among as usize == frames.len() { rows } else { among }
    }

    /// Rows of a table that are left out.
    fn left_out(&self) -> Option<&LeftOut> {
        match self {
            Self::Recording(_) => None,
            Self::Table { left_out, .. } => left_out.as_ref(),
        }
    }

    /// What of the file could not be read so far.
    fn loss(&self) -> Option<RecordingLoss> {
        match self {
            Self::Recording(file) => file.loss(),
            Self::Table { .. } => None,
        }
    }

    fn next(&mut self) -> anyhow::Result<Option<FileFrame>> {
        match self {
            Self::Recording(file) => Ok(file.next_frame()?),
            Self::Table { frames, .. } => Ok(frames.next()),
        }
    }
}
