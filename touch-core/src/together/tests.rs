//! Frames explained together, on a made-up sheet that is not as its table says.

use std::vec::Vec;

use super::{Motion, Together};
use crate::answer::Contact;
use crate::frame::{Errors, Frame};
use crate::held::Room;
use crate::loaded::Spot;
use crate::normal::ANY_RADIUS;
use crate::samples::table;
use crate::solver::Solver;
use crate::table::Table;
use crate::unknown_tests::{DIRECTIONS, MadeUp, read_v};
use crate::vector::PARAMETERS;

/// How far the sheet is from its table, in deviations.
const STEPS: [f64; DIRECTIONS] = [0.8, -1.1, 0.5, 1.2, -0.6, 0.9, -0.4, 0.3];

fn spot(x_m: f64, y_m: f64, sheets: f64) -> Spot<f64> {
    Spot { at_m: [x_m, y_m], ln_ohm: (1.0 / (sheets * 1.1e-3) + 600.0).ln(), ln_radius: 0.0 }
}

/// A sheet, and frames of it.
struct Sheet {
    bytes: Vec<u8>,
    frames: Vec<Vec<f64>>,
}

impl Sheet {
    /// Of contacts in each frame, with so much noise (V).
    fn new(contacts: &[Vec<Spot<f64>>], noise_v: f64) -> Self {
        let bytes = table();
        let mut state = 7u32;
        let mut noise = || {
            // Three numbers that are even over one: their sum's variance is a quarter.
            let sum: f64 = (0..3)
                .map(|_| {
                    state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    f64::from(state >> 8) / f64::from(1u32 << 24) - 0.5
                })
                .sum();
            2.0 * noise_v * sum
        };
        let made_up = MadeUp::new(&Table::read(&bytes).unwrap());
        let mut frame = |spots: &Vec<Spot<f64>>| -> Vec<f64> {
            let volts = read_v(&Table::read(&bytes).unwrap(), &made_up, STEPS, spots);
            volts.iter().map(|volts| volts + noise()).collect()
        };
        let frames = contacts.iter().map(&mut frame).collect();
        Self { bytes, frames }
    }

    /// Works with a solver on the frames.
    fn with<R>(&self, noise_v: f64, work: impl FnOnce(&mut Works<'_, '_>) -> R) -> R {
        let table = Table::read(&self.bytes).unwrap();
        let made_up = MadeUp::new(&table);
        let unknown = made_up.unknown();
        let mut numbers = std::vec![0.0; Room::<f64>::numbers(&table, &unknown, 3)];
        let mut floats = std::vec![0.0; Room::<f64>::floats(&table, &unknown, 3)];
        let frames: Vec<_> = self.frames.iter().map(|volts| Frame::of_volts(volts).with_noise(noise_v)).collect();
        let room = Room { numbers: &mut numbers, floats: &mut floats };
        work(&mut Works { table: &table, made_up: &made_up, room, frames, solver: Solver::default() })
    }
}

struct Works<'a, 'm> {
    table: &'a Table<'a>,
    made_up: &'a MadeUp,
    room: Room<'m, f64>,
    frames: Vec<Frame<'a, f64>>,
    solver: Solver<f64, 3, DIRECTIONS>,
}

type Found = Together<f64, 3, DIRECTIONS>;

impl Works<'_, '_> {
    fn together(&mut self, contacts: &[Vec<Contact<f64>>], motion: Motion<f64, 3>) -> Found {
        let contacts: Vec<_> = contacts.iter().map(Vec::as_slice).collect();
        let unknown = self.made_up.unknown();
        self.solver.together(self.table, &unknown, &mut self.room, &self.frames, &contacts, motion).unwrap()
    }

    fn one_more(&mut self, from: &Found) -> Option<Found> {
        let unknown = self.made_up.unknown();
        self.solver.one_more_together(self.table, &unknown, &mut self.room, &self.frames, from)
    }
}

fn contact(x_m: f64, y_m: f64) -> Contact<f64> {
    Contact { x_m, y_m, radius_m: 0.0025, conductance_s: 4e-4, ..Contact::default() }
}

/// Strengths of two contacts in each frame (sheets).
const WEIGHTS: [[f64; 2]; 4] = [[0.5, 0.2], [0.2, 0.5], [0.6, 0.6], [0.3, 0.15]];

fn pressed(places_m: &[[f64; 2]; 2]) -> Vec<Vec<Spot<f64>>> {
    let of = |sheets: &[f64; 2]| places_m.iter().zip(sheets).map(|(at, sheets)| spot(at[0], at[1], *sheets)).collect();
    WEIGHTS.iter().map(of).collect()
}

/// The inverse of a symmetric matrix, by Gauss and Jordan.
fn inverse(mut matrix: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let count = matrix.len();
    for (i, row) in matrix.iter_mut().enumerate() {
        row.extend((0..count).map(|j| f64::from(u8::from(i == j))));
    }
    for pivot in 0..count {
        let own = matrix[pivot][pivot];
        matrix[pivot].iter_mut().for_each(|value| *value /= own);
        let row = matrix[pivot].clone();
        for (_, other) in matrix.iter_mut().enumerate().filter(|(i, _)| *i != pivot) {
            let factor = other[pivot];
            other.iter_mut().zip(&row).for_each(|(value, of_pivot)| *value -= factor * of_pivot);
        }
    }
    matrix.into_iter().map(|row| row[count..].to_vec()).collect()
}

/// Against all parameters of all frames at once, with derivatives by differences: what is eliminated frame by frame, and the detector, are so in effect.
#[test]
fn the_covariance_is_that_of_all_frames_parameters() {
    let noise_v = 2e-4;
    let truth = pressed(&[[-0.012, 0.004], [0.009, -0.007]]);
    Sheet::new(&truth, noise_v).with(noise_v, |works| {
        let start = std::vec![std::vec![contact(-0.0115, 0.0045), contact(0.0093, -0.0065)]; 4];
        let found = works.together(&start, Motion::Still);
        assert!(found.fits() && found.count() == 2);
        let radius_m = f64::from(works.table.head().radius_m);
        let variance_v2 = Errors::of(&works.frames[0], works.table).variance_v2;
        let (common, frames) = (PARAMETERS * 2, found.frames);
        let count = DIRECTIONS + common + 2 * frames;
        let volts = |parameter: usize, step: f64| -> Vec<f64> {
            let mut steps = *found.steps();
            if let Some(own) = steps.get_mut(parameter) {
                *own += step;
            }
            let of_frame = |frame: usize| {
                let mut spots = found.scene(frame).spots[..2].to_vec();
                for (k, spot) in spots.iter_mut().enumerate() {
                    match parameter.checked_sub(DIRECTIONS + PARAMETERS * k) {
                        Some(d @ 0..2) => spot.at_m[d] += radius_m * step,
                        Some(2) => spot.ln_ohm += step,
                        Some(3) => spot.ln_radius += step,
                        _ => (),
                    }
                    if parameter == DIRECTIONS + common + 2 * frame + k {
                        spot.ln_ohm += step;
                    }
                }
                read_v(works.table, works.made_up, steps, &spots)
            };
            (0..frames).flat_map(of_frame).collect()
        };
        let slopes: Vec<Vec<f64>> = (0..count)
            .map(|parameter| {
                let [more, less] = [1e-3, -1e-3].map(|step| volts(parameter, step));
                more.iter().zip(less).map(|(more, less)| (more - less) / (2e-3 * variance_v2.sqrt())).collect()
            })
            .collect();
        let radius = DIRECTIONS + 3..DIRECTIONS + common;
        let known = |i: usize| match i {
            _ if i < DIRECTIONS || i >= DIRECTIONS + common => 1.0,
            _ if radius.clone().step_by(PARAMETERS).any(|of| of == i) => f64::from(ANY_RADIUS).powi(-2),
            _ => 0.0,
        };
        let element = |i: usize, j: usize| {
            let product: f64 = slopes[i].iter().zip(&slopes[j]).map(|(a, b)| a * b).sum();
            product + if i == j { known(i) } else { 0.0 }
        };
        let all = inverse((0..count).map(|i| (0..count).map(|j| element(i, j)).collect()).collect());
        for i in 0..common {
            for j in 0..=i {
                let expected = all[DIRECTIONS + i][DIRECTIONS + j];
                let scale = (all[DIRECTIONS + i][DIRECTIONS + i] * all[DIRECTIONS + j][DIRECTIONS + j]).sqrt();
                let off = (found.covariance(i, j) - expected) / scale;
                // Of a radius derivatives leave out what slopes of the field between contacts change.
                let is_of_radius = [i, j].iter().any(|of| of % PARAMETERS == 3);
                let most = if is_of_radius { 0.25 } else { 0.1 };
                assert!(off.abs() < most, "{i} {j}: {} for {expected}", found.covariance(i, j));
            }
        }
    });
}

/// As weight goes from one to the other, two that stay are likelier than one that moves and grows; the fit with each less is where it began.
#[test]
fn two_side_by_side_are_told_by_how_their_strengths_change() {
    let noise_v = 2e-4;
    let places_m = [[-0.003, 0.004], [0.003, 0.006]];
    Sheet::new(&pressed(&places_m), noise_v).with(noise_v, |works| {
        let one = std::vec![std::vec![contact(0.0, 0.005)]; 4];
        let still = works.together(&one, Motion::Still);
        let growing = works.together(&one, Motion::Growing([0.002; 3]));
        assert!(!still.fits() && growing.ln_evidence() > still.ln_evidence());
        assert!(growing.cost() < still.cost());
        let two = works.one_more(&still).unwrap();
        assert!(two.fits() && two.count() == 2, "{two:?}");
        assert!(two.ln_evidence() > growing.ln_evidence() + 6.0, "{} {}", two.ln_evidence(), growing.ln_evidence());
        for (frame, sheets) in WEIGHTS.iter().enumerate() {
            let found = two.contacts(frame);
            let [first, second] = places_m.map(|[x_m, y_m]| {
                let off_m = |one: &&Contact<f64>| (one.x_m - x_m).hypot(one.y_m - y_m);
                let near = found.iter().min_by(|a, b| off_m(a).total_cmp(&off_m(b))).unwrap();
                assert!(off_m(&near) < 5e-4, "{found:?}");
                near.conductance_s
            });
            assert!(((first / second).ln() - (sheets[0] / sheets[1]).ln()).abs() < 0.3, "{frame}: {found:?}");
        }
        // The detector that it makes likely is nearer to the one there is than the description.
        let square = |steps: [f64; DIRECTIONS]| steps.iter().map(|step| step * step).sum::<f64>();
        let off = core::array::from_fn(|i| two.steps()[i] - STEPS[i]);
        assert!(square(off) < square(STEPS), "{:?}", two.steps());
        // A third is not there.
        let third = works.one_more(&two);
        assert!(third.is_none_or(|third| third.ln_evidence() < two.ln_evidence()));
    });
}

/// One that is pressed more and less is no two; and what cannot be is refused.
#[test]
fn one_that_stays_is_one() {
    let noise_v = 2e-4;
    let truth: Vec<_> = [0.1, 0.4, 0.8, 0.2].map(|sheets| std::vec![spot(0.004, -0.008, sheets)]).into();
    Sheet::new(&truth, noise_v).with(noise_v, |works| {
        let one = std::vec![std::vec![contact(0.0045, -0.0075)]; 4];
        let still = works.together(&one, Motion::Still);
        assert!(still.fits() && still.count() == 1);
        let off_m = (still.contacts(0)[0].x_m - 0.004).hypot(still.contacts(0)[0].y_m + 0.008);
        assert!(off_m < 5e-4, "{off_m}");
        let moving = works.together(&one, Motion::Moving([1e-3; 3]));
        assert!(moving.ln_evidence() < still.ln_evidence());
        assert!(works.one_more(&still).is_none_or(|two| two.ln_evidence() < still.ln_evidence()));
        let (table, unknown) = (works.table, works.made_up.unknown());
        let refused = |works: &mut Works<'_, '_>, frames: usize, contacts: &[&[Contact<f64>]]| {
            let frames = std::vec![works.frames[0]; frames];
            works.solver.together(table, &unknown, &mut works.room, &frames, contacts, Motion::Still).is_none()
        };
        let of_one = one[0].as_slice();
        assert!(refused(works, 0, &[]) && refused(works, 2, &[of_one]) && refused(works, 2, &[of_one, &[]]));
        assert!(refused(works, 9, &[of_one; 9]) && refused(works, 1, &[&[of_one[0]; 4]]));
    });
}
