//! Presses in a recording: stretches in which something stands on the detector, and what it conducts meanwhile.

use super::{Direction, ForcePress};

/// Shortest stretch without a contact that ends a press (s): shorter ones are contacts that were lost for some frames.
const LIFTED_S: f64 = 0.1;
/// Shortest press (s): a tap does not stand still on any scale.
const SHORTEST_S: f64 = 0.2;
/// What stands still longest is looked for in so much of a press.
const STEADY_SHARE: f64 = 1.0 / 3.0;
/// Frames that a conductance is taken from, at least.
const FEWEST: usize = 3;
/// Contacts that conduct less than this share of the firmest are none: noise, or the converter's offset before the baseline is taken. Presses of a
/// hundredth of the force conduct an eighth at least.
const FAINTEST: f64 = 0.01;
/// With a force sensor, presses follow each other as often as the force has changed by this factor (as a logarithm): a ramp over a decade gives some ten.
const STEP: f64 = 0.25;
/// Forces below this share of the largest are the sensor's offset and noise.
const LIGHTEST: f64 = 0.02;

/// What a solver found in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Time of the frame (s).
    pub time_s: f64,
    /// How many contacts.
    pub contacts: usize,
    /// Conductance of the first of them (S).
    pub conductance_s: f64,
    /// Its standard error (S); zero where it is not known.
    pub deviation_s: f64,
}

/// A plateau: a stretch of time in which something stands on the detector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plateau {
    /// When it begins and ends (s).
    pub time_s: [f64; 2],
    /// Contacts that most of its frames have.
    pub contacts: usize,
    /// Conductance where it stands still longest (S), if there is a single contact.
    pub conductance_s: f64,
    /// Its standard error (S): that of the solver, and how still it stands.
    pub deviation_s: f64,
}

/// The presses of a recording, in their order.
pub fn plateaus(moments: &[Moment]) -> Vec<Plateau> {
    let mut known = moments.to_vec();
    let floor_s = FAINTEST * firmest_s(moments);
    for moment in known.iter_mut().filter(|moment| moment.contacts == 1 && moment.conductance_s < floor_s) {
        moment.contacts = 0;
    }
    stretches(&known).into_iter().filter(|stretch| length_s(stretch) >= SHORTEST_S).map(Plateau::of).collect()
}

/// Presses of a recording against a force sensor: `forces` are times (s) and newtons, times rising.
///
/// In each stretch a press is the mean of frames with a single contact over which the force changes little. It is one of loading if the force was
/// lower before it, else of unloading; the first of a stretch is loading.
pub fn pairs(moments: &[Moment], forces: &[[f64; 2]]) -> Vec<ForcePress> {
    let largest_n = forces.iter().map(|[_, force_n]| *force_n).fold(0.0, f64::max);
    let known = |moment: &&Moment| {
        let force_n = force_at(forces, moment.time_s).filter(|force_n| *force_n > LIGHTEST * largest_n)?;
        (moment.contacts == 1 && moment.conductance_s > 0.0).then_some((**moment, force_n))
    };
    let mut presses = Vec::new();
    for stretch in stretches(moments) {
        let known: Vec<_> = stretch.iter().filter_map(|moment| known(&moment)).collect();
        let mut before_n = 0.0;
        for group in groups(&known) {
            let mean = |of: fn(&(Moment, f64)) -> f64| group.iter().map(of).sum::<f64>() / group.len() as f64;
            let conductance_s = mean(|(moment, _)| moment.conductance_s.ln()).exp();
            let force_n = mean(|(_, force_n)| force_n.ln()).exp();
            let deviation = mean(|(moment, _)| (moment.deviation_s / moment.conductance_s).powi(2)).sqrt();
            let direction = if force_n > before_n { Direction::Loading } else { Direction::Unloading };
            before_n = force_n;
            let deviation_s = conductance_s * deviation;
            presses.push(ForcePress { force_n, conductance_s, deviation_s, direction: Some(direction) });
        }
    }
    presses
}

impl Plateau {
    fn of(stretch: &[Moment]) -> Self {
        let single: Vec<Moment> = stretch.iter().copied().filter(|moment| moment.contacts == 1).collect();
        let contacts = match 2 * single.len() >= stretch.len() {
            true => 1,
            false => median(stretch.iter().map(|moment| moment.contacts).filter(|contacts| *contacts > 1).collect()),
        };
        let steady = steadiest(&single, (STEADY_SHARE * length_s(stretch)).max(LIFTED_S));
        let count = steady.len().max(1) as f64;
        let mean = steady.iter().map(|moment| moment.conductance_s.ln()).sum::<f64>() / count;
        let spread = steady.iter().map(|moment| (moment.conductance_s.ln() - mean).powi(2)).sum::<f64>() / count;
        let own = steady.iter().map(|moment| (moment.deviation_s / moment.conductance_s).powi(2)).sum::<f64>() / count;
        let time_s = [stretch.first(), stretch.last()].map(|moment| moment.map_or(0.0, |moment| moment.time_s));
        let conductance_s = if steady.is_empty() { 0.0 } else { mean.exp() };
        Self { time_s, contacts, conductance_s, deviation_s: conductance_s * (spread + own).sqrt() }
    }
}

/// What the firmest tenth of the moments with a single contact conducts at least (S).
fn firmest_s(moments: &[Moment]) -> f64 {
    let mut single: Vec<f64> =
        moments.iter().filter(|moment| moment.contacts == 1).map(|moment| moment.conductance_s).collect();
    single.sort_by(f64::total_cmp);
    single.get(single.len() * 9 / 10).copied().unwrap_or_default()
}

fn median(mut values: Vec<usize>) -> usize {
    values.sort_unstable();
    values.get(values.len() / 2).copied().unwrap_or_default()
}

fn length_s(moments: &[Moment]) -> f64 {
    moments.first().zip(moments.last()).map_or(0.0, |(first, last)| last.time_s - first.time_s)
}

/// Stretches with contacts, from the first to the last frame that has one.
fn stretches(moments: &[Moment]) -> Vec<&[Moment]> {
    let touched: Vec<usize> = (0..moments.len()).filter(|index| moments[*index].contacts > 0).collect();
    let is_together = |a: &usize, b: &usize| moments[*b].time_s - moments[*a].time_s < LIFTED_S;
    let runs = touched.chunk_by(is_together);
    runs.filter_map(|run| Some(&moments[*run.first()?..=*run.last()?])).collect()
}

/// The frames within so much time whose conductances differ least.
fn steadiest(moments: &[Moment], window_s: f64) -> &[Moment] {
    // Sums of the logarithms and their squares, about one of them so that no digits are lost.
    let Some(first) = moments.first() else { return moments };
    let mut sums = vec![[0.0; 2]];
    for (index, moment) in moments.iter().enumerate() {
        let off = (moment.conductance_s / first.conductance_s).ln();
        sums.push([sums[index][0] + off, sums[index][1] + off * off]);
    }
    let (mut best, mut least, mut end) = (moments, f64::INFINITY, 0);
    for begin in 0..moments.len() {
        while end < moments.len() && moments[end].time_s - moments[begin].time_s <= window_s {
            end += 1;
        }
        let count = end - begin;
        let is_whole = end < moments.len() || begin == 0;
        if count >= FEWEST.min(moments.len()) && is_whole {
            let [mean, square] = [0, 1].map(|k| (sums[end][k] - sums[begin][k]) / count as f64);
            let variance = square - mean * mean;
            if variance < least {
                (least, best) = (variance, &moments[begin..end]);
            }
        }
    }
    best
}

/// The force at a time (N), between the sensor's; `None` outside.
fn force_at(forces: &[[f64; 2]], time_s: f64) -> Option<f64> {
    let after = forces.partition_point(|[at_s, _]| *at_s <= time_s);
    let [from_s, from_n] = *forces.get(after.checked_sub(1)?)?;
    let [to_s, to_n] = *forces.get(after)?;
    Some(from_n + (to_n - from_n) * (time_s - from_s) / (to_s - from_s))
}

/// Frames over which the force changes little.
fn groups(known: &[(Moment, f64)]) -> Vec<&[(Moment, f64)]> {
    let (mut groups, mut begin) = (Vec::new(), 0);
    for end in 1..=known.len() {
        let ends = known.get(end).is_none_or(|(_, force_n)| (force_n / known[begin].1).ln().abs() > STEP);
        if ends {
            groups.push(&known[begin..end]);
            begin = end;
        }
    }
    groups.retain(|group| group.len() >= FEWEST);
    groups
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames 2 ms apart, of what presses with this at each time (S; zero for nothing).
    fn moments(seconds: f64, conductance_s: impl Fn(f64) -> f64) -> Vec<Moment> {
        let at = |k: usize| {
            let time_s = 0.002 * k as f64;
            let conductance_s = conductance_s(time_s);
            Moment {
                time_s,
                contacts: usize::from(conductance_s > 0.0),
                conductance_s,
                deviation_s: 0.01 * conductance_s,
            }
        };
        (0..(seconds / 0.002) as usize).map(at).collect()
    }

    /// A press that grows for 0.3 s, stands, and goes in 0.2 s, with a drop-out of 20 ms at 0.5 s.
    fn press(time_s: f64, top_s: f64) -> f64 {
        let drop_out = if (0.5..0.52).contains(&time_s) { 0.0 } else { 1.0 };
        drop_out * top_s * (time_s / 0.3).min((1.5 - time_s) / 0.2).clamp(0.0, 1.0)
    }

    #[test]
    fn presses_are_found_with_what_they_conduct_where_they_stand() {
        let tops_s = [2e-3, 5e-4, 8e-3];
        let all = moments(6.0, |time_s| {
            let k = ((time_s / 2.0) as usize).min(2);
            press(time_s - 2.0 * k as f64 - 0.2, tops_s[k])
        });
        let found = plateaus(&all);
        assert_eq!(found.len(), 3, "{found:?}");
        for (k, (plateau, top_s)) in found.iter().zip(tops_s).enumerate() {
            assert!((plateau.conductance_s / top_s - 1.0).abs() < 1e-3 && plateau.contacts == 1, "{plateau:?}");
            assert!((plateau.deviation_s / top_s - 0.01).abs() < 1e-3, "{plateau:?}");
            assert!(
                (plateau.time_s[0] - 2.0 * k as f64 - 0.2).abs() < 0.06
                    && (plateau.time_s[1] - 2.0 * k as f64 - 1.7).abs() < 0.06
            );
        }
    }

    #[test]
    fn taps_are_no_presses_and_two_contacts_are_counted() {
        let mut all = moments(3.0, |time_s| if (0.5..0.6).contains(&time_s) || time_s > 1.0 { 1e-3 } else { 0.0 });
        all.iter_mut().filter(|moment| moment.time_s > 1.2).for_each(|moment| moment.contacts = 2);
        let [plateau] = plateaus(&all)[..] else { panic!("{:?}", plateaus(&all)) };
        assert_eq!(plateau.contacts, 2);
        let faint = moments(3.0, |time_s| {
            if time_s < 1.0 {
                3e-6
            } else if time_s > 2.0 {
                1e-3
            } else {
                0.0
            }
        });
        assert_eq!(plateaus(&faint).len(), 1, "what is that faint is no press");
        assert_eq!(plateaus(&moments(1.0, |_| 0.0)), []);
        assert_eq!(plateaus(&[]), []);
    }

    #[test]
    fn a_ramp_is_paired_with_a_sensor_up_and_down() {
        // Up to 5 N in 2 s and down again, 10 % more on the way back.
        let force_n = |time_s: f64| 5.0 * (1.0 - (time_s - 2.0).abs() / 2.0).max(0.0);
        let all = moments(4.0, |time_s| {
            let side = if time_s > 2.0 { 1.1 } else { 1.0 };
            if force_n(time_s) > 0.01 { side * 1e-3 * force_n(time_s).sqrt() } else { 0.0 }
        });
        let forces: Vec<_> = (0..400).map(|k| 0.01 * f64::from(k)).map(|time_s| [time_s, force_n(time_s)]).collect();
        let pairs = pairs(&all, &forces);
        let of = |direction| pairs.iter().filter(move |press| press.direction == Some(direction));
        assert!((10..25).contains(&of(Direction::Loading).count()), "{}", of(Direction::Loading).count());
        assert!((10..25).contains(&of(Direction::Unloading).count()));
        let share = |press: &ForcePress| press.conductance_s / (1e-3 * press.force_n.sqrt());
        // The uppermost stands on both sides.
        let wrong = |press: &&ForcePress, side: f64| press.force_n < 4.0 && (share(press) / side - 1.0).abs() > 0.01;
        assert!(of(Direction::Loading).all(|press| !wrong(&press, 1.0)), "{pairs:?}");
        assert!(of(Direction::Unloading).all(|press| !wrong(&press, 1.1)), "{pairs:?}");
        assert!(pairs.iter().all(|press| press.force_n > 0.1), "the sensor's offset is no press");
        assert_eq!(super::pairs(&all, &[[10.0, 1.0], [11.0, 2.0]]), [], "another time");
    }
}
