//! The film on a foam from presses of known force.
//!
//! Under a tip of a known shape, on a foam of a known elasticity, a [film](Surface::Film) makes a contact conduct `a F^gamma` with a known exponent: 5/3
//! under a ball, 3 under a flat punch. What readings tell is `1 / G = 1 / (a F^gamma) + f k(F)` with the constriction of the current under the contact: that of a
//! disc on a half space and of a sheet around it,
//!
//! ```text
//! k(F) = 1 / (4 sigma w(F)) + 1 / (2 pi sigma t),
//! ```
//!
//! with the contact's half width `w` (Holm, *Electric Contacts*, 1967). The factor `f` is fitted: how well the foam conducts is known to a fifth.
//! `a` tells the film's one parameter, as its cube.
//!
//! Presses of one tip cannot tell elasticity and film apart: a ball's `a` goes with `E^(4/3) / u^3`, a flat punch's with `1 / u^3`.

use std::f64::consts::TAU;

use tactomo_physics::detector::Detector;
use tactomo_physics::hertz::{Beyond, Hertz, Skin, Surface, Tip};

use super::{
    Candidate, DETERMINED, ForceError, ForcePress, Known, is_determined, left_out, range_n, rising, tried, widening,
};
use crate::student::quantile;

/// So light a press that any tip is within Hertz's theory (N).
const LIGHT_N: f64 = 1e-6;

/// What presses tell of a detector's surface. Standard errors and scatter have Student's allowance for few presses: 1.645 of them are bands of 90 %.
#[derive(Clone, Debug, PartialEq)]
pub struct SkinFit {
    /// The skin that was found.
    pub skin: Skin,
    /// Pressure at which its film conducts 1 S/m2 (Pa).
    pub unit_pa: f64,
    /// Its standard error (Pa): by the presses alone, elasticity and tip taken as exact.
    pub unit_deviation_pa: f64,
    /// Constriction over what the detector's conductivity makes of it, and its standard error; `None` if the presses do not tell it.
    pub constriction: Option<[f64; 2]>,
    /// Standard deviation of the logarithm of the conductance about the law, from press to press.
    pub scatter: f64,
    /// Half the width between loading and unloading, of the logarithm of the conductance; 0 where they are not told apart.
    pub hysteresis: f64,
    /// Exponent that the law has under the tip.
    pub exponent: f64,
    /// Exponent that the presses have of themselves, and its standard error, with the allowance at 95 %.
    pub own_exponent: [f64; 2],
    /// Smallest and largest force of the presses that agree (N).
    pub range_n: [f64; 2],
    /// Presses that do not agree with the others, by their index.
    pub left_out: Vec<usize>,
    /// What each press should conduct (S).
    pub fitted_s: Vec<f64>,
    /// The limit of Hertz's theory that the firmest press is beyond, if any.
    pub beyond: Option<Beyond>,
    /// All that was tried.
    pub candidates: Vec<Candidate>,
}

impl SkinFit {
    /// Whether the exponent of the presses is the law's, at 95 % confidence.
    pub fn follows_law(&self) -> bool {
        let [own, deviation] = self.own_exponent;
        (own - self.exponent).abs() < DETERMINED * deviation
    }
}

/// Finds the film on `detector` from presses of `tip`; of `skin` the elasticity counts, and the surface is found.
///
/// # Errors
/// [`ForceError`] if the presses tell none, or the skin is no elastic layer.
pub fn fit_skin(presses: &[ForcePress], tip: Tip, detector: &Detector, skin: Skin) -> Result<SkinFit, ForceError> {
    let hertz = Hertz::new(detector, skin)?;
    rising(presses)?;
    let exponent = tip.exponent(Surface::Film { unit_pa: 1.0 });
    let known = Known { exponent: Some(exponent), ..constriction(detector, hertz, tip) };
    let tried = tried(presses, Some(known));
    let best = tried.first().ok_or(ForceError::Open)?;
    let free = super::tried(presses, Some(Known { exponent: None, ..known }));
    let own = free.first().ok_or(ForceError::Open)?;
    let left_out = left_out(presses, best)?;
    let widening = widening(best.freedom());
    let [a_s, a_deviation_s] = best.conductance_at_1_n_s();
    let unit_pa = hertz.film_unit_pa(tip, a_s);
    let skin = skin.with(Surface::Film { unit_pa });
    skin.check()?;
    let kept = presses.iter().enumerate().filter(|(index, _)| !left_out.contains(index)).map(|(_, press)| press);
    let range_n = range_n(kept);
    let [own_exponent, own_deviation] = own.exponent();
    Ok(SkinFit {
        unit_pa,
        unit_deviation_pa: widening * unit_pa * a_deviation_s / a_s / 3.0,
        constriction: best
            .series()
            .filter(|series| is_determined(*series, best.freedom()))
            .map(|[factor, deviation]| [factor, widening * deviation]),
        scatter: widening * best.scatter(),
        hysteresis: best.hysteresis(),
        exponent,
        own_exponent: [own_exponent, own_deviation * quantile(DETERMINED, own.freedom()) / DETERMINED],
        fitted_s: presses.iter().map(|press| best.conductance_s(press)).collect(),
        beyond: hertz.tip(tip, range_n[1]).beyond,
        candidates: tried.iter().map(super::Fitted::candidate).collect(),
        range_n,
        left_out,
        skin,
    })
}

/// The constriction that is to be expected under a tip.
fn constriction(detector: &Detector, hertz: Hertz, tip: Tip) -> Known {
    let film = hertz.with(Surface::Film { unit_pa: 1.0 });
    let width_exponent = match tip {
        Tip::Ball { .. } => 1.0 / 3.0,
        Tip::Flat { .. } => 0.0,
    };
    let width_m = film.tip(tip, LIGHT_N).half_width_m / LIGHT_N.powf(width_exponent);
    let top_s_per_m = detector.layers.last().map_or(f64::INFINITY, |layer| layer.top_s_per_m);
    Known {
        exponent: None,
        under_ohm: 1.0 / (4.0 * top_s_per_m * width_m),
        around_ohm: 1.0 / (TAU * detector.sheet_conductance_s()),
        width_exponent,
    }
}

#[cfg(test)]
mod tests {
    use super::super::{BAND, Direction};
    use super::*;
    use tactomo_physics::detector::Foam;
    use tactomo_physics::simulate::Noise;

    /// A dozen presses on a kitchen scale (N).
    const DOZEN_N: [f64; 12] = [0.4, 0.6, 0.9, 1.2, 1.6, 2.2, 3.0, 4.0, 5.5, 6.5, 8.0, 10.0];
    const BALL: Tip = Tip::Ball { radius_m: 0.005 };
    const FLAT: Tip = Tip::Flat { radius_m: 0.0025 };

    /// Presses on a foam of the paper with another film than the paper's.
    struct Bench {
        detector: Detector,
        skin: Skin,
        tip: Tip,
        scatter: f64,
        hysteresis: f64,
        noise: Noise,
    }

    impl Bench {
        fn new(letter: char, tip: Tip, scatter: f64, seed: u64) -> Self {
            let detector = Detector::default().in_material(&letter.to_string().parse().unwrap()).unwrap();
            let skin = Skin::of(Foam::of(letter).unwrap().elasticity_pa).with(Surface::Film { unit_pa: 6e4 });
            Self { detector, skin, tip, scatter, hysteresis: 0.0, noise: Noise::new(seed) }
        }

        /// What a contact conducts with its constriction, which the fit takes as constant: that of a disc as wide as the contact on a half space, and of the
        /// sheet around it.
        fn press(&mut self, force_n: f64) -> ForcePress {
            let imprint = Hertz::new(&self.detector, self.skin).unwrap().tip(self.tip, force_n);
            let layer = self.detector.layers[0];
            let around_ohm = 1.0 / (std::f64::consts::TAU * layer.sheet_conductance_s());
            let ohm = 1.0 / imprint.conductance_s + 1.0 / (4.0 * layer.top_s_per_m * imprint.half_width_m) + around_ohm;
            let [side, direction] = [(-1.0, Direction::Loading), (1.0, Direction::Unloading)]
                .map(|(side, direction)| (side * self.hysteresis, direction));
            let (side, direction) = if self.noise.normal() > 0.0 { side } else { direction };
            ForcePress {
                force_n,
                conductance_s: (side + self.scatter * self.noise.normal()).exp() / ohm,
                deviation_s: 0.0,
                direction: (self.hysteresis > 0.0).then_some(direction),
            }
        }

        fn presses(&mut self, forces_n: &[f64]) -> Vec<ForcePress> {
            forces_n.iter().map(|force_n| self.press(*force_n)).collect()
        }

        /// Of a skin whose surface is not known.
        fn fit(&self, presses: &[ForcePress]) -> Result<SkinFit, ForceError> {
            fit_skin(presses, self.tip, &self.detector, Skin::of(self.skin.young_pa))
        }
    }

    #[test]
    fn a_dozen_presses_tell_the_film_within_its_standard_error() {
        // Half of the errors are below this share; on foam D, which conducts badly, firm presses tell the constriction and little of the film.
        for (letter, tip, scatter, half) in [
            ('A', BALL, 0.03, 0.005),
            ('A', BALL, 0.15, 0.02),
            ('B', BALL, 0.05, 0.008),
            ('D', BALL, 0.05, 0.08),
            ('A', FLAT, 0.1, 0.015),
            ('D', FLAT, 0.05, 0.01),
        ] {
            let (mut within, mut off, mut follow) = ([0; 2], Vec::new(), 0);
            for seed in 1000..1300 {
                let mut bench = Bench::new(letter, tip, scatter, seed);
                let presses = bench.presses(&DOZEN_N);
                let fit = bench.fit(&presses).unwrap();
                let error = (fit.unit_pa - 6e4).abs();
                off.push(error / 6e4);
                within[0] += usize::from(error < fit.unit_deviation_pa);
                within[1] += usize::from(error < BAND * fit.unit_deviation_pa);
                follow += usize::from(fit.follows_law());
            }
            off.sort_by(f64::total_cmp);
            // 68 and 90 % of 300, give or take three deviations of such counts.
            assert!(
                (190..=245).contains(&within[0]) && (254..=286).contains(&within[1]),
                "{letter} {tip:?} {within:?}"
            );
            assert!(off[150] < half && follow > 270, "{letter} {tip:?} {} {follow}", off[150]);
        }
    }

    #[test]
    fn hysteresis_is_told_where_the_direction_is() {
        let mut bench = Bench { hysteresis: 0.1, ..Bench::new('A', BALL, 0.03, 5) };
        let presses = [bench.presses(&DOZEN_N), bench.presses(&DOZEN_N)].concat();
        let fit = bench.fit(&presses).unwrap();
        assert!((fit.hysteresis - 0.1).abs() < 0.03 && fit.scatter < 0.05, "{fit:?}");
        assert!((fit.unit_pa / 6e4 - 1.0).abs() < 0.02 && fit.candidates.len() == 2, "{fit:?}");
    }

    #[test]
    fn presses_that_follow_another_law_are_told() {
        // An ideal surface, and a flat tip that is said to be a ball.
        let mut ideal = Bench::new('A', BALL, 0.05, 2);
        ideal.skin = ideal.skin.with(Surface::IDEAL);
        let mut flat = Bench::new('A', FLAT, 0.05, 2);
        for presses in [ideal.presses(&DOZEN_N), flat.presses(&DOZEN_N)] {
            let fit = fit_skin(&presses, BALL, &flat.detector, flat.skin).unwrap();
            assert!(!fit.follows_law(), "{fit:?}");
        }
    }

    #[test]
    fn presses_that_tell_no_film_are_refused_with_what_to_do() {
        let mut bench = Bench::new('A', BALL, 0.05, 3);
        let presses = bench.presses(&DOZEN_N);
        let refusal = |presses: &[ForcePress]| bench.fit(presses).unwrap_err().to_string();
        assert!(refusal(&presses[..3]).starts_with("3 presses, but 4 at least are needed"));
        let firm = [&presses[8..], &presses[8..]].concat();
        assert!(refusal(&firm).starts_with("the forces go from 5.5 N to 10 N only: press with forces that differ"));
        let soft = fit_skin(&presses, BALL, &bench.detector, Skin::of(0.35)).unwrap_err().to_string();
        assert!(soft.starts_with("skin.young_pa is 0.35"), "{soft}");
    }
}
