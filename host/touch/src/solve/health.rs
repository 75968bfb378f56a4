//! Electrodes that cannot be right, by the readings alone.
//!
//! While `g` is grounded, `r[g][e] = 1 - V[g][e] / Vcc = Z[e][g] / D[g]` with one load `D[g]` for all `e`, and `Z` is symmetric.
//! So the logarithms of `r[g][e] / r[e][g]` are differences of those of the loads: of 120 numbers 105 are a check that needs
//! no model and no knowledge of what presses. A gain, a sign, an input that floats: each breaks the 15 numbers of its electrode.
//! Two things do not break them and are seen otherwise: a broken wire lets everything rise to the drive when it should be
//! grounded, and two wires that touch read the same.

use std::fmt;

use tactomo_physics::readings::{Readings, Says};

/// Smallest `1 - V / Vcc` that a logarithm is taken of: noise of 1.5 LSB is 3 % of it.
const SMALLEST: f64 = 0.02;
/// Sweeps for the loads: a test holds them against healthy boards under firm presses.
const SWEEPS: usize = 8;
/// Readings have to be this many deviations of the noise large before they say anything of a short or a broken wire.
pub(super) const TOUCHED: f64 = 40.0;
/// Share of the drive that everything reaches when a broken wire is to be grounded.
const UNGROUNDED: f64 = 0.97;
/// Deviations of the noise within which two electrodes read the same.
const SAME: f64 = 6.0;
/// An electrode is wrong if the mean square of its numbers, in what noise makes of them, is above this ...
const WRONG: f64 = 8.0;
/// ... and without it that of the others is at most this share of it.
const ALONE: f64 = 0.2;
/// Error of the numbers besides noise: of a converter that is not quite even.
const UNEVEN: f64 = 0.004;

/// What frames say of electrodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ElectrodeFault {
    /// Grounding it grounds nothing: its wire is broken.
    Open,
    /// It reads what another one reads.
    Shorted,
    /// Its wire is exchanged with another's.
    Exchanged,
    /// Its readings contradict those of all others.
    Contradicting,
}

impl ElectrodeFault {
    /// Its name in machine output.
    pub fn name(self) -> &'static str {
        match self {
            Self::Open => "open",
            Self::Shorted => "shorted",
            Self::Exchanged => "exchanged",
            Self::Contradicting => "contradicting",
        }
    }
}

impl fmt::Display for ElectrodeFault {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Open => "its wire is broken",
            Self::Shorted => "it reads the same as another: their wires touch",
            Self::Exchanged => "its wire is exchanged with another's",
            Self::Contradicting => "its readings contradict those of all others",
        })
    }
}

/// Electrodes that are wrong in a frame (V), each with what is wrong; `noise_v` is the deviation of a reading. `None` where readings are too
/// small to show anything.
pub fn faulty_electrodes(readings: &Readings, drive_v: f64, noise_v: f64) -> Option<Vec<(usize, ElectrodeFault)>> {
    let n = readings.electrodes();
    if readings.largest_v() < TOUCHED * noise_v {
        return None;
    }
    let open: Vec<_> = (0..n).filter(|g| is_open(readings, *g, drive_v)).collect();
    // Where everything is at the drive's potential, nothing is grounded: that is no electrode's fault alone.
    if 2 * open.len() > n {
        return None;
    }
    let sound: Vec<_> = (0..n).filter(|e| !open.contains(e)).collect();
    let shorted = shorted(readings, &sound, noise_v);
    let sound: Vec<_> = sound.into_iter().filter(|e| !shorted.contains(e)).collect();
    let contradicting = contradicting(readings, sound, drive_v, noise_v);
    let all = [
        (open, ElectrodeFault::Open),
        (shorted, ElectrodeFault::Shorted),
        (contradicting, ElectrodeFault::Contradicting),
    ];
    let mut all: Vec<_> = all.into_iter().flat_map(|(list, fault)| list.into_iter().map(move |e| (e, fault))).collect();
    all.sort_unstable();
    Some(all)
}

/// Whether most others rise to the drive when `g` is to be grounded.
fn is_open(readings: &Readings, g: usize, drive_v: f64) -> bool {
    let n = readings.electrodes();
    let risen = (0..n).filter(|e| *e != g && readings.touch_v(g, *e) > UNGROUNDED * drive_v).count();
    4 * risen > 3 * (n - 1)
}

/// Electrodes that read what another reads, whatever is grounded, though the others differ.
fn shorted(readings: &Readings, sound: &[usize], noise_v: f64) -> Vec<usize> {
    let spread_v = |e: usize, f: usize| {
        sound.iter().map(|g| (readings.touch_v(*g, e) - readings.touch_v(*g, f)).abs()).fold(0.0, f64::max)
    };
    // Two that are below the converter's floor read the same whatever they are.
    let is_told = |e: usize, f: usize| {
        let both = |g: &&usize| [e, f].iter().all(|e| readings.says(**g, *e) == Says::Voltage);
        2 * sound.iter().filter(both).count() > sound.len()
    };
    let mut found = Vec::new();
    for (i, e) in sound.iter().enumerate() {
        for f in &sound[..i] {
            // With one of them grounded the other is too, which no two pads apart ever are.
            let grounded_v = readings.touch_v(*e, *f).max(readings.touch_v(*f, *e));
            // Both rise while others are grounded: where nothing touches all read the same, but for a wire that floats.
            let risen_v = sound.iter().map(|g| readings.touch_v(*g, *e)).fold(0.0, f64::max);
            let row_v = sound.iter().map(|other| readings.touch_v(*e, *other)).fold(0.0, f64::max);
            let is_touched = row_v.min(risen_v) > TOUCHED * noise_v && is_told(*e, *f);
            if is_touched && grounded_v < SAME * noise_v && spread_v(*e, *f) < SAME * noise_v {
                found.extend([*e, *f]);
            }
        }
    }
    found.sort_unstable();
    found.dedup();
    found
}

/// Electrodes without which the others agree: the worst first, as long as leaving it out helps.
fn contradicting(readings: &Readings, mut sound: Vec<usize>, drive_v: f64, noise_v: f64) -> Vec<usize> {
    let mut found = Vec::new();
    while sound.len() > 4 && 4 * found.len() < readings.electrodes() {
        let before = disagreement(readings, &sound, drive_v, noise_v);
        if before < WRONG {
            return found;
        }
        let without = |e: usize| sound.iter().copied().filter(|other| *other != e).collect::<Vec<_>>();
        let scored = sound.iter().map(|e| (*e, disagreement(readings, &without(*e), drive_v, noise_v)));
        let Some((worst, after)) = scored.min_by(|a, b| a.1.total_cmp(&b.1)) else { return found };
        found.push(worst);
        sound = without(worst);
        if after < WRONG {
            return if after < ALONE * before { found } else { Vec::new() };
        }
    }
    // Nearly all contradict each other: that is no single electrode's fault.
    Vec::new()
}

/// Logarithms of two electrodes' ratios, and how much they count.
#[derive(Clone, Copy, Default)]
pub(crate) struct Pair {
    pub log: f64,
    /// One over the square of its deviation; zero where a reading at the drive makes it say nothing.
    pub weight: f64,
}

/// Mean square of what the logarithms are off, in what noise makes of them.
fn disagreement(readings: &Readings, electrodes: &[usize], drive_v: f64, noise_v: f64) -> f64 {
    let n = electrodes.len();
    let mut pairs = vec![Pair::default(); n * n];
    for i in 0..n {
        for j in 0..i {
            let pair = pair(readings, electrodes[i], electrodes[j], drive_v, noise_v);
            pairs[i * n + j] = pair;
            pairs[j * n + i] = Pair { log: -pair.log, ..pair };
        }
    }
    let loads = loads(&pairs, n);
    let (mut sum, mut counted) = (0.0, 0_usize);
    for i in 0..n {
        for j in 0..i {
            let pair = pairs[i * n + j];
            sum += pair.weight * (pair.log - (loads[j] - loads[i])).powi(2);
            counted += usize::from(pair.weight > 0.0);
        }
    }
    sum / counted.saturating_sub(n - 1).max(1) as f64
}

/// What the readings of two electrodes say.
fn pair(readings: &Readings, g: usize, e: usize, drive_v: f64, noise_v: f64) -> Pair {
    if [readings.says(g, e), readings.says(e, g)] != [Says::Voltage; 2] {
        return Pair::default();
    }
    let ratios = [readings.at(g, e), readings.at(e, g)].map(|volts| 1.0 - volts / drive_v);
    // A pad all but at the drive's potential says only that something conducts well; one above it cannot be.
    if ratios.iter().any(|ratio| ratio.abs() < SMALLEST) {
        return Pair::default();
    }
    let [there, back] = ratios.map(|ratio| ratio.max(SMALLEST));
    let log = (there / back).ln();
    let noise = noise_v / drive_v * there.recip().hypot(back.recip());
    Pair { log, weight: noise.hypot(UNEVEN * log.abs()).powi(-2) }
}

/// Logarithm of each electrode's load but for a common constant: where all pairs count, means are the least squares; else some sweeps of
/// means over those that do are near enough.
pub(crate) fn loads(pairs: &[Pair], n: usize) -> Vec<f64> {
    let row = |i: usize| &pairs[i * n..(i + 1) * n];
    let mut loads: Vec<_> = (0..n).map(|i| -row(i).iter().map(|pair| pair.log).sum::<f64>() / n as f64).collect();
    // Those on the diagonal never count.
    if pairs.iter().filter(|pair| pair.weight == 0.0).count() == n {
        return loads;
    }
    for _ in 0..SWEEPS {
        for i in 0..n {
            let counted = row(i).iter().zip(&loads).filter(|(pair, _)| pair.weight > 0.0);
            let (sum, count) =
                counted.fold((0.0, 0.0), |(sum, count), (pair, load)| (sum + load - pair.log, count + 1.0));
            if count > 0.0 {
                loads[i] = sum / count;
            }
        }
    }
    loads
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn where_nothing_touches_a_wire_that_floats_makes_no_shorts_of_the_others() {
        let noise_v = 1e-3;
        let rest = |g: usize, e: usize| noise_v * ((7 * g + 3 * e) % 5) as f64;
        let floating = Readings::from_fn(16, |g, e| if e == 3 { 0.4 + 0.02 * g as f64 } else { rest(g, e) });
        let found = faulty_electrodes(&floating, 1.2, noise_v).unwrap();
        assert!(found.iter().all(|(e, _)| *e == 3), "{found:?}");
    }

    #[test]
    fn two_wires_that_touch_are_told() {
        let rises = |g: usize, e: usize| if g == e { 0.0 } else { 0.3 + 0.02 * e as f64 };
        let joined = |e: usize| if e == 6 { 5 } else { e };
        let shorted = Readings::from_fn(16, |g, e| rises(joined(g), joined(e)));
        let found = faulty_electrodes(&shorted, 1.2, 1e-3).unwrap();
        assert_eq!(found, [(5, ElectrodeFault::Shorted), (6, ElectrodeFault::Shorted)]);
    }
}
