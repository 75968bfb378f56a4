//! Which electrodes cannot be right, from frame to frame.
//!
//! One frame's verdict ([`electrodes`]) is believed after some frames in a row, so that no single frame costs an electrode. That wires touch is
//! believed only while no contacts explain the frames: two pads across a narrow strip read the same while something presses at its far end, and
//! where one of them is grounded a converter's floor hides that the other is not. An electrode that was left out comes back after many frames
//! that would have shown its fault and do not: with readings as large as when it was found.

use crate::solve::answer::{ElectrodeFault, Solution};
use crate::solve::health::electrodes;
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::Joint;
use tactomo_physics::readings::Readings;

/// Frames in a row that have to say the same of the electrodes before it is believed.
const CONFIRMED: u32 = 8;
/// Frames in a row that have to show nothing of a fault before its electrode comes back: 50 ms at 1200 frames/s; doubled each time that it
/// is left out again, up to the second.
const HEALTHY: [u32; 2] = [64, 64 << 10];
/// With electrodes left out, every so many frames are judged: a verdict on a faulty frame takes 0.1 ms.
const STRIDE: u32 = 8;
/// Share of the largest reading at which a fault was found from which readings would show it again.
const AS_LARGE: f64 = 0.7;
/// Answers in a row that are not one contact that fits, after which a look is taken for exchanged wires: it takes as long as some frames.
const DOUBTS: [u32; 6] = [16, 48, 160, 480, 1600, 4800];
/// Answers with contacts after which exchanged wires are looked at again.
const LOOK_AGAIN: u32 = 1200;
/// Fewest electrodes that are worth solving for.
const FEWEST: usize = 5;

/// Electrodes that are left out, and what of that the fields have to know.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FaultyElectrodes {
    /// Each, with what is wrong.
    pub faults: Vec<(usize, ElectrodeFault)>,
    /// Those whose wires touch: the first of them stands for all.
    pub joints: Vec<Joint>,
}

impl FaultyElectrodes {
    /// Electrodes of so many that solvers are made for: those that are not faulty, and of joined ones the first.
    pub fn kept(&self, electrodes: usize) -> Vec<usize> {
        let is_first = |electrode: usize| {
            self.joints.iter().any(|joint| joint.electrodes[0] == electrode)
                && self.joints.iter().all(|joint| joint.electrodes[1] != electrode)
        };
        let is_faulty = |electrode: usize| self.faults.iter().any(|(wrong, _)| *wrong == electrode);
        (0..electrodes).filter(|electrode| !is_faulty(*electrode) || is_first(*electrode)).collect()
    }

    /// The faulty electrodes without some of them.
    pub fn but(&self, healthy: &[usize]) -> Self {
        let faults = self.faults.iter().copied().filter(|(wrong, _)| !healthy.contains(wrong)).collect();
        let is_left = |joint: &Joint| joint.electrodes.iter().all(|electrode| !healthy.contains(electrode));
        Self { faults, joints: self.joints.iter().copied().filter(is_left).collect() }
    }
}

/// Watches readings for faulty electrodes.
#[derive(Clone, Debug)]
pub struct ElectrodeWatch {
    detector: Detector,
    faulty: FaultyElectrodes,
    /// Largest reading at which each electrode was found faulty (V), how many frames have shown it healthy since, and how many have to.
    cases: Vec<Case>,
    /// Largest reading between healthy electrodes in the newest frame that was judged (V).
    largest_v: f64,
    skipped: u32,
    /// Answers in a row that are not one contact that fits, and looks that were taken since they began.
    doubts: u32,
    looks: usize,
    /// Answers with contacts since a look at what was exchanged, and whether the newest is one.
    touched: u32,
    is_touched: bool,
    /// Whether the newest answer is contacts that leave no more than noise.
    is_explained: bool,
}

/// An electrode's history.
#[derive(Clone, Copy, Debug)]
struct Case {
    /// Frames in a row that have shown it faulty.
    seen: u32,
    /// Largest reading between healthy electrodes when it was left out (V).
    found_at_v: f64,
    healthy: u32,
    needed: u32,
}

impl Default for Case {
    fn default() -> Self {
        Self { seen: 0, found_at_v: 0.0, healthy: 0, needed: HEALTHY[0] }
    }
}

/// A look with the forward model for what readings alone do not show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Look {
    /// Whether two wires are exchanged.
    Exchanged,
    /// Whether two that were are no longer.
    Healed([usize; 2]),
}

impl ElectrodeWatch {
    /// Watches a detector, as measured.
    pub fn new(detector: &Detector) -> Self {
        Self {
            faulty: FaultyElectrodes::default(),
            cases: vec![Case::default(); detector.electrodes.len()],
            detector: detector.clone(),
            largest_v: 0.0,
            skipped: 0,
            doubts: 0,
            looks: 0,
            touched: 0,
            is_touched: false,
            is_explained: false,
        }
    }

    /// Electrodes that are left out, and why.
    pub fn faulty(&self) -> &FaultyElectrodes {
        &self.faulty
    }

    /// Takes note of a frame's readings (V), less the baseline; whether other electrodes are left out now.
    pub fn note(&mut self, readings: &Readings) -> bool {
        self.skipped += 1;
        if !self.faulty.faults.is_empty() && self.skipped < STRIDE && self.cases.iter().all(|case| case.seen == 0) {
            return false;
        }
        let frames = std::mem::take(&mut self.skipped);
        if readings.electrodes() != self.cases.len() || readings.volts().iter().any(|volts| !volts.is_finite()) {
            return false;
        }
        let Some(faulty) = electrodes::faulty_electrodes(readings, &self.detector) else { return false };
        self.largest_v = self.healthy_largest_v(readings, &faulty);
        let is_back = self.take_back(&faulty, frames);
        let is_out = self.suspect(&faulty, readings);
        is_back || is_out
    }

    /// Largest reading between electrodes that are neither faulty in this frame nor left out: one of those reads anything.
    fn healthy_largest_v(&self, readings: &Readings, faulty: &[(usize, ElectrodeFault)]) -> f64 {
        let all = faulty.iter().chain(&self.faulty.faults);
        let wrong: Vec<usize> = all.map(|(electrode, _)| *electrode).collect();
        let healthy: Vec<usize> = (0..self.cases.len()).filter(|electrode| !wrong.contains(electrode)).collect();
        readings.of(&healthy).largest_v()
    }

    /// Counts frames that would have shown a fault and do not, and takes electrodes back.
    fn take_back(&mut self, faulty: &[(usize, ElectrodeFault)], frames: u32) -> bool {
        let mut back = Vec::new();
        for (electrode, fault) in &self.faulty.faults {
            let case = &mut self.cases[*electrode];
            // A broken wire shows at any touch.
            let least_v = match fault {
                ElectrodeFault::Open => electrodes::TOUCHED * self.detector.adc.deviation_v(),
                _ => AS_LARGE * case.found_at_v,
            };
            if faulty.iter().any(|(wrong, _)| wrong == electrode) {
                case.healthy = 0;
            } else if *fault != ElectrodeFault::Exchanged && self.largest_v > least_v {
                case.healthy += frames;
            }
            if case.healthy >= case.needed {
                tracing::info!("electrode {electrode} is healthy again; before, {fault}");
                *case = Case { needed: (2 * case.needed).min(HEALTHY[1]), ..Case::default() };
                back.push(*electrode);
            }
        }
        self.faulty = self.faulty.but(&back);
        !back.is_empty()
    }

    /// Leaves out what enough frames in a row have shown.
    fn suspect(&mut self, faulty: &[(usize, ElectrodeFault)], readings: &Readings) -> bool {
        let mut found = Vec::new();
        for (electrode, case) in self.cases.iter_mut().enumerate() {
            let fault = faulty.iter().find(|(wrong, _)| *wrong == electrode);
            let is_known = self.faulty.faults.iter().any(|(known, _)| *known == electrode);
            // Other faults show by what no sound wires read, though several contacts may seem to explain it.
            let is_needless = self.is_explained && fault.is_some_and(|(_, fault)| *fault == ElectrodeFault::Shorted);
            case.seen = if fault.is_some() && !is_known && !is_needless { case.seen + 1 } else { 0 };
            found.extend(fault.filter(|_| case.seen >= CONFIRMED));
        }
        if found.is_empty() || !self.exclude(&found) {
            return false;
        }
        let left_out =
            |(electrode, _): &&(usize, ElectrodeFault)| self.faulty.faults.iter().any(|(e, _)| e == electrode);
        let shorted: Vec<_> = faulty.iter().filter(left_out).copied().collect();
        self.faulty.joints = joints(&shorted, readings, self.detector.drive_v);
        true
    }

    fn exclude(&mut self, found: &[(usize, ElectrodeFault)]) -> bool {
        let is_known = |electrode: usize| self.faulty.faults.iter().any(|(known, _)| *known == electrode);
        let found: Vec<_> = found.iter().copied().filter(|(electrode, _)| !is_known(*electrode)).collect();
        if found.is_empty() || self.cases.len() < FEWEST + self.faulty.faults.len() + found.len() {
            return false;
        }
        match found[..] {
            [(a, ElectrodeFault::Exchanged), (b, ElectrodeFault::Exchanged)] => {
                tracing::warn!("electrodes {a} and {b} are left out: their wires are exchanged");
            }
            _ => found.iter().for_each(|(electrode, fault)| {
                tracing::warn!("electrode {electrode} is left out: {fault}");
            }),
        }
        for (electrode, _) in &found {
            (self.cases[*electrode].found_at_v, self.cases[*electrode].seen) = (self.largest_v, 0);
        }
        self.faulty.faults.extend(found);
        self.faulty.faults.sort_unstable();
        true
    }

    /// Takes note of an answer. Exchanged wires make several contacts of one, which may well fit, or none that fits.
    pub fn answered(&mut self, solution: &Solution) {
        let is_fit = solution.is_contacts() && !solution.flags.misfit;
        self.is_explained = is_fit && !solution.flags.unfinished;
        if !is_fit || solution.contacts.len() > 1 {
            self.doubts += 1;
        } else if !solution.flags.unfinished {
            (self.doubts, self.looks) = (0, 0);
        }
        self.is_touched = !solution.contacts.is_empty();
        self.touched += u32::from(self.is_touched);
    }

    /// What to look for in the newest frame by now, if anything; whoever asks looks.
    pub fn look(&mut self) -> Option<Look> {
        if DOUBTS.get(self.looks).is_some_and(|due| self.doubts >= *due) {
            self.looks += 1;
            return Some(Look::Exchanged);
        }
        let is_exchanged =
            |(electrode, fault): &(usize, ElectrodeFault)| (*fault == ElectrodeFault::Exchanged).then_some(*electrode);
        let mut exchanged = self.faulty.faults.iter().filter_map(is_exchanged);
        let (a, b) = exchanged.next().zip(exchanged.next())?;
        // A light touch, or none, does not tell exchanged wires.
        let is_telling = self.is_touched && self.largest_v > AS_LARGE * self.cases[a].found_at_v;
        if self.touched < LOOK_AGAIN || !is_telling {
            return None;
        }
        self.touched = 0;
        Some(Look::Healed([a, b]))
    }

    /// Takes what a look has found; whether other electrodes are left out now.
    pub fn conclude(&mut self, look: Look, found: Option<[usize; 2]>) -> bool {
        match (look, found) {
            (_, None) => false,
            (Look::Exchanged, Some(pair)) => {
                (self.doubts, self.looks) = (0, 0);
                self.exclude(&pair.map(|e| (e, ElectrodeFault::Exchanged)))
            }
            (Look::Healed(_), Some(pair)) => {
                self.faulty = self.faulty.but(&pair);
                true
            }
        }
    }
}

/// Which shorted electrodes are joined to which: each to the first that reads the same as it.
pub(crate) fn joints(faulty: &[(usize, ElectrodeFault)], readings: &Readings, drive_v: f64) -> Vec<Joint> {
    let shorted: Vec<_> =
        faulty.iter().filter(|(_, fault)| *fault == ElectrodeFault::Shorted).map(|(e, _)| *e).collect();
    let apart_v = |a: usize, b: usize| {
        (0..readings.electrodes()).map(|g| (readings.at(g, a) - readings.at(g, b)).abs()).fold(0.0, f64::max)
    };
    let mut all: Vec<Joint> = Vec::new();
    for (place, e) in shorted.iter().enumerate() {
        let first = shorted[..place].iter().copied().min_by(|a, b| apart_v(*a, *e).total_cmp(&apart_v(*b, *e)));
        let best_v = shorted.iter().filter(|f| *f != e).map(|f| apart_v(*f, *e)).fold(drive_v, f64::min);
        if let Some(first) = first.filter(|first| apart_v(*first, *e) <= 2.0 * best_v) {
            let root = all.iter().find(|joint| joint.electrodes[1] == first).map_or(first, |joint| joint.electrodes[0]);
            all.push(Joint::short(root, *e));
        }
    }
    all
}
