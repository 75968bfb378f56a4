//! Frames of a file, less the baseline, and what solves them.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, anyhow, bail, ensure};
use tactomo::board::baseline::Baseline;
use tactomo::board::frames::{FileFrame, FrameFile, RecordingLoss};
use tactomo::board::measured;
use tactomo::detector::Detector;
use tactomo::forward::ImageMesh;
use tactomo::forward::jacobian::Jacobian;
use tactomo::readings::Readings;
use tactomo::solve::{Guard, Kernel, Lambda, Method, Parameter, ParameterKind, Presses, Problem, Solution, Solver};

use super::Args;
use super::units::{self, Unit};
use crate::commands::output::message;

/// Frames and what solves them.
pub struct Reader {
    path: PathBuf,
    frames: Frames,
    baseline: Baseline,
    /// Frames that were read.
    count: usize,
    /// Frames still to come that are the baseline and nothing else, because the user said so.
    given: u32,
    touch: Touch,
}

/// Frames, one after the other.
enum Frames {
    /// Of a recording.
    Recording(FrameFile),
    /// Of a table, all of which is read before the first is solved: their unit is checked on the largest of all.
    Table(std::vec::IntoIter<FileFrame>),
}

/// What solves frames.
enum Touch {
    /// A solver for a detector, as the file's board measures it, and the places of its images.
    Solver { solver: Box<dyn Solver>, electrodes: usize, mesh: ImageMesh },
    /// A kernel that has learned from presses in a file, on whatever they were made.
    Kernel(Box<Kernel>),
}

impl Reader {
    /// Opens the file and makes what solves it.
    pub fn open(args: &Args) -> anyhow::Result<Self> {
        let (file, touch, jacobian) = match &args.presses {
            Some(presses) => learned(args, Presses::read(presses)?)?,
            None => solved(args)?,
        };
        // That of a recording is taken as live takes it, while its frames are solved.
        let baseline = match (&jacobian, args.rest, file.board()) {
            (Some(jacobian), None, Some(board)) => Baseline::new(Arc::clone(jacobian), board.settings.conversions()),
            (_, frames, _) => Baseline::over(frames.unwrap_or(0), file.channels()),
        };
        let frames = Frames::of(file, args, jacobian.as_ref().map(|jacobian| &jacobian.detector))?;
        Ok(Self { path: args.file.clone(), frames, baseline, count: 0, given: args.rest.unwrap_or(0), touch })
    }

    /// The next frame after those of the baseline, with readings (V) less the baseline.
    pub fn next_frame(&mut self) -> anyhow::Result<Option<FileFrame>> {
        while let Some(mut frame) = self.frames.next()? {
            self.count += 1;
            if self.given == 0 {
                self.baseline.add(&frame.volts, 1, frame.time_s.unwrap_or_default(), &[]);
                let volts = frame.volts.clone();
                self.baseline.subtract(&volts, &mut frame.volts);
                return Ok(Some(frame));
            }
            if frame.volts.iter().any(|volts| !volts.is_finite()) {
                bail!("{}: the baseline needs finite readings, but some of these are not", self.place());
            }
            self.baseline.add(&frame.volts, 1, frame.time_s.unwrap_or_default(), &[]);
            self.given -= 1;
        }
        Ok(None)
    }

    /// What is missing in the file, in words; `None` if nothing is.
    pub fn losses(&self) -> Option<String> {
        let loss = self.frames.loss().filter(RecordingLoss::is_any)?;
        Some(format!("{}: {loss}", self.path.display()))
    }

    /// What a person should know of the baseline, in words.
    pub fn notice(&self) -> Option<String> {
        self.baseline.state().notice()
    }

    /// What a frame's readings (V, less the baseline) say.
    pub fn solve(&mut self, readings_v: Vec<f64>) -> anyhow::Result<Solution> {
        match &mut self.touch {
            Touch::Solver { solver, electrodes, .. } => {
                let readings = Readings::new(*electrodes, readings_v).context("a frame of another length")?;
                Ok(solver.solve(&readings)?)
            }
            Touch::Kernel(kernel) => match kernel.press(&readings_v) {
                Ok(press) => Ok(press.map(|press| press.solution(kernel.strength())).unwrap_or_default()),
                Err(Some(channel)) => Err(anyhow!("channel {channel} is not a finite number")),
                Err(None) => Err(anyhow!("a frame of another length")),
            },
        }
    }

    /// Name of the solver.
    pub fn name(&self) -> &'static str {
        match &self.touch {
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
    fn of(mut file: FrameFile, args: &Args, detector: Option<&Detector>) -> anyhow::Result<Self> {
        if file.board().is_some() {
            ensure!(
                args.unit.is_none(),
                "leave out --unit: {} is a recording, which knows its unit",
                args.file.display()
            );
            return Ok(Self::Recording(file));
        }
        let unit = args.unit.unwrap_or(Unit::Volt);
        let mut frames = Vec::new();
        while let Some(mut frame) = file.next_frame()? {
            frame.volts.iter_mut().for_each(|value| *value *= unit.volts());
            frames.push(frame);
        }
        let volts = || frames.iter().flat_map(|frame| &frame.volts);
        let largest_v = volts().map(|volts| volts.abs()).filter(|volts| volts.is_finite()).fold(0.0, f64::max);
        if let Some(detector) = detector {
            units::check(largest_v, unit, detector).map_err(|what| anyhow!("{}: {what}", args.file.display()))?;
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

/// A file, what solves it, and the linear theory of the detector that it must be of, if that is known.
type Opened = (FrameFile, Touch, Option<Arc<Jacobian>>);

/// A kernel that has learned from presses.
fn learned(args: &Args, presses: Presses) -> anyhow::Result<Opened> {
    if args.solver != Method::Kernel {
        bail!("only the solver kernel learns from presses, not {}: give --solver kernel", args.solver.name());
    }
    let kernel = Kernel::train(&presses)?;
    message!(
        "learned from {} presses on {} channels; a press left out of the training is found within {:.2} mm and {:.0} % of its strength",
        presses.count(),
        kernel.channels(),
        kernel.left_out_m() * 1e3,
        kernel.left_out_strength() * 100.0
    );
    let file = FrameFile::open(&args.file, Some(kernel.channels()))?;
    if file.channels() != kernel.channels() {
        bail!(
            "{} has {} readings a frame, but the presses have {} channels",
            args.file.display(),
            file.channels(),
            kernel.channels()
        );
    }
    Ok((file, Touch::Kernel(Box::new(kernel)), None))
}

/// A solver for the detector.
fn solved(args: &Args) -> anyhow::Result<Opened> {
    // That of a recording is in its header, unless another one is given.
    let given = args.detector.get()?.electrodes.len();
    let file = FrameFile::open(&args.file, Some(given * given))?;
    let chosen = match file.header() {
        Some(header) => args.detector.of_recording(&args.file, header)?,
        None => args.detector.get()?,
    };
    let electrodes = chosen.electrodes.len();
    let detector = match file.board() {
        Some(board) => measured::as_measured(&chosen, board)?,
        None => chosen,
    };
    if file.channels() != electrodes * electrodes {
        bail!(
            "{} has {} readings a frame, but the detector {} with its {electrodes} electrodes needs {}: give the right one with \
             --detector",
            args.file.display(),
            file.channels(),
            detector.name,
            electrodes * electrodes
        );
    }
    let problem = Problem::new(args.model.build(&detector, None)?);
    let solver = solver(args.solver, args.lambda, &problem)?;
    let mesh = problem.jacobian.image_mesh.clone();
    Ok((file, Touch::Solver { solver, electrodes, mesh }, Some(problem.jacobian)))
}

/// The solver, which leaves out faulty electrodes; or, with a given lambda, of all electrodes.
fn solver(method: Method, lambda: Option<Lambda>, problem: &Problem) -> anyhow::Result<Box<dyn Solver>> {
    match lambda.map(Parameter::Lambda) {
        None => Ok(Box::new(Guard::new(method, problem)?)),
        Some(_) if method.parameter() != Some(ParameterKind::Lambda) => {
            bail!("the solver {} has no lambda: leave out --lambda", method.name())
        }
        lambda => Ok(method.build_with(problem, lambda)?),
    }
}
