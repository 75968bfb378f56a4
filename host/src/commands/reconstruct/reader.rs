//! Frames of a file, less those at rest, and what solves them.

use std::path::PathBuf;

use anyhow::{Context, anyhow, bail};
use tactomo::board::baseline::Baseline;
use tactomo::board::frames::FrameFile;
use tactomo::board::measured;
use tactomo::detector::Detector;
use tactomo::forward::ImageMesh;
use tactomo::readings::Readings;
use tactomo::solve::{Guard, Kernel, Lambda, Method, Presses, Problem, Solution, Solver};
use tactomo::study::{Setting, Variation};

use super::Args;

/// Frames and what solves them.
pub struct Reader {
    path: PathBuf,
    file: FrameFile,
    rest: Baseline,
    /// Frames still to come that are the baseline and nothing else, because the user said so.
    given: u32,
    /// Frames that were read.
    count: usize,
    touch: Touch,
}

/// What solves frames.
enum Touch {
    /// A solver for a detector, as the file's board measures it, and the places of its images.
    Solver { solver: Box<dyn Solver>, detector: Box<Detector>, mesh: ImageMesh },
    /// A kernel that presses in a file have taught, for whatever they were made on.
    Kernel(Box<Kernel>),
}

impl Reader {
    /// Opens the file and makes what solves it.
    pub fn open(args: &Args) -> anyhow::Result<Self> {
        let (file, touch) = match &args.presses {
            Some(presses) => taught(args, Presses::read(presses)?)?,
            None => solved(args)?,
        };
        // That of a recording is taken as live takes it, while its frames are solved.
        let rest = match (&touch, args.rest) {
            (Touch::Solver { detector, .. }, None) if file.board().is_some() => Baseline::new(detector),
            (_, frames) => Baseline::over(frames.unwrap_or(0), file.channels()),
        };
        Ok(Self { path: args.file.clone(), given: args.rest.unwrap_or(0), file, rest, count: 0, touch })
    }

    /// Time (s) and readings (V) of the next frame that is not at rest.
    pub fn next_frame(&mut self) -> anyhow::Result<Option<(Option<f64>, Vec<f64>)>> {
        while let Some(frame) = self.file.next_frame()? {
            self.count += 1;
            if self.given == 0 {
                self.rest.add(&frame.volts, 1);
                let mut touch_v = frame.volts.clone();
                self.rest.subtract(&frame.volts, &mut touch_v);
                return Ok(Some((frame.time_s, touch_v)));
            }
            if frame.volts.iter().any(|volts| !volts.is_finite()) {
                bail!("{}: at rest, there are readings that are no finite numbers", self.place());
            }
            self.rest.add(&frame.volts, 1);
            self.given -= 1;
        }
        Ok(None)
    }

    /// What a frame's readings say (V, less those at rest).
    pub fn solve(&mut self, readings_v: Vec<f64>) -> anyhow::Result<Solution> {
        match &mut self.touch {
            Touch::Solver { solver, detector, .. } => {
                let readings =
                    Readings::new(detector.electrodes.len(), readings_v).context("a frame of another length")?;
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

/// A kernel taught by presses, and the file that it reads.
fn taught(args: &Args, presses: Presses) -> anyhow::Result<(FrameFile, Touch)> {
    if args.solver != Method::Kernel {
        bail!("the solver {} learns nothing from presses; choose `--solver kernel`", args.solver.name());
    }
    let kernel = Kernel::train(&presses)?;
    eprintln!(
        "learned from {} presses on {} channels; one that is left out is missed by {:.2} mm and {:.0} % of its strength",
        presses.count(),
        kernel.channels(),
        kernel.left_out_m() * 1e3,
        kernel.left_out_strength() * 100.0
    );
    let file = FrameFile::open(&args.file, Some(kernel.channels()))?;
    if file.channels() != kernel.channels() {
        bail!(
            "{} has frames of {} numbers, but the presses have {} channels",
            args.file.display(),
            file.channels(),
            kernel.channels()
        );
    }
    Ok((file, Touch::Kernel(Box::new(kernel))))
}

/// A solver for the detector, and the file that it reads.
fn solved(args: &Args) -> anyhow::Result<(FrameFile, Touch)> {
    let chosen = args.detector.get()?;
    let electrodes = chosen.electrodes.len();
    let file = FrameFile::open(&args.file, Some(electrodes * electrodes))?;
    let detector = measured(chosen, &file)?;
    if file.channels() != electrodes * electrodes {
        bail!(
            "{} has frames of {} numbers, but the detector {} has {electrodes} electrodes: {} are needed; choose the detector \
             with `--detector`",
            args.file.display(),
            file.channels(),
            detector.name,
            electrodes * electrodes
        );
    }
    let problem = Problem::new(args.model.build(&detector, None)?);
    let solver = solver(args.solver, args.lambda, &problem)?;
    Ok((file, Touch::Solver { solver, detector: Box::new(detector), mesh: problem.jacobian.image_mesh.clone() }))
}

/// The detector as the board of a recording measures it; of a table, as it is.
fn measured(chosen: Detector, file: &FrameFile) -> anyhow::Result<Detector> {
    if let FrameFile::Recording(recording) = file
        && recording.header().detector != chosen.name
    {
        eprintln!(
            "the recording was made for the detector {}, but it is read as {}; `--detector` chooses",
            recording.header().detector,
            chosen.name
        );
    }
    Ok(match file.board() {
        Some(board) => measured::as_measured(&chosen, board)?,
        None => chosen,
    })
}

/// The solver, which leaves out electrodes that cannot be right; or, with a lambda that is told, of all electrodes.
fn solver(method: Method, lambda: Option<Lambda>, problem: &Problem) -> anyhow::Result<Box<dyn Solver>> {
    match lambda.map(Setting::Lambda) {
        None => Ok(Box::new(Guard::new(method, problem)?)),
        Some(_) if !Variation::has_lambda(method) => {
            bail!("the solver {} has no lambda; leave out --lambda", method.name())
        }
        setting => Ok(Variation { method, setting }.build(problem)?),
    }
}
