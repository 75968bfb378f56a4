//! Any solver, without the electrodes that cannot be right.

use std::time::Duration;

use super::health::{self, ElectrodeFault};
use super::{ContactSettings, Contacts, Method, Problem, Solution, SolveError, Solver};
use tactomo_physics::forward::{ForwardError, Joint};
use tactomo_physics::readings::Readings;

/// Frames in a row that have to say the same of the electrodes before it is believed.
const CONFIRMED: usize = 8;
/// Frames in a row that do not fit after which a look is taken for exchanged wires: it takes as long as some hundred frames.
const MISFITS: [usize; 3] = [16, 160, 1600];
/// Mean square of what one contact leaves of the readings with two wires exchanged back, as a share of that before and in what noise
/// makes, that tells.
const HEALED: f64 = 0.1;
const FITS: f64 = 6.0;
/// Fewest electrodes that are worth solving for.
const FEWEST: usize = 5;

/// A solver that leaves out electrodes that are open, shorted, exchanged or otherwise wrong, once it has seen that.
pub struct Guard {
    method: Method,
    problem: Problem,
    solver: Box<dyn Solver>,
    /// Electrodes that the solver is made for.
    kept: Vec<usize>,
    excluded: Vec<(usize, ElectrodeFault)>,
    /// Electrodes whose wires touch.
    joints: Vec<Joint>,
    /// What the last frames say, and how many of them.
    suspected: (Vec<(usize, ElectrodeFault)>, usize),
    misfits: usize,
    period: Option<Duration>,
}

impl Guard {
    /// Guards the solver of a method.
    ///
    /// # Errors
    /// [`ForwardError`] if the solver cannot be made.
    pub fn new(method: Method, problem: &Problem) -> Result<Self, ForwardError> {
        Ok(Self {
            solver: method.build(problem)?,
            method,
            problem: problem.clone(),
            kept: (0..problem.detector().electrodes.len()).collect(),
            excluded: Vec::new(),
            joints: Vec::new(),
            suspected: (Vec::new(), 0),
            misfits: 0,
            period: None,
        })
    }

    /// Electrodes that are left out, and why.
    pub fn excluded(&self) -> &[(usize, ElectrodeFault)] {
        &self.excluded
    }

    /// Takes note of what a frame says, and leaves electrodes out when it is sure.
    fn watch(&mut self, readings: &Readings) {
        let detector = self.problem.detector();
        if readings.volts().iter().any(|volts| !volts.is_finite()) {
            return;
        }
        let faulty = health::faulty_electrodes(&readings.of(&self.kept), detector.drive_v, detector.adc.deviation_v());
        let faulty: Vec<_> = faulty.into_iter().map(|(place, fault)| (self.kept[place], fault)).collect();
        let electrodes = |all: &[(usize, ElectrodeFault)]| all.iter().map(|(e, _)| *e).collect::<Vec<_>>();
        if electrodes(&faulty) == electrodes(&self.suspected.0) {
            self.suspected.1 += 1;
        } else {
            self.suspected = (faulty, 1);
        }
        if self.suspected.1 >= CONFIRMED && !self.suspected.0.is_empty() {
            let (faulty, _) = std::mem::take(&mut self.suspected);
            let joints = joints(&faulty, readings, self.problem.detector().drive_v);
            self.exclude(faulty, &joints);
        }
    }

    /// Leaves electrodes out. Of those that are joined, the first stands for all of them.
    fn exclude(&mut self, faulty: Vec<(usize, ElectrodeFault)>, joints: &[Joint]) {
        let stays = |e: usize| {
            faulty.iter().all(|(wrong, _)| *wrong != e)
                || (joints.iter().any(|joint| joint.electrodes[0] == e)
                    && joints.iter().all(|joint| joint.electrodes[1] != e))
        };
        let kept: Vec<_> = self.kept.iter().copied().filter(|e| stays(*e)).collect();
        let joints: Vec<_> = self.joints.iter().chain(joints).copied().collect();
        if kept.len() < FEWEST {
            return;
        }
        match self.method.build(&self.problem.through(&kept, &joints)) {
            Ok(solver) => {
                tracing::warn!("electrodes left out: {faulty:?}");
                (self.solver, self.kept, self.joints) = (solver, kept, joints);
                self.solver.keep_within(self.period);
                self.excluded.extend(faulty);
                self.excluded.sort_unstable();
            }
            Err(error) => tracing::warn!("{faulty:?} look wrong, but there is no solver without them: {error}"),
        }
    }

    /// Looks for two exchanged wires when frames keep not fitting: nothing but a model tells these.
    fn look_for_exchange(&mut self, readings: &Readings, solution: &Solution) {
        self.misfits = if solution.flags.misfit { self.misfits + 1 } else { 0 };
        if !MISFITS.contains(&self.misfits) {
            return;
        }
        if let Some(pair) = self.exchanged(readings) {
            self.exclude(pair.map(|e| (e, ElectrodeFault::Exchanged)).into(), &[]);
        }
    }

    /// The exchange of two wires that makes the readings those of one contact.
    fn exchanged(&self, readings: &Readings) -> Option<[usize; 2]> {
        let settings = ContactSettings { most: 1, ..ContactSettings::of(&self.problem) };
        let contacts = Contacts::new(&self.problem.through(&self.kept, &self.joints), settings).ok()?;
        let residual = |order: &[usize]| contacts.left_by_one(&readings.of(order));
        let before = residual(&self.kept)?;
        let pairs = (0..self.kept.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
        let scored = pairs.filter_map(|(i, j)| {
            let mut order = self.kept.clone();
            order.swap(i, j);
            Some((residual(&order)?, [self.kept[j], self.kept[i]]))
        });
        let (after, pair) = scored.min_by(|a, b| a.0.total_cmp(&b.0))?;
        (after < FITS && after < HEALED * before).then_some(pair)
    }
}

/// Which shorted electrodes are joined to which: each to the first that reads the same as it.
fn joints(faulty: &[(usize, ElectrodeFault)], readings: &Readings, drive_v: f64) -> Vec<Joint> {
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

impl Solver for Guard {
    fn name(&self) -> &'static str {
        self.solver.name()
    }

    fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        super::check_count(readings, self.problem.detector().electrodes.len())?;
        self.watch(readings);
        let mut solution = match self.kept.len() == readings.electrodes() {
            true => self.solver.solve(readings)?,
            false => self.solver.solve(&readings.of(&self.kept))?,
        };
        self.look_for_exchange(readings, &solution);
        solution.flags.excluded = self.excluded.iter().map(|(e, _)| *e).collect();
        Ok(solution)
    }

    fn reset(&mut self) {
        self.solver.reset();
    }

    fn keep_within(&mut self, period: Option<Duration>) {
        self.period = period;
        self.solver.keep_within(period);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::detector::Detector;
    use tactomo_physics::forward::{ForwardModel, Resolution, Slab};
    use tactomo_physics::scene::Contact;
    use tactomo_physics::simulate::{Fault, Measurement};

    const CONTACT: Contact = Contact::flat(0.011, -0.006, 0.0025, 6e-4);

    /// What the guard leaves out after some frames of a contact on a faulty board, and the last answer.
    fn guarded(method: Method, faults: &[&str], frames: usize) -> (Vec<(usize, ElectrodeFault)>, Solution) {
        let mut detector = Detector::preset(Detector::DEFAULT).unwrap();
        detector.adc.noise_lsb = 1.5;
        let slab: Box<dyn ForwardModel> = Box::new(Slab::new(&detector).unwrap());
        let mut guard = Guard::new(method, &Problem::new(slab)).unwrap();
        let fine = Slab::with_resolution(&detector, Resolution::FINE).unwrap();
        let faults: Vec<Fault> = faults.iter().map(|fault| fault.parse().unwrap()).collect();
        let mut board = Measurement::new(&detector, &faults, 5).unwrap();
        let impedance_ohm = fine.impedance_ohm(&[CONTACT]).unwrap();
        let mut last = Solution::default();
        for _ in 0..frames {
            last = guard.solve(&board.readings_v(Some(&impedance_ohm))).unwrap();
        }
        (guard.excluded().to_vec(), last)
    }

    fn assert_found(solution: &Solution, within_m: f64) {
        let [found] = solution.contacts[..] else { panic!("{:?}", solution.contacts) };
        assert!((found.x_m - CONTACT.x_m).hypot(found.y_m - CONTACT.y_m) < within_m, "{found:?}");
    }

    #[test]
    fn a_sound_board_keeps_its_electrodes() {
        let (excluded, last) = guarded(Method::Contacts, &[], 20);
        assert_eq!((excluded, last.flags.excluded.clone()), (vec![], vec![]));
        assert_found(&last, 2e-4);
    }

    #[test]
    fn what_is_wrong_is_told_and_left_out() {
        type Case<'a> = (&'a [&'a str], &'a [(usize, ElectrodeFault)]);
        let cases: [Case<'_>; 5] = [
            (&["open:3"], &[(3, ElectrodeFault::Open)]),
            (&["open:3", "open:9"], &[(3, ElectrodeFault::Open), (9, ElectrodeFault::Open)]),
            (&["short:2,7"], &[(2, ElectrodeFault::Shorted), (7, ElectrodeFault::Shorted)]),
            (&["gain:4:0.8"], &[(4, ElectrodeFault::Contradicting)]),
            (&["invert:10"], &[(10, ElectrodeFault::Contradicting)]),
        ];
        for (faults, expected) in cases {
            let (excluded, last) = guarded(Method::Contacts, faults, 20);
            assert_eq!(excluded, expected, "{faults:?}");
            assert_eq!(last.flags.excluded, expected.iter().map(|(e, _)| *e).collect::<Vec<_>>());
            assert_found(&last, 2e-4);
        }
    }

    #[test]
    fn shorted_electrodes_are_joined_in_pairs_and_in_rows() {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        let slab = Slab::new(&detector).unwrap().on_image(200);
        let faults: Vec<Fault> = ["short:2,7", "short:9,3", "short:7,12"].map(|fault| fault.parse().unwrap()).into();
        let mut board = Measurement::new(&detector, &faults, 5).unwrap();
        let readings = board.pad_voltages(Some(&slab.impedance_ohm(&[CONTACT]).unwrap()));
        let faulty = [2, 3, 7, 9, 12].map(|e| (e, ElectrodeFault::Shorted));
        let found = joints(&faulty, &readings, 2.0);
        assert_eq!(found, [[2, 7], [3, 9], [2, 12]].map(|[a, b]| Joint::short(a, b)));
    }

    #[test]
    fn contacts_near_shorted_electrodes_stay_where_they_are() {
        let mut detector = Detector::preset(Detector::DEFAULT).unwrap();
        detector.adc.noise_lsb = 1.5;
        let slab: Box<dyn ForwardModel> = Box::new(Slab::new(&detector).unwrap());
        let mut guard = Guard::new(Method::Contacts, &Problem::new(slab)).unwrap();
        let fine = Slab::with_resolution(&detector, Resolution::FINE).unwrap();
        let mut board = Measurement::new(&detector, &["short:2,7".parse().unwrap()], 5).unwrap();
        // Beside the two pads, one after another, once the guard knows.
        let pads = [detector.electrodes[2], detector.electrodes[7]];
        for (turn, pad) in pads.iter().cycle().take(12).enumerate() {
            let way = std::f64::consts::TAU * turn as f64 / 12.0;
            let truth = Contact::flat(pad.x_m + 0.003 * way.cos(), pad.y_m + 0.003 * way.sin(), 0.0025, 6e-4);
            let impedance_ohm = fine.impedance_ohm(&[truth]).unwrap();
            let frames = if turn == 0 { 20 } else { 2 };
            let last =
                (0..frames).map(|_| guard.solve(&board.readings_v(Some(&impedance_ohm))).unwrap()).last().unwrap();
            let [found] = last.contacts[..] else { panic!("{truth:?} {:?}", last.contacts) };
            let off_m = (found.x_m - truth.x_m).hypot(found.y_m - truth.y_m);
            assert!(off_m < 5e-4, "{truth:?} {found:?}: {off_m}");
        }
        assert_eq!(guard.kept.len(), 15);
    }

    #[test]
    fn exchanged_wires_are_found_by_what_the_model_says() {
        let (excluded, last) = guarded(Method::Contacts, &["swap:5,6"], 20);
        assert_eq!(excluded, [(5, ElectrodeFault::Exchanged), (6, ElectrodeFault::Exchanged)]);
        assert_found(&last, 2e-4);
    }
}
