//! Recordings that are solved together: their answers, in the order of their times.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use anyhow::Context;
use tactomo::board::frames::FileFrame;
use tactomo::board::record::{Header, RecordError, RecordReader};
use tactomo::changes::Changes;
use tactomo::detector::Detector;
use tactomo::forward::ImageMesh;
use tactomo::pointer::Pointer;
use tactomo::readings::Readings;
use tactomo::run::{Arrival, Frame, TouchEvent};
use tactomo::sink::place::Place;
use tactomo::sink::{Delivery, Renewal};
use tactomo::solve::Solution;
use tactomo_cli::output::message;
use tactomo_protocol::Hello;

use crate::commands::reconstruct::reader::{Input, Reader};
use crate::commands::streams::Streamed;

/// A recording that is being solved.
pub struct Recording {
    /// Name of its detector among several; empty if it is alone.
    name: Arc<str>,
    /// Where its detector lies on a body, if that is told.
    place: Option<Place>,
    renewal: Renewal,
    reader: Reader,
    header: Header,
    /// Its length (s), and how far it is solved (s).
    recorded_s: f64,
    solved_s: f64,
    changes: Changes,
    pointer: Option<Pointer>,
    /// Frames that the link or the board have lost so far.
    lost: u64,
    answers: u64,
}

/// What a frame gave.
pub struct Answer {
    /// The event, of the detector that it names.
    pub delivery: Delivery,
    /// Number of the frame in its recording, from 0.
    pub number: u64,
}

/// Recordings, and the next answer of each.
pub struct Answers {
    recordings: Vec<Recording>,
    next: Vec<Option<Answer>>,
}

impl Answers {
    /// Of recordings, of which each is in the order of its times.
    pub fn new(recordings: Vec<Recording>) -> Self {
        let next = recordings.iter().map(|_| None).collect();
        Self { recordings, next }
    }

    /// The earliest answer that was not given yet, by when it came; `None` at the end of all.
    pub fn next(&mut self) -> anyhow::Result<Option<Answer>> {
        for (recording, next) in self.recordings.iter_mut().zip(&mut self.next) {
            if next.is_none() {
                *next = recording.next()?;
            }
        }
        let time_ns = |answer: &Answer| answer.delivery.event.frame.arrived.unix_ns;
        let earliest = self.next.iter_mut().filter(|next| next.is_some()).min_by_key(|next| next.as_ref().map(time_ns));
        Ok(earliest.and_then(Option::take))
    }

    /// The recordings.
    pub fn recordings(&self) -> &[Recording] {
        &self.recordings
    }

    /// Length of all together (s).
    pub fn recorded_s(&self) -> f64 {
        self.recordings.iter().map(|recording| recording.recorded_s).sum()
    }

    /// How much of that is solved (s).
    pub fn solved_s(&self) -> f64 {
        self.recordings.iter().map(|recording| recording.solved_s).sum()
    }
}

impl Recording {
    /// Opens a recording, of a detector of such a name among several, which lies there; an empty one is alone.
    pub fn open(name: &str, place: Option<Place>, input: &Input, has_pointer: bool) -> anyhow::Result<Self> {
        let open = |source| RecordError::Open { path: input.file.to_owned(), source };
        let mut recording = RecordReader::open(input.file)?;
        let last_us = recording.last_time_us().map_err(open)?.unwrap_or_default();
        Ok(Self {
            name: name.into(),
            place,
            renewal: Renewal::default(),
            reader: Reader::open(input)?,
            header: recording.header().clone(),
            recorded_s: last_us as f64 * 1e-6,
            solved_s: 0.0,
            changes: Changes::default(),
            pointer: has_pointer.then(Pointer::default),
            lost: 0,
            answers: 0,
        })
    }

    /// What its next frame gave; `None` at its end.
    fn next(&mut self) -> anyhow::Result<Option<Answer>> {
        let Some(frame) = self.reader.next_frame()? else { return Ok(None) };
        let solution = self.reader.solve(&frame).with_context(|| self.reader.place())?;
        self.lost += frame.lost_before;
        self.solved_s = frame.arrived_s.unwrap_or_default();
        let mut event = event(&self.reader, &frame, solution, (self.header.started(), self.lost))?;
        if let Some(pointer) = &mut self.pointer {
            event.pointer_events = pointer.take(event.frame.time_s(), &event.solution.contacts);
        }
        self.answers += 1;
        let (patch, renews) = (Arc::clone(&self.name), self.renewal.is_due(event.frame.arrived.unix_ns));
        let delivery = Delivery { patch, renews, ..Delivery::at_once(event, &mut self.changes) };
        Ok(Some(Answer { delivery, number: self.reader.frame() as u64 }))
    }

    /// Places of its images.
    pub fn mesh(&self) -> Option<&ImageMesh> {
        self.reader.mesh()
    }

    /// Its board.
    pub fn board(&self) -> Option<&Hello> {
        self.reader.board()
    }

    /// Its detector, as streams know it.
    pub fn streamed(&self) -> anyhow::Result<Streamed> {
        let known = self.reader.measured().zip(self.reader.mesh());
        let (detector, mesh) = known.context("an MCAP file needs a detector")?;
        let streamed = Streamed::of(detector, mesh, self.reader.usual_radius_m(), &self.header.source);
        Ok(streamed.of_patch(&self.name, self.place))
    }

    /// Its detector, by name.
    pub fn named(&self) -> Option<(Arc<str>, Detector)> {
        Some((Arc::clone(&self.name), self.reader.measured()?.clone()))
    }

    /// Says what it came to, and what to know of it.
    pub fn tell(&self, out: &Path) {
        let of = if self.name.is_empty() { String::new() } else { format!("{}: ", self.name) };
        message!("{of}{}: {} frames in {}", self.reader.name(), self.answers, out.display());
        self.reader.notice().iter().for_each(|notice| message!("{of}{notice}"));
        self.reader.warn();
    }
}

/// What a frame gave; `lost` frames so far of a recording that was `started` at that time since 1970.
fn event(
    reader: &Reader,
    frame: &FileFrame,
    solution: Solution,
    (started, lost): (Duration, u64),
) -> anyhow::Result<TouchEvent> {
    let electrodes = frame.volts.len().isqrt();
    let used = Readings::new(electrodes, reader.used_v().to_vec());
    let touch = reader.touch(frame).with_context(|| reader.place())?;
    let (measured, used) = frame.measured().zip(used).with_context(|| reader.place())?;
    let time_s = frame.time_s.unwrap_or_default().max(0.0);
    let arrived = Duration::from_secs_f64(frame.arrived_s.unwrap_or(time_s).max(0.0));
    let came = Frame {
        sequence: frame.sequence.unwrap_or_default(),
        delay: frame.delay,
        board_time_us: (time_s * 1e6).round() as u64,
        lost,
        ..Frame::first(measured, used.saying(|g, e| touch.says(g, e)), Arrival::recorded(started + arrived))
    };
    Ok(TouchEvent {
        lost_before: frame.lost_before,
        is_taking_baseline: reader.is_taking_baseline(),
        ..TouchEvent::new(came, touch, solution)
    })
}
