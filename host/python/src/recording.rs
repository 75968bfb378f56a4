//! `Recording`: the frames of a file.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyAny, PyDict};
use tactomo::board::baseline::BaselineTracker;
use tactomo::board::frames::{FileFrame, FrameFile};
use tactomo::board::record::RecordReader;
use tactomo::board::{identity, measured};
use tactomo::detector::Detector as Described;
use tactomo::readings::{Readings, Rounds};
use tactomo::solve::Problem;

use crate::detector::Detector;
use crate::error::{raised, refused};
use crate::forward::array;
use crate::json;

/// A recording: all bytes of a board, and the detector that they were taken from.
///
/// To iterate over it gives its frames, each time from the start; `less_baseline()` gives what solvers take. Frames that hold
/// some rows only are gathered to whole ones. `detector` is used in place of the one in the recording.
#[pyclass(frozen, module = "tactomo")]
pub struct Recording {
    path: PathBuf,
    detector: Described,
    header: String,
    board: String,
}

impl Recording {
    fn open(path: PathBuf, detector: Option<Described>) -> PyResult<Self> {
        let reader = RecordReader::open(&path).map_err(raised)?;
        let header = reader.header();
        let chosen = match detector {
            Some(detector) => detector,
            None => recorded(&path, header)?,
        };
        let file = FrameFile::open(&path, None).map_err(raised)?;
        let board = file.board().ok_or_else(|| refused(format!("{}: it is no recording", path.display())))?;
        Ok(Self {
            detector: measured::as_measured(&chosen, board).map_err(raised)?,
            header: serde_json::to_string(header).map_err(raised)?,
            board: identity::identity(board),
            path,
        })
    }

    fn file(&self) -> PyResult<FrameFile> {
        let mut file = FrameFile::open(&self.path, None).map_err(raised)?;
        file.set_ground(self.detector.ground_v);
        Ok(file)
    }

    fn frames(&self) -> PyResult<Frames> {
        Ok(Frames { file: self.file()?, rounds: Default::default(), baseline: None })
    }
}

/// The detector of a header.
fn recorded(path: &Path, header: &tactomo::board::record::Header) -> PyResult<Described> {
    header.detector(path).map_err(raised)?.ok_or_else(|| {
        refused(format!("{}: its header does not say which detector it is of: give one as `detector`", path.display()))
    })
}

#[pymethods]
impl Recording {
    #[new]
    #[pyo3(signature = (path, detector = None))]
    fn new(py: Python<'_>, path: PathBuf, detector: Option<&Detector>) -> PyResult<Self> {
        let detector = detector.map(|detector| detector.0.clone());
        py.detach(|| Self::open(path, detector))
    }

    /// The detector, as the recording's board measures it.
    #[getter]
    fn detector(&self) -> Detector {
        Detector(self.detector.clone())
    }

    /// What the recording says about itself: `{detector, source, started_unix_s, notes, ...}`.
    #[getter]
    fn header<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::loads(py, &self.header)
    }

    /// Identity of the board.
    #[getter]
    fn board(&self) -> &str {
        &self.board
    }

    /// The file.
    #[getter]
    fn path(&self) -> &Path {
        &self.path
    }

    fn __iter__(&self, py: Python<'_>) -> PyResult<Frames> {
        py.detach(|| self.frames())
    }

    /// Its frames less the baseline (V), for `Solver.solve`: the baseline that the live picture would take, or, where `rest` is given, the
    /// mean of so many frames at the start, which are left out then.
    #[pyo3(signature = (rest = None))]
    fn less_baseline(&self, py: Python<'_>, rest: Option<u32>) -> PyResult<Frames> {
        py.detach(|| {
            let mut frames = self.frames()?;
            let problem = Problem::of(&self.detector).map_err(raised)?;
            let jacobian = Arc::clone(&problem.jacobian);
            let conversions = frames.file.board().map_or(1, |board| board.settings.conversions());
            let baseline = match rest {
                None => BaselineTracker::new(jacobian, conversions),
                Some(rest) => BaselineTracker::given(jacobian, conversions, rest),
            };
            frames.baseline = Some((baseline, rest.unwrap_or(0)));
            Ok(frames)
        })
    }

    /// All frames as arrays: `{time_s (frames,), sequence (frames,), lost_before (frames,), readings_v (frames, n, n), used_v (frames, n, n)}`;
    /// readings as measured and as they are used.
    pub fn arrays<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = py.detach(|| -> PyResult<All> {
            let mut all = All::default();
            let mut frames = self.frames()?;
            while let Some(frame) = frames.next()? {
                all.add(&frame);
            }
            Ok(all)
        })?;
        let n = self.detector.electrodes.len();
        let frames = all.time_s.len();
        let volts =
            |volts| -> PyResult<Bound<'_, PyArray3<f64>>> { PyArray1::from_vec(py, volts).reshape([frames, n, n]) };
        let arrays = PyDict::new(py);
        arrays.set_item("time_s", PyArray1::from_vec(py, all.time_s))?;
        arrays.set_item("sequence", PyArray1::from_vec(py, all.sequence))?;
        arrays.set_item("lost_before", PyArray1::from_vec(py, all.lost_before))?;
        arrays.set_item("readings_v", volts(all.readings_v)?)?;
        arrays.set_item("used_v", volts(all.used_v)?)?;
        Ok(arrays)
    }

    /// What is damaged or missing in the file, in words; `None` if nothing is. Reads all of it.
    fn damage(&self, py: Python<'_>) -> PyResult<Option<String>> {
        py.detach(|| {
            let mut file = self.file()?;
            while file.next_frame().map_err(raised)?.is_some() {}
            Ok(file.loss().filter(|loss| loss.is_any()).map(|loss| loss.to_string()))
        })
    }

    fn __repr__(&self) -> String {
        format!("Recording({:?}, {:?})", self.path, self.detector.name)
    }
}

/// Numbers of all frames.
#[derive(Default)]
struct All {
    time_s: Vec<f64>,
    sequence: Vec<u64>,
    lost_before: Vec<u64>,
    readings_v: Vec<f64>,
    used_v: Vec<f64>,
}

impl All {
    fn add(&mut self, frame: &Frame) {
        self.time_s.push(frame.time_s);
        self.sequence.push(frame.sequence);
        self.lost_before.push(frame.lost_before);
        self.readings_v.extend_from_slice(frame.measured.volts());
        self.used_v.extend_from_slice(frame.readings.volts());
    }
}

/// Frames of a recording, one after the other.
#[pyclass(module = "tactomo")]
pub struct Frames {
    file: FrameFile,
    /// As measured, and as used.
    rounds: [Rounds; 2],
    /// The baseline to take off, and how many frames are still to come that are nothing else.
    baseline: Option<(BaselineTracker, u32)>,
}

impl Frames {
    fn next(&mut self) -> PyResult<Option<Frame>> {
        let mut lost_before = 0;
        while let Some(mut frame) = self.file.next_frame().map_err(raised)? {
            lost_before += frame.lost_before;
            if let Some((baseline, given)) = &mut self.baseline {
                frame.note_rest(baseline);
                if *given > 0 {
                    *given -= 1;
                    continue;
                }
                frame.subtract(baseline);
            }
            if let Some(frame) = self.whole(&frame, lost_before) {
                return Ok(Some(frame));
            }
        }
        Ok(None)
    }

    fn whole(&mut self, frame: &FileFrame, lost_before: u64) -> Option<Frame> {
        let (time_s, sequence) = (frame.time_s.unwrap_or_default(), frame.sequence.unwrap_or_default());
        let [measured, used] = &mut self.rounds;
        let measured = measured.add(&frame.measured()?, time_s);
        let readings = used.add(&frame.readings()?, time_s).filter(Readings::is_whole)?;
        Some(Frame { time_s, sequence, lost_before, measured: measured?, readings })
    }
}

#[pymethods]
impl Frames {
    fn __iter__(slf: PyRef<'_, Self>) -> PyRef<'_, Self> {
        slf
    }

    fn __next__(&mut self, py: Python<'_>) -> PyResult<Option<Frame>> {
        py.detach(|| self.next())
    }
}

/// A frame of a recording.
#[pyclass(frozen, module = "tactomo")]
pub struct Frame {
    time_s: f64,
    sequence: u64,
    lost_before: u64,
    measured: Readings,
    readings: Readings,
}

impl Frame {
    /// Its readings (V).
    pub fn readings(&self) -> &Readings {
        &self.readings
    }
}

#[pymethods]
impl Frame {
    /// Board time since the first frame (s).
    #[getter]
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// The board's number of the scan.
    #[getter]
    fn sequence(&self) -> u64 {
        self.sequence
    }

    /// Scans that are missing since the frame before.
    #[getter]
    fn lost_before(&self) -> u64 {
        self.lost_before
    }

    /// Readings as measured (V), `(n, n)`: `readings_v[g][e]` is electrode `e` while `g` is grounded.
    #[getter]
    fn readings_v<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array(py, &self.measured)
    }

    /// The same as they are used (V), less the baseline where that is taken off: a reading within two deviations of the noise of an end of its
    /// converter's range is the bound there.
    #[getter(readings)]
    fn used_v<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array(py, &self.readings)
    }

    fn __repr__(&self) -> String {
        format!("Frame(sequence={}, time_s={})", self.sequence, self.time_s)
    }
}
