//! What becomes of the bytes besides the picture: the recording, the ring of the last seconds, and what is set down in them.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use tactomo_board::record::{Closing, Note, RecordError, Recorder, Ring};
use tactomo_physics::causes::with_causes;
use tactomo_physics::detector::Detector;
use tactomo_protocol::Hello;

use super::notice::NoticeBoard;
use super::options::{BeginRecording, LiveError, RunOptions};

/// What is kept of a run.
pub(super) struct Recordings {
    recorder: Option<Recorder>,
    ring: Option<Ring>,
    begin: Option<BeginRecording>,
    notice: Arc<NoticeBoard>,
    /// Recordings that were ended and are still written, and why one failed.
    closing: Vec<Closing>,
    lost: Option<RecordError>,
    /// The detector that a calibration has found.
    found: Option<Arc<Detector>>,
    /// Marks in the recording under way.
    marks: u64,
}

impl Recordings {
    /// What these options want to be kept.
    pub fn of(options: &mut RunOptions, notice: Arc<NoticeBoard>) -> Self {
        let recordings = Self {
            recorder: options.recorder.take(),
            ring: options.ring.take(),
            begin: options.begin_recording.take(),
            notice,
            closing: Vec::new(),
            lost: None,
            found: None,
            marks: 0,
        };
        recordings.show();
        recordings
    }

    /// Takes bytes as they came.
    ///
    /// # Errors
    /// [`RecordError`] if they cannot be kept; then that recording is over.
    pub fn push(&mut self, bytes: &[u8], received: Instant) -> Result<(), RecordError> {
        let kept = match &mut self.recorder {
            Some(recorder) => recorder.push(bytes, received).inspect_err(|_| self.recorder = None),
            None => Ok(()),
        };
        let Some(ring) = &mut self.ring else { return kept };
        let saved = ring.push(bytes, received).inspect_err(|_| self.ring = None);
        if let Ok(Some(path)) = &saved {
            tracing::info!("saving to {}", path.display());
        }
        kept.and(saved.map(drop))
    }

    /// Goes on without a recording that failed; it is told at the end too.
    pub fn give_up(&mut self, error: RecordError) {
        let line = with_causes(&error);
        tracing::error!("{line}");
        let refused = Some(line);
        self.notice.change(|snapshot| snapshot.refused.recording = refused);
        self.show();
        self.lost.get_or_insert(error);
    }

    /// Takes what the board says of itself.
    pub fn hello(&mut self, hello: &Hello) {
        if let Some(ring) = &mut self.ring {
            ring.hello(hello);
        }
    }

    /// Sets a mark.
    pub fn mark(&mut self, text: String) {
        let refused = match &mut self.recorder {
            None => Some("A mark is set in a recording: begin one first (key R).".to_owned()),
            Some(recorder) => {
                self.marks += 1;
                recorder.note(Note::Mark { text }, Instant::now()).err().map(|error| with_causes(&error))
            }
        };
        let marks = self.marks;
        self.notice.change(|snapshot| (snapshot.refused.recording, snapshot.marks) = (refused, marks));
    }

    /// Sets down when the board was sent commands of such tags.
    pub fn asked(&mut self, sent: Vec<(u8, Instant)>) {
        let Some(recorder) = &mut self.recorder else { return };
        for (tag, at) in sent {
            // What cannot be written is told with the next bytes.
            let _ = recorder.note(Note::Asked { tag }, at);
        }
    }

    /// Sets down what a calibration has found, in this recording and those to come.
    pub fn found(&mut self, detector: Option<Arc<Detector>>) {
        let (Some(detector), known) = (detector, &self.found) else { return };
        if known.as_ref().is_some_and(|known| Arc::ptr_eq(known, &detector)) {
            return;
        }
        if let Some(recorder) = &mut self.recorder {
            // What cannot be written is told with the next bytes.
            let _ = recorder.note(Note::detector_found(&detector), Instant::now());
        }
        self.found = Some(detector);
    }

    /// Begins a recording of a board in a new file, if none is being kept.
    pub fn begin(&mut self, hello: &Hello) {
        let (None, Some(begin)) = (&self.recorder, &mut self.begin) else { return };
        let begun = begin(hello, self.found.as_deref());
        let refused = begun.as_ref().err().map(|error| with_causes(error));
        self.notice.change(|snapshot| snapshot.refused.recording = refused);
        (self.recorder, self.marks) = (begun.ok(), 0);
        self.show();
    }

    /// Ends the recording; what is left is written meanwhile.
    pub fn end(&mut self) {
        let Some(recorder) = self.recorder.take() else { return };
        self.closing.push(recorder.close());
        self.notice.change(|snapshot| snapshot.refused.recording = None);
        self.show();
    }

    /// Writes what is left of all recordings.
    ///
    /// # Errors
    /// The first that could not be kept.
    pub fn finish(&mut self) -> Result<(), LiveError> {
        let last = self.recorder.take().map(Recorder::close);
        let finished: Vec<_> = self.closing.drain(..).chain(last).map(Closing::wait).collect();
        let ring = self.ring.take().map_or(Ok(()), Ring::finish);
        let lost = self.lost.take().map_or(Ok(()), Err);
        Ok(finished.into_iter().chain([ring]).fold(lost, Result::and)?)
    }

    fn show(&self) {
        let path: Option<PathBuf> = self.recorder.as_ref().map(|recorder| recorder.path().to_owned());
        let marks = self.marks;
        self.notice.change(|snapshot| (snapshot.recording, snapshot.marks) = (path, marks));
    }
}

#[cfg(test)]
mod tests {
    use tactomo_board::record::Header;
    use tokio::sync::watch;

    use super::super::Snapshot;
    use super::*;

    #[test]
    fn a_recording_that_cannot_begin_is_told_until_one_begins_whatever_else_is_granted() {
        let folder = std::env::temp_dir().join(format!("tactomo-recordings-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder for temporary files");
        let mut names = ["missing/touch", "touch"].into_iter();
        let path = folder.clone();
        let begin = move |hello: &Hello, _: Option<&Detector>| {
            let name = path.join(names.next().unwrap_or_default()).with_extension("tactomo");
            Recorder::create_with_hello(&name, &Header::default(), hello)
        };
        let mut options = RunOptions { begin_recording: Some(Box::new(begin)), ..RunOptions::new(Detector::default()) };
        let (snapshots, shown) = watch::channel(Arc::new(Snapshot::default()));
        let notice = Arc::new(NoticeBoard::new(snapshots));
        let mut recordings = Recordings::of(&mut options, Arc::clone(&notice));
        let refused = |change: fn(&mut Snapshot)| {
            notice.publish(change);
            shown.borrow().refused.recording.clone()
        };
        recordings.begin(&Hello::example(16));
        assert!(refused(|_| ()).is_some_and(|words| words.contains("missing")));
        // What is asked of the simulated board, as a press, is granted: that is another matter.
        assert!(refused(|snapshot| snapshot.refused.control = None).is_some());
        recordings.begin(&Hello::example(16));
        assert_eq!(refused(|_| ()), None);
        recordings.finish().expect("a folder that can be written to");
        std::fs::remove_dir_all(&folder).expect("its own folder");
    }
}
