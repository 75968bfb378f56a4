//! Updates: the newest frame, in bytes. The page's side is `web/protocol.js`.
//!
//! Little-endian throughout. What is not known is not a number.
//!
//! | bytes | what |
//! |---|---|
//! | 11 x u32 | [`LAYOUT`]; sequence number of the frame; frames received so far (both modulo 2^32); nodes `m`; electrodes `n`; contacts found `k`; shape: 0 none, 1 a line, 2 a ring; flags: 1 saturated, 2 the readings do not fit, 4 unfinished, 8 the detector differs from its description; electrodes left out: bit `e` is electrode `e`; those of them whose wires are exchanged; points of the [course](crate::run::course) `s` |
//! | f32 | residual of the readings: root mean square, in standard deviations of the noise |
//! | f32 | age of the answer when this was sent: since the last byte of its frame came (s) |
//! | 4 x f32 | the pointer: sum of its motion along x and y (m), 1 while it is pressed, clicks so far; not numbers if no contact is one |
//! | m x f32 | the image: contact conductance per area at each node (S/m2); `m` is 0 if the solver makes no image |
//! | n n x f32 | the readings as measured (V), electrode `e` under ground `g` at `g n + e` |
//! | s x f32 | points of the course of the readings (V) since the update before, 4 ms each |
//! | k x (u32, 16 x f32) | the contacts found: number from frame to frame, 0 if it has none; their [columns](CONTACT_COLUMNS) after the id; x, y on the map (m), which are those in space on a flat detector |
//! | 18 x f32 | with a shape: its [columns](tactomo_touch::schema::SHAPE_COLUMNS); then the contacts are beside it |
//! | the rest | UTF-8: what was chosen, a line feed, why; nothing if the solver does not choose |

use crate::run::FrameSnapshot;
use tactomo_physics::detector::Detector;
use tactomo_touch::pointer::PointerState;
use tactomo_touch::schema::{CONTACT_COLUMNS, contact_values, shape_values};
use tactomo_touch::solve::{ElectrodeFault, Flags, FoundContact, FoundShape};

/// Version of the layout; a page of another version says that it must be reloaded.
pub(super) const LAYOUT: u32 = 9;

/// Numbers of a contact: the columns after its id, and its place on the map.
const CONTACT_FLOATS: usize = CONTACT_COLUMNS.len() - 1 + 2;

/// An update; `frames` received so far, and the points of the course (V) since the last one.
pub(super) fn update(frame: &FrameSnapshot, frames: u64, course_v: &[f32], detector: &Detector) -> Vec<u8> {
    let solution = &frame.solution;
    let age_s = frame.arrived.elapsed().as_secs_f32();
    let image = solution.image_s_per_m2.as_deref().unwrap_or_default();
    let counts = [image.len(), frame.readings.electrodes(), solution.contacts.len()].map(|count| count as u32);
    // The page counts modulo 2^32.
    let head = [LAYOUT, frame.sequence as u32, frames as u32].into_iter().chain(counts);
    let head = head.chain([kind(solution.shape.as_ref())]).chain(flags(&solution.flags));
    let head = head.chain([course_v.len() as u32]);
    let readings = frame.readings.volts().iter().map(|&volt| volt as f32);
    let first = [known(solution.residual), age_s].into_iter().chain(pointer(frame.pointer));
    let values = first.chain(image.iter().copied()).chain(readings).chain(course_v.iter().copied());
    let mut bytes: Vec<u8> = head.flat_map(u32::to_le_bytes).chain(values.flat_map(f32::to_le_bytes)).collect();
    for found in &solution.contacts {
        bytes.extend(found.id.unwrap_or(0).to_le_bytes());
        bytes.extend(contact(found, detector).into_iter().flat_map(f32::to_le_bytes));
    }
    if let Some(shape) = &solution.shape {
        bytes.extend(shape_values(shape).into_iter().flat_map(f32::to_le_bytes));
    }
    if let Some(choice) = &solution.choice {
        bytes.extend([choice.what.as_bytes(), b"\n", choice.why.as_bytes()].concat());
    }
    bytes
}

fn pointer(state: Option<PointerState>) -> [f32; 4] {
    let of = |PointerState { way_m: [x_m, y_m], is_pressed, clicks }| {
        [x_m as f32, y_m as f32, f32::from(u8::from(is_pressed)), clicks as f32]
    };
    state.map_or([f32::NAN; 4], of)
}

fn kind(shape: Option<&FoundShape>) -> u32 {
    match shape {
        None => 0,
        Some(FoundShape::Line(_)) => 1,
        Some(FoundShape::Ring(_)) => 2,
    }
}

fn flags(flags: &Flags) -> [u32; 3] {
    let bits = [flags.saturated, flags.misfit, flags.unfinished, flags.calibrate];
    let told = bits.iter().enumerate().map(|(bit, set)| u32::from(*set) << bit).sum();
    let bit = |e: &usize| 1_u32.checked_shl(*e as u32).unwrap_or_default();
    let excluded = flags.excluded.iter().map(bit).fold(0, |all, bit| all | bit);
    let exchanged = flags.excluded.iter().zip(&flags.faults).filter(|(_, fault)| **fault == ElectrodeFault::Exchanged);
    [told, excluded, exchanged.map(|(e, _)| bit(e)).fold(0, |all, bit| all | bit)]
}

fn contact(found: &FoundContact, detector: &Detector) -> [f32; CONTACT_FLOATS] {
    let mut values = [f32::NAN; CONTACT_FLOATS];
    let (known, map) = values.split_at_mut(CONTACT_FLOATS - 2);
    // Errors in space are not those on the flat map of a curved detector.
    let uncertainty = found.uncertainty.filter(|_| detector.surface.is_none());
    known.copy_from_slice(&contact_values(&FoundContact { uncertainty, ..*found }));
    map.copy_from_slice(&detector.map_m([found.x_m, found.y_m, found.z_m]).map(|metres| metres as f32));
    values
}

fn known(value: Option<f64>) -> f32 {
    value.map_or(f32::NAN, |value| value as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::readings::Readings;
    use tactomo_touch::solve::{Choice, FoundRing, Solution, Uncertainty};

    fn bytes_of(solution: Solution) -> Vec<u8> {
        let frame = FrameSnapshot {
            sequence: (7 << 32) + 9,
            board_time_us: 0,
            arrived: std::time::Instant::now(),
            status: Default::default(),
            readings: Readings::from_fn(2, |g, e| (2 * g + e) as f64),
            solution,
            pointer: Some(PointerState { way_m: [0.5, -0.25], is_pressed: true, clicks: 3 }),
            rezeroing: false,
        };
        update(&frame, 300, &[0.25, 0.75], &Detector::preset(Detector::DEFAULT).unwrap())
    }

    fn words(bytes: &[u8]) -> Vec<u32> {
        bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
    }

    fn floats(bytes: &[u8]) -> Vec<f32> {
        words(bytes).into_iter().map(f32::from_bits).collect()
    }

    #[test]
    fn an_update_is_laid_out_as_documented() {
        let errors = Uncertainty { x_m: 0.5, y_m: 0.25, correlation: -0.5, conductance_s: 4.0 };
        let known = FoundContact {
            id: Some(6),
            apparent_conductance_s: Some(1.75),
            radius_m: Some(1.5),
            force_n: Some(3.0),
            force_deviation_n: Some(0.75),
            force_beyond_maximum: Some(true),
            uncertainty: Some(errors),
            depth_m: Some(0.125),
            ..FoundContact::flat(0.25, -0.5, 2.0)
        };
        let bytes = bytes_of(Solution {
            image_s_per_m2: Some(vec![2.0, 4.0, -8.0]),
            contacts: vec![known, FoundContact::flat(1.0, 2.0, 3.0)],
            residual: Some(1.25),
            flags: Flags {
                saturated: true,
                unfinished: true,
                excluded: vec![3, 31],
                faults: vec![ElectrodeFault::Open, ElectrodeFault::Exchanged],
                ..Flags::default()
            },
            calibrated: None,
            shape: None,
            certainty: Some(0.75),
            choice: Some(Choice { what: "2 contacts".to_owned(), why: "µ".to_owned() }),
        });
        assert_eq!(words(&bytes[..44]), [LAYOUT, 9, 300, 3, 2, 2, 0, 0b101, 1 << 31 | 1 << 3, 1 << 31, 2]);
        let head = floats(&bytes[44..104]);
        assert_eq!(head[0], 1.25);
        assert!((0.0..5.0).contains(&head[1]), "{} s old", head[1]);
        assert_eq!(head[2..6], [0.5, -0.25, 1.0, 3.0], "the pointer");
        assert_eq!(head[6..], [2.0, 4.0, -8.0, 0.0, 1.0, 2.0, 3.0, 0.25, 0.75]);
        assert_eq!(words(&bytes[104..108]), [6]);
        let known = [0.25, -0.5, 0.0, 2.0, 1.75, 1.5, 3.0, 0.75, 1.0, 0.5, 0.25, -0.5, 4.0, 0.125, 0.25, -0.5];
        assert_eq!(floats(&bytes[108..172]), known);
        assert_eq!(words(&bytes[172..176]), [0]);
        assert_eq!(floats(&bytes[176..192]), [1.0, 2.0, 0.0, 3.0]);
        assert!(floats(&bytes[192..232]).iter().all(|value| value.is_nan()), "what is not known");
        assert_eq!(floats(&bytes[232..240]), [1.0, 2.0]);
        assert_eq!(&bytes[240..], "2 contacts\nµ".as_bytes());
    }

    #[test]
    fn a_shape_follows_the_contacts_beside_it() {
        let ring =
            FoundRing { centre_m: [0.25, -0.5], radius_m: 2.0, width_m: 0.5, conductance_s: 3.0, uncertainty: None };
        let bytes = bytes_of(Solution {
            contacts: vec![FoundContact::flat(1.0, 2.0, 3.0)],
            shape: Some(FoundShape::Ring(ring)),
            ..Solution::default()
        });
        assert_eq!(words(&bytes[20..28]), [1, 2]);
        let shape = floats(&bytes[68 + 4 * 6 + 68..]);
        assert_eq!((shape.len(), shape[4..9].to_vec()), (18, vec![0.25, -0.5, 2.0, 0.5, 3.0]));
        assert!(shape[..4].iter().chain(&shape[9..]).all(|value| value.is_nan()), "{shape:?}");
    }

    #[test]
    fn nothing_found_is_head_and_readings_alone() {
        let bytes = bytes_of(Solution::default());
        assert_eq!(words(&bytes[..44]), [LAYOUT, 9, 300, 0, 2, 0, 0, 0, 0, 0, 2]);
        assert!(floats(&bytes[44..48])[0].is_nan());
        assert_eq!(bytes.len(), 68 + 4 * 6);
    }
}
