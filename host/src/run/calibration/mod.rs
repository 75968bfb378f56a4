//! Calibration by rubbing, while the picture goes on: frames are collected, spread over the detector, and fitted every few seconds, so that a
//! person sees where to rub and what it brings, until more brings nothing.

mod collected;
mod fit;
pub(super) mod messages;
mod save;
mod session;

use std::path::PathBuf;
use std::sync::Arc;

use tactomo_physics::detector::Detector;
use tactomo_touch::calibrate::Rub;
use tactomo_touch::solve::FoundContact;

pub use self::collected::Coverage;
pub use self::messages::Calibrate;
pub(super) use self::messages::Outcome;
use self::session::RubSession;
use super::detector::DetectorState;
use super::inbox::{Inbox, Taken};
use super::notice::NoticeBoard;

/// How far a calibration is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Frames are collected.
    Rubbing,
    /// All of them are fitted.
    Finishing,
    /// There is a detector to save and to use.
    Done,
}

/// A calibration as it is shown.
#[derive(Clone, Debug)]
pub struct Calibrating {
    /// How far it is.
    pub stage: Stage,
    /// Where has been rubbed.
    pub coverage: Coverage,
    /// Frames that something touched in.
    pub touched: u64,
    /// Whether a fit is under way.
    pub fitting: bool,
    /// Expected standard error of a place (m) after each fit.
    pub errors_m: Vec<f64>,
    /// The newest fit.
    pub fit: Option<Arc<Rub>>,
    /// Why there is none, or no newer one, as a sentence for a person.
    pub trouble: Option<String>,
    /// The file that was written.
    pub saved: Option<PathBuf>,
    /// Whether the picture uses the detector that was found.
    pub used: bool,
}

/// The calibration under way in the follower, if one is, and what is shown of it.
pub(super) struct Calibration {
    inbox: Arc<Inbox>,
    notice: Arc<NoticeBoard>,
    /// Where calibrated detectors are saved.
    folder: PathBuf,
    session: Option<RubSession>,
    /// How many there have been.
    begun: u64,
}

impl Calibration {
    /// None yet; what comes of them in other threads goes through `inbox`.
    pub fn new(inbox: Arc<Inbox>, notice: Arc<NoticeBoard>, folder: PathBuf) -> Self {
        Self { inbox, notice, folder, session: None, begun: 0 }
    }

    /// Does what a person asks, on a detector of this description and a board of this identity; the detector to go on with, if one is to be.
    pub fn ask(&mut self, ask: Calibrate, description: &Arc<Detector>, board: Option<String>) -> Option<Arc<Detector>> {
        let mut used = None;
        match (ask, &mut self.session) {
            (Calibrate::Begin, None) => {
                self.begun += 1;
                let (description, inbox) = (Arc::clone(description), Arc::clone(&self.inbox));
                self.session = Some(RubSession::new(self.begun, description, board, self.folder.clone(), inbox));
            }
            (Calibrate::End, _) => self.session = None,
            (Calibrate::Use, Some(session)) => used = session.use_found(),
            (ask, Some(session)) => session.ask(ask),
            (_, None) => {}
        }
        self.show();
        used
    }

    /// Ends it: the frames to come are those of another board, or of other settings of its converter.
    pub fn end(&mut self) {
        self.session = None;
        self.show();
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

    /// Takes what has come of work in another thread, for the calibration of this number.
    pub fn receive(&mut self, number: u64, outcome: Outcome) {
        if let Some(session) = &mut self.session {
            session.receive(number, outcome);
        }
        self.show();
    }

    /// Shows how it is, if that is due.
    fn show(&mut self) {
        match &mut self.session {
            None => self.notice.change(|snapshot| snapshot.calibrating = None),
            Some(session) => {
                if let Some(shown) = session.newly_shown() {
                    self.notice.change(|snapshot| snapshot.calibrating = Some(Arc::new(shown)));
                }
            }
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
    fn one_calibration_at_a_time_is_shown_until_it_ends() {
        let (snapshots, receiver) = watch::channel(Arc::default());
        let notice = Arc::new(NoticeBoard::new(snapshots));
        let inbox = Arc::new(Inbox::new(false));
        let mut calibration = Calibration::new(inbox, Arc::clone(&notice), PathBuf::from("."));
        let description = Arc::new(Detector::default());
        let mut ask = |ask| calibration.ask(ask, &description, None);
        assert!(ask(Calibrate::Save).is_none() && shown(&notice, &receiver).is_none(), "there is none to save");
        for _ in 0..2 {
            ask(Calibrate::Begin);
            assert_eq!(shown(&notice, &receiver), Some(Stage::Rubbing));
        }
        assert!(ask(Calibrate::Use).is_none(), "nothing is found yet");
        ask(Calibrate::End);
        assert_eq!((shown(&notice, &receiver), calibration.begun), (None, 1));
    }
}
