//! The answers of the same solver to the recorded bytes, frame by frame and as long as they take.

use std::collections::HashSet;
use std::sync::Arc;

use tactomo::board::baseline::BaselineTracker;
use tactomo::board::frames::FrameFile;
use tactomo::readings::Readings;
use tactomo::solve::{FaultTolerant, Method, Problem, Solver};

use crate::SLOW;
use crate::live::{Answer, Live};

/// The answers to the frames that live has answered.
pub fn answers(problem: &Problem, method: Method, live: &Live) -> Vec<Answer> {
    let detector = problem.detector();
    let mut solver = FaultTolerant::new(method, problem).unwrap();
    let mut file = FrameFile::open(&live.recording, None).unwrap();
    let conversions = file.board().unwrap().settings.conversions();
    let mut baseline = BaselineTracker::new(Arc::clone(&problem.jacobian), conversions);
    let answered: HashSet<u64> = live.answers.iter().map(|answer| answer.sequence).collect();
    let last = answered.iter().max().copied().unwrap_or(0);
    let mut found = std::collections::HashMap::new();
    let mut sequence = 0;
    while let Some(frame) = file.next_frame().unwrap() {
        if sequence > last {
            break;
        }
        baseline.add(&frame.touches_v(), 1, frame.time_s.unwrap(), &[]);
        let is_answered = answered.contains(&sequence);
        if is_answered || !SLOW.contains(&method) {
            let mut touch = frame.volts.clone();
            baseline.subtract(&frame.volts, &mut touch);
            let mut readings = Readings::new(detector.electrodes.len(), touch).unwrap();
            readings.correct_channels(detector);
            let solution = solver.solve(&readings).unwrap();
            if is_answered {
                found.insert(sequence, solution);
            }
        }
        sequence += 1;
    }
    let answer = |answer: &Answer| Answer {
        sequence: answer.sequence,
        time_s: answer.time_s,
        solution: found[&answer.sequence].clone(),
    };
    live.answers.iter().map(answer).collect()
}
