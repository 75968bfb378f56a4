//! What a check's frames say of every electrode.

use tactomo_board::check::wiring;
use tactomo_physics::detector::Electrode;
use tactomo_physics::readings::Readings;
use tactomo_physics::space;
use tactomo_touch::solve::{ElectrodeFault, FaultyElectrodes, Look};

use super::advice::{self, Case};
use super::course::{Check, FINGERS};
use super::report::{ElectrodeReport, Report, State};
use super::touch::median;

/// Electrodes nearest to one that its readings are held against.
const NEIGHBOURS: usize = 4;
/// An input follows nothing if, under a hand, it rises by less than this share of what its neighbours rise by. Of five hands on each preset, the
/// least was 0.59 (on `strip-13x60`; on all others 0.85): see this module's tests.
const FOLLOWS: f64 = 0.2;
/// Presses of a fingertip that have to show the same exchange of wires.
const SHOWN: usize = 2;

impl Check {
    /// What has come out, as far as the check went. Looking for exchanged wires takes some 100 ms.
    pub fn report(&mut self, board: &str) -> Report {
        if let Some(pair) = exchanged(self) {
            self.watch.conclude(Look::Exchanged, Some(pair));
        }
        let electrodes = (0..self.detector.electrodes.len()).map(|e| electrode(self, board, e)).collect();
        let mut report = Report { electrodes, presses: self.presses.len(), notes: Vec::new(), sound: false };
        report.notes = advice::notes(self, &report);
        report.sound = report.faulty().next().is_none() && report.presses == 1 + FINGERS;
        report
    }
}

/// The two wires that are exchanged, as presses of a fingertip at different places show.
fn exchanged(check: &Check) -> Option<[usize; 2]> {
    let fingers = check.presses.get(1..).unwrap_or_default();
    let mut seen: Vec<[usize; 2]> = Vec::new();
    for finger in fingers {
        let Some(pair) = Look::Exchanged.run(&check.problem, check.watch.faulty(), finger) else { continue };
        if seen.iter().filter(|other| **other == pair).count() + 1 >= SHOWN {
            return Some(pair);
        }
        seen.push(pair);
    }
    None
}

fn electrode(check: &Check, board: &str, electrode: usize) -> ElectrodeReport {
    let pins = wiring::pins(board, electrode);
    let state = state(check, electrode);
    let with = with(check.watch.faulty(), state, electrode);
    let floats = check.restless.contains(&electrode);
    let case = Case { state, with: &with, pins: pins.as_ref(), is_read: !floats && is_read(check, electrode) };
    ElectrodeReport { advice: advice::electrode(&case), electrode, state, with, pins }
}

fn state(check: &Check, electrode: usize) -> State {
    if check.presses.is_empty() {
        return State::Untested;
    }
    let told = check.watch.faulty().faults.iter().find(|(wrong, _)| *wrong == electrode).map(|(_, fault)| *fault);
    match told {
        Some(ElectrodeFault::Open) => State::Open,
        Some(ElectrodeFault::Shorted) => State::Shorted,
        Some(ElectrodeFault::Exchanged) => State::Exchanged,
        _ if !is_read(check, electrode) => unread(check, electrode),
        Some(ElectrodeFault::Contradicting) => State::Contradicting,
        None if check.restless.contains(&electrode) => State::Unread,
        None => State::Ok,
    }
}

/// An input that follows nothing: beyond the drive's voltage nothing of the foam can be.
fn unread(check: &Check, electrode: usize) -> State {
    let rests_at_v = check.rest.as_ref().map_or(0.0, |rest| column(rest, electrode));
    if rests_at_v > check.detector.drive_v { State::AtEnd } else { State::Unread }
}

/// Whether an input follows the hand as its neighbours do.
fn is_read(check: &Check, electrode: usize) -> bool {
    let Some(hand) = check.presses.first() else { return false };
    let of = |e: usize| column(hand, e).abs();
    let neighbours = neighbours(&check.detector.electrodes, electrode, &check.restless);
    of(electrode) > FOLLOWS * median(neighbours.into_iter().map(of).collect())
}

/// What an input reads while others are grounded, in the middle (V).
pub(super) fn column(readings: &Readings, e: usize) -> f64 {
    median((0..readings.electrodes()).filter(|g| *g != e).map(|g| readings.touch_v(g, e)).collect())
}

/// The nearest of those that can be trusted.
pub(super) fn neighbours(all: &[Electrode], of: usize, but: &[usize]) -> Vec<usize> {
    let place = |electrode: &Electrode| [electrode.x_m, electrode.y_m, electrode.z_m];
    let mut others: Vec<usize> = (0..all.len()).filter(|other| *other != of && !but.contains(other)).collect();
    let away_m = |other: &usize| space::distance(place(&all[*other]), place(&all[of]));
    others.sort_by(|a, b| away_m(a).total_cmp(&away_m(b)));
    others.truncate(NEIGHBOURS);
    others
}

/// Which others a fault is shared with.
fn with(faulty: &FaultyElectrodes, state: State, electrode: usize) -> Vec<usize> {
    match state {
        State::Shorted => joined(faulty, electrode),
        State::Exchanged => {
            let exchanged = faulty.faults.iter().filter(|(_, fault)| *fault == ElectrodeFault::Exchanged);
            exchanged.map(|(other, _)| *other).filter(|other| *other != electrode).collect()
        }
        _ => Vec::new(),
    }
}

/// Electrodes of the same group of joined ones: each joint leads to the first of its group.
fn joined(faulty: &FaultyElectrodes, electrode: usize) -> Vec<usize> {
    let own = faulty.joints.iter().find(|joint| joint.electrodes.contains(&electrode));
    let Some(root) = own.map(|joint| joint.electrodes[0]) else { return Vec::new() };
    let group = faulty.joints.iter().filter(|joint| joint.electrodes[0] == root);
    let mut group: Vec<usize> = group.flat_map(|joint| joint.electrodes).filter(|other| *other != electrode).collect();
    group.sort_unstable();
    group.dedup();
    group
}
