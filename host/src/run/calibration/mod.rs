//! Calibration while the picture goes on: frames of a contact are collected, spread over the detector, and fitted. Unasked, the detector is
//! learned from whatever presses, and used once it helps. Where a person asks, it is fitted every few seconds, so that they see where to rub
//! and what it brings, until more brings nothing.

mod collected;
mod fit;
mod guide;
mod learning;
pub(super) mod messages;
mod save;
mod session;
mod worth;

use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;
use std::thread;

use tactomo_board::identity::Sensor;
use tactomo_physics::causes::with_causes;
use tactomo_physics::detector::{Calibration as Calibrated, Detector};
use tactomo_touch::calibrate::Rub;
use tactomo_touch::solve::FoundContact;

pub use self::collected::Coverage;
pub use self::guide::Target;
pub use self::learning::{Keeping, Kept, Learning};
pub use self::messages::Calibrate;
pub(super) use self::messages::Outcome;
use self::session::RubSession;
pub use self::worth::Compared;
use super::detector::DetectorState;
use super::inbox::{Inbox, Taken};
use super::notice::NoticeBoard;

/// How far a calibration is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Nobody has asked: it learns from what presses anyway.
    Learning,
    /// Frames are collected.
    Rubbing,
    /// All of them are fitted.
    Finishing,
    /// There is a detector to save and to use, or a reason to keep the present one.
    Done,
}

/// A calibration as it is shown.
#[derive(Clone, Debug)]
pub struct Calibrating {
    /// How far it is.
    pub stage: Stage,
    /// Where has been rubbed.
    pub coverage: Coverage,
    /// Where to press next.
    pub target: Option<Target>,
    /// Frames that something touched in.
    pub touched: u64,
    /// Whether a fit is under way.
    pub fitting: bool,
    /// Expected standard error of a place (m) after each fit.
    pub errors_m: Vec<f64>,
    /// The newest fit.
    pub fit: Option<Arc<Rub>>,
    /// What that is worth, on presses that were not used.
    pub compared: Option<Compared>,
    /// Why the present detector is to be kept, once all is fitted, as a sentence for a person; none if what was found is better.
    pub keep: Option<String>,
    /// Why there is none, or no newer one, as a sentence for a person.
    pub trouble: Option<String>,
    /// The file that was written.
    pub saved: Option<PathBuf>,
    /// Whether the picture uses the detector that was found.
    pub used: bool,
}

/// What was learned of the detector while it was used, and is in use.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct LearnedInUse {
    /// Presses that it was fitted to.
    pub presses: usize,
    /// Standard error that places are expected to have (m): the median over the detector, of a press of medium firmness in one frame.
    pub place_error_m: f64,
}

impl LearnedInUse {
    fn of(calibration: &Calibrated) -> Self {
        Self { presses: calibration.presses, place_error_m: calibration.place_error_m.unwrap_or(f64::INFINITY) }
    }
}

impl fmt::Display for LearnedInUse {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { presses, place_error_m } = self;
        write!(formatter, "places known to {:.2} mm, learned from {presses} presses", 1e3 * place_error_m)
    }
}

/// What is to be used on a sensor that is connected.
pub(super) enum Meeting {
    /// What is in use.
    AsBefore,
    /// What was learned of it before.
    Known(Arc<Detector>),
    /// Its description: what is in use was learned of another.
    Unknown(Arc<Detector>),
}

/// The calibration of the detector that is connected, in the follower, and what is shown of it.
pub(super) struct Calibration {
    inbox: Arc<Inbox>,
    notice: Arc<NoticeBoard>,
    /// Where calibrated detectors are saved.
    folder: PathBuf,
    /// How the detector is learned unasked, if it is.
    learning: Option<Learning>,
    /// The sensor that is connected, once its board has said Hello.
    sensor: Option<Sensor>,
    session: Option<RubSession>,
    /// How many there have been.
    begun: u64,
    /// The detector that was found, by this run or one before, and is in use.
    used: Option<Arc<Detector>>,
    /// What was learned unasked, if that is the one.
    learned: Option<LearnedInUse>,
    /// The file that was taken from, if a run before has kept it.
    learned_from: Option<PathBuf>,
}

impl Calibration {
    /// None yet; what comes of them in other threads goes through `inbox`.
    pub fn new(inbox: Arc<Inbox>, notice: Arc<NoticeBoard>, folder: PathBuf, learning: Option<Learning>) -> Self {
        Self {
            inbox,
            notice,
            folder,
            learning,
            sensor: None,
            session: None,
            begun: 0,
            used: None,
            learned: None,
            learned_from: None,
        }
    }

    /// Begins with a board's detector: frames before were those of another, or of other settings of its converter.
    pub fn begin_with(&mut self, detector: Arc<Detector>) {
        self.begun += 1;
        let ends = (Arc::clone(&self.inbox), Arc::clone(&self.notice));
        let described = self.learning.as_ref().map(|learning| Arc::new(learning.description.measured_as(&detector)));
        let learns = described.is_some();
        let description = described.unwrap_or(detector);
        let mut session = RubSession::new(self.begun, description, learns, self.folder.clone(), ends);
        session.set_used(self.used.clone());
        self.session = Some(session);
        self.show();
    }

    /// Takes note of the sensor that is connected: what was learned belongs to it alone.
    pub fn meet(&mut self, sensor: Sensor) -> Meeting {
        let before = self.sensor.replace(sensor);
        let (Some(learning), Some(sensor)) = (&self.learning, &self.sensor) else { return Meeting::AsBefore };
        if before.as_ref() == Some(sensor) {
            return Meeting::AsBefore;
        }
        let (kept, refused) = learning.kept(sensor);
        refused.iter().for_each(|why| tracing::warn!("{why}"));
        let description = self.session.as_ref().map(|session| Arc::clone(&session.description));
        let Some(description) = description else { return Meeting::AsBefore };
        if before.is_some() {
            // Presses so far were on another.
            let was_learned = self.learned.take().is_some();
            self.learned_from = None;
            self.used.take_if(|_| was_learned);
            self.begin_with(Arc::clone(&description));
            if was_learned && kept.is_none() {
                return Meeting::Unknown(description);
            }
        }
        let Some(Kept { file, detector }) = kept else { return Meeting::AsBefore };
        tracing::info!("what was learned before of this sensor is used: {}", file.display());
        let used = Arc::new(detector.measured_as(&description));
        (self.learned, self.used) = (detector.calibration.as_ref().map(LearnedInUse::of), Some(Arc::clone(&used)));
        self.learned_from = Some(file);
        self.session.iter_mut().for_each(|session| session.set_used(self.used.clone()));
        Meeting::Known(used)
    }

    /// Does what a person asks; the detector to go on with, if one is to be.
    pub fn ask(&mut self, ask: Calibrate) -> Option<Arc<Detector>> {
        let session = self.session.as_mut()?;
        let used = match ask {
            Calibrate::Use => session.use_found(),
            ask => {
                session.ask(ask);
                None
            }
        };
        self.show();
        used.map(|found| self.chosen(&found, None))
    }

    /// Remembers what is to be used from now on.
    fn chosen(&mut self, found: &Rub, learned: Option<LearnedInUse>) -> Arc<Detector> {
        let used = Arc::new(found.detector.clone());
        (self.used, self.learned, self.learned_from) = (Some(Arc::clone(&used)), learned, None);
        self.session.iter_mut().for_each(|session| session.set_used(self.used.clone()));
        used
    }

    /// Keeps what was learned for the next run, if it is to be: nobody waits for a disk.
    fn keep(&self, learned: &Arc<Detector>) {
        let (Some(learning), Some(sensor)) = (self.learning.clone(), self.sensor.clone()) else { return };
        let learned = Arc::clone(learned);
        let write = move || match learning.keep(&learned, &sensor) {
            Ok(Some(file)) => tracing::debug!("what was learned is kept in {}", file.display()),
            Ok(None) => {}
            Err(why) => tracing::warn!("{why}"),
        };
        if let Err(error) = thread::Builder::new().name("learned file".to_owned()).spawn(write) {
            tracing::warn!("what was learned is not kept: cannot start a thread: {}", with_causes(&error));
        }
    }

    /// Shows what was learned, once there is a solver for it.
    pub fn show_learned(&mut self) {
        let (learned, from) = (self.learned, self.learned_from.clone());
        self.notice.change(|snapshot| (snapshot.learned, snapshot.learned_from) = (learned, from));
    }

    /// Takes the newest frame, or the rows that came, and the contacts found in it: less the baseline, as the channels read them.
    pub fn take(&mut self, frame: &Taken, detector: &DetectorState, found: &[FoundContact]) {
        let Some(session) = &mut self.session else { return };
        if detector.baseline.state().is_taking() {
            return;
        }
        for rows in &frame.rows {
            session.take(&detector.less_baseline(&rows.readings), 1e-6 * rows.time_us as f64, found);
        }
        if frame.rows.is_empty() {
            session.take(&detector.less_baseline(&frame.newest.used), frame.newest.time_s(), found);
        }
        self.show();
    }

    /// Takes what has come of work in another thread, for the calibration of this number; the detector to go on with, if one was learned.
    pub fn receive(&mut self, number: u64, outcome: Outcome) -> Option<Arc<Detector>> {
        let session = self.session.as_mut().filter(|session| session.number == number)?;
        session.receive(outcome);
        let learned = session.learned();
        self.show();
        let found = learned?;
        let learned = found.detector.calibration.as_ref().map(LearnedInUse::of);
        learned.iter().for_each(|learned| tracing::info!("{learned}"));
        let used = self.chosen(&found, learned);
        self.keep(&used);
        Some(used)
    }

    /// Shows how it is, if that is due.
    fn show(&mut self) {
        match &mut self.session {
            Some(session) if session.is_open() => {
                if let Some(shown) = session.newly_shown() {
                    self.notice.change(|snapshot| snapshot.calibrating = Some(Arc::new(shown)));
                }
            }
            _ => self.notice.change(|snapshot| snapshot.calibrating = None),
        }
    }
}

#[cfg(test)]
mod tests {
    use tokio::sync::watch;

    use super::super::Snapshot;
    use super::*;

    fn shown(notice: &NoticeBoard, shown: &watch::Receiver<Arc<Snapshot>>) -> Option<Stage> {
        notice.publish(|_| {});
        shown.borrow().calibrating.as_ref().map(|calibrating| calibrating.stage)
    }

    #[test]
    fn what_was_learned_is_used_on_its_sensor_alone() {
        let folder = std::env::temp_dir().join(format!("tactomo-met-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let sensor = |serial: &str| Sensor {
            board: "test".to_owned(),
            serial_number: Some(serial.to_owned()),
            port: "COM3".to_owned(),
        };
        let described = Detector::default();
        let keeping = Keeping::Beside { description: folder.join("mine.toml"), patch: String::new() };
        let learning = Learning::of(&described, keeping).unwrap();
        let calibration =
            Calibrated { board: Some("test".to_owned()), place_error_m: Some(2e-4), ..Calibrated::default() };
        let mut learned = Detector { calibration: Some(calibration), ..described.clone() };
        learned.layers[0].thickness_m *= 1.1;
        learning.keep(&learned, &sensor("A7")).unwrap();
        let (snapshots, _receiver) = watch::channel(Arc::default());
        let (inbox, notice) = (Arc::new(Inbox::new(false)), Arc::new(NoticeBoard::new(snapshots)));
        let mut calibration = Calibration::new(inbox, notice, folder.clone(), Some(learning));
        calibration.begin_with(Arc::new(described.clone()));
        let thickness_m = |detector: &Detector| detector.layers[0].thickness_m;
        for _ in 0..2 {
            let Meeting::Known(used) = calibration.meet(sensor("A7")) else { panic!("it was learned") };
            assert_eq!(thickness_m(&used), thickness_m(&learned));
            assert!(matches!(calibration.meet(sensor("A7")), Meeting::AsBefore), "the board has come back");
            let Meeting::Unknown(used) = calibration.meet(sensor("B8")) else { panic!("it is another") };
            assert_eq!((thickness_m(&used), calibration.learned), (thickness_m(&described), None));
        }
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn one_calibration_at_a_time_is_shown_until_it_ends() {
        let (snapshots, receiver) = watch::channel(Arc::default());
        let notice = Arc::new(NoticeBoard::new(snapshots));
        let inbox = Arc::new(Inbox::new(false));
        let mut calibration = Calibration::new(inbox, Arc::clone(&notice), PathBuf::from("."), None);
        assert!(calibration.ask(Calibrate::Begin).is_none(), "there is no detector");
        calibration.begin_with(Arc::new(Detector::default()));
        let mut ask = |ask| calibration.ask(ask);
        assert!(ask(Calibrate::Save).is_none() && shown(&notice, &receiver).is_none(), "there is none to save");
        for _ in 0..2 {
            ask(Calibrate::Begin);
            assert_eq!(shown(&notice, &receiver), Some(Stage::Rubbing));
        }
        assert!(ask(Calibrate::Use).is_none(), "nothing is found yet");
        ask(Calibrate::End);
        assert_eq!(shown(&notice, &receiver), None);
    }
}
