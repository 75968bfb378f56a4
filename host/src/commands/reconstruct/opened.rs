//! A file of frames, opened, and what solves it.

use std::sync::Arc;

use anyhow::bail;
use tactomo::board::frames::{FrameFile, likely};
use tactomo::board::{identity, measured};
use tactomo::detector::Detector;
use tactomo::forward::jacobian::Jacobian;
use tactomo::learned::Learned;
use tactomo::solve::{
    ContactSettings, FaultTolerant, Kernel, Lambda, Method, Parameter, ParameterKind, Problem, Solver,
};
use tactomo_cli::output::message;

use super::reader::{Input, Touch};
use super::units::Unit;

/// A file and what solves it.
pub struct Opened {
    /// The file.
    pub file: FrameFile,
    /// What solves its frames.
    pub touch: Touch,
    /// The linear theory of the detector that it must be of, as its board measures it, if that is known.
    pub jacobian: Option<Arc<Jacobian>>,
    /// The same as it was chosen.
    pub chosen: Option<Detector>,
}

impl Opened {
    /// Opens what is read, and makes the solver, by what teaches it, if anything does.
    pub fn of(input: &Input, solver: Method, taught: Option<Learned>) -> anyhow::Result<Self> {
        match taught {
            Some(Learned::Kernel(kernel)) => learned(input, kernel),
            other => solved(input, solver, other),
        }
    }
}

/// A kernel that has learned from presses.
fn learned(input: &Input, kernel: Arc<Kernel>) -> anyhow::Result<Opened> {
    if input.detector.detector.is_some() || input.detector.material.is_some() {
        bail!("what was learned from presses needs no detector: leave out --detector and --material");
    }
    message!("{}", kernel.sentence());
    let file = FrameFile::open_by(input.file, Some(kernel.channels()), |table| kernel.readings_of(table))?;
    if file.channels() != kernel.channels() {
        bail!(
            "{} has {} readings a frame, but the presses have {} channels",
            input.file.display(),
            file.channels(),
            kernel.channels()
        );
    }
    Ok(Opened { file, touch: Touch::Kernel(kernel), jacobian: None, chosen: None })
}

/// A solver for the detector.
fn solved(input: &Input, method: Method, learned: Option<Learned>) -> anyhow::Result<Opened> {
    // That of a recording is in its header, unless another one is given.
    let given = input.detector.get()?.electrodes.len();
    let mut file = FrameFile::open(input.file, Some(given * given))?;
    if input.keeps_found {
        file.keep_found();
    }
    let chosen = match file.header() {
        Some(header) => input.detector.of_recording(input.file, header)?,
        None => input.detector.get()?,
    };
    let electrodes = chosen.electrodes.len();
    let detector = match file.board() {
        Some(board) => {
            if let Some(notice) = identity::other_board(&chosen, board) {
                message!("warning: {notice}");
            }
            let measured = measured::as_measured(&chosen, board)?;
            file.set_ground(measured.ground_v);
            measured
        }
        None => input.unit.unwrap_or(Unit::Volt).read(chosen.clone()),
    };
    let correction = detector.correction.filter(|_| !input.uncorrected);
    let detector = Detector { force: input.force.clone().or(detector.force), correction, ..detector };
    if file.channels() != electrodes * electrodes {
        let likely = likely(file.channels(), electrodes).map_or_else(String::new, |what| format!(" ({what})"));
        bail!(
            "{} has {} readings a frame{likely}, but the detector {} with its {electrodes} electrodes needs {}: give the right one \
             with --detector",
            input.file.display(),
            file.channels(),
            detector.name,
            electrodes * electrodes
        );
    }
    let problem = Problem::new(input.model.build(&detector, None)?);
    let problem = match learned {
        Some(learned) => problem.with_learned(learned)?,
        None => problem,
    };
    let solver = solver(method, input.lambda, &problem)?;
    let mesh = problem.jacobian.image_mesh.clone();
    let usual_radius_m = ContactSettings::of(&problem).radius_m;
    let touch = Touch::Solver { solver, detector: Box::new(detector), mesh, usual_radius_m, rows: None };
    Ok(Opened { file, touch, jacobian: Some(problem.jacobian), chosen: Some(chosen) })
}

/// The solver, which leaves out faulty electrodes; or, with a given lambda, of all electrodes.
fn solver(method: Method, lambda: Option<Lambda>, problem: &Problem) -> anyhow::Result<Box<dyn Solver>> {
    match lambda.map(Parameter::Lambda) {
        None => Ok(Box::new(FaultTolerant::new(method, problem)?)),
        Some(_) if method.parameter() != Some(ParameterKind::Lambda) => {
            bail!(
                "the solver {} has no lambda: leave out --lambda, or give a --solver that has one, such as tikhonov",
                method.name()
            )
        }
        lambda => Ok(method.build_with(problem, lambda)?),
    }
}
