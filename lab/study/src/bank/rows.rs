//! Figures of classes of scenes and of contacts.

use super::judge::{Match, Place, TrueContact};
use super::scenes::MAX_CONTACTS;
use super::{Case, Trial};
use crate::score::quantiles;

/// Strongest over lightest contact from which a scene is one of contrasts.
const CONTRAST: f64 = 100.0;

/// What explains readings better than an answer does so by this at least (nats): less is between two fits that end in the same place.
const BEHIND_NATS: f64 = 1.0;

/// Classes of what is claimed: from so much on.
const SURE: [f64; 4] = [0.95, 0.8, 0.5, 0.0];

/// Figures of a class.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Row {
    /// Name of the case.
    pub case: String,
    /// Name of the solver.
    pub solver: String,
    /// What it is.
    pub class: &'static str,
    /// Of its scenes, if it is a class of scenes.
    pub scenes: Option<SceneFigures>,
    /// Of its contacts.
    pub contacts: ContactFigures,
}

/// Figures of scenes.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct SceneFigures {
    /// How many.
    pub scenes: usize,
    /// Share with as many contacts found as are there.
    pub count_right: f64,
    /// Share with all visible contacts found and none invented.
    pub all_found: f64,
    /// Share that is wrong though what touches explains the readings better by a nat and more, by the evidence of the solver, if it has that: for these its search is to blame, for others that are wrong
    /// what readings and model hold.
    pub search: f64,
    /// Share that the solver flags as misfit.
    pub misfit: f64,
    /// Of those that are wrong, the share that is flagged as misfit or names the right number of contacts as its alternative.
    pub warned: Option<f64>,
    /// Time of a cold start (us): median, 95 % below.
    pub cold_us: Quantiles,
    /// Time of each next frame (us): median, 95 % below.
    pub next_us: Quantiles,
    /// Both over the time of `tikhonov` on the same frames: medians.
    pub over_tikhonov: [f64; 2],
}

/// Figures of contacts: but for the first two, of those visible that were found. `None` where there is none.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ContactFigures {
    /// How many are visible.
    pub visible: usize,
    /// Share of them that was found.
    pub found: Option<f64>,
    /// Distance from the truth (m): median, 90 % below.
    pub error_m: Option<Quantiles>,
    /// The same over the bound.
    pub over_bound: Option<Quantiles>,
    /// Shares of coordinates within 1 and 2 claimed standard errors.
    pub place_within: Option<[f64; 2]>,
    /// Shares of logarithms of conductances likewise.
    pub conductance_within: Option<[f64; 2]>,
}

/// The median, and what all but a few are below.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Quantiles {
    /// The median.
    pub median: f64,
    /// The high one: 90 % below of errors, 95 % of times.
    pub high: f64,
}

/// How often answers that claim much alike are right: that as many were found as are there, but for invisible ones.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Claims {
    /// Name of the case.
    pub case: String,
    /// Name of the solver.
    pub solver: String,
    /// Least that they claim of their count; `None` of those that claim nothing.
    pub least: Option<f64>,
    /// How many.
    pub scenes: usize,
    /// Mean of what they claim.
    pub claimed: Option<f64>,
    /// Share that is right.
    pub right: f64,
}

/// What answers claim, from the surest on; classes without any are left out.
pub(super) fn claims(case: &Case, solver: &str, trials: &[&Trial]) -> Vec<Claims> {
    let class = |claimed: Option<f64>| claimed.and_then(|claimed| SURE.into_iter().find(|least| claimed >= *least));
    let of = |least: Option<f64>| {
        let all: Vec<_> =
            trials.iter().map(|trial| &trial.judged).filter(|judged| class(judged.certainty) == least).collect();
        let right = share(all.iter().map(|judged| judged.is_visible_count_right()))?;
        let claimed: Option<f64> = all.iter().map(|judged| judged.certainty).sum();
        let claimed = claimed.map(|sum| sum / all.len() as f64);
        Some(Claims { case: case.name.clone(), solver: solver.to_owned(), least, scenes: all.len(), claimed, right })
    };
    SURE.map(Some).into_iter().chain([None]).filter_map(of).collect()
}

/// Figures of all classes of which there is something.
pub(super) fn rows(case: &Case, solver: &str, trials: &[&Trial]) -> Vec<Row> {
    const COUNTS: [&str; MAX_CONTACTS] = ["1 contact", "2 contacts", "3 contacts", "4 contacts", "5 contacts"];
    let of_scenes = |class: &'static str, is_of_it: &dyn Fn(&Trial) -> bool| {
        let trials: Vec<&Trial> = trials.iter().copied().filter(|trial| is_of_it(trial)).collect();
        let contacts = ContactFigures::of(trials.iter().flat_map(|trial| trial.judged.visible()));
        (class, SceneFigures::of(&trials), contacts)
    };
    let of_contacts = |class: &'static str, is_of_it: &dyn Fn(&TrueContact) -> bool| {
        let contacts = trials.iter().flat_map(|trial| trial.judged.visible()).filter(|contact| is_of_it(contact));
        (class, None, ContactFigures::of(contacts))
    };
    let of_sheets = |range: std::ops::Range<f64>| move |contact: &TrueContact| range.contains(&contact.sheets);
    let of_radii_mm =
        |range: std::ops::Range<f64>| move |contact: &TrueContact| range.contains(&(1e3 * contact.scaled_radius_m));
    let by_count = (1..).zip(COUNTS).map(|(count, class)| of_scenes(class, &|t| t.judged.truth.len() == count));
    let by_kind = case.kinds().iter().map(|kind| of_scenes(kind, &|trial| trial.kind == Some(*kind)));
    let others = [
        of_scenes("all", &|_| true),
        of_scenes("contrast above 100", &|trial| trial.judged.contrast() > CONTRAST),
        of_contacts("in corners", &|contact| contact.place == Place::Corner),
        of_contacts("at walls", &|contact| contact.place == Place::Wall),
        of_contacts("radius below 2 mm", &of_radii_mm(0.0..2.0)),
        of_contacts("radius 2 to 3.5 mm", &of_radii_mm(2.0..3.5)),
        of_contacts("radius above 3.5 mm", &of_radii_mm(3.5..f64::INFINITY)),
        of_contacts("below 0.1 sheets", &of_sheets(0.0..0.1)),
        of_contacts("0.1 to 1 sheets", &of_sheets(0.1..1.0)),
        of_contacts("above 1 sheet", &of_sheets(1.0..f64::INFINITY)),
    ];
    let all = by_count.chain(by_kind).chain(others);
    let has_some =
        |(_, scenes, contacts): &(_, Option<SceneFigures>, ContactFigures)| scenes.is_some() || contacts.visible > 0;
    let row =
        |(class, scenes, contacts)| Row { case: case.name.clone(), solver: solver.to_owned(), class, scenes, contacts };
    all.filter(has_some).map(row).collect()
}

impl SceneFigures {
    fn of(trials: &[&Trial]) -> Option<Self> {
        let share_of = |is: &dyn Fn(&Trial) -> bool| share(trials.iter().map(|trial| is(trial)));
        let wrong = trials.iter().filter(|trial| trial.judged.faults() > 0);
        let warned: Vec<bool> = wrong.map(|trial| trial.judged.is_warned()).collect();
        let is_behind = |trial: &Trial| trial.behind_nats.is_some_and(|nats| nats > BEHIND_NATS);
        let median = |all: &mut dyn Iterator<Item = f64>| quantiles(all, [0.5]).map(|[median]| median);
        let cold = &mut trials.iter().map(|trial| trial.cold_us / trial.tikhonov_us);
        let next = &mut trials.iter().flat_map(|trial| trial.next_us.iter().map(|us| us / trial.tikhonov_us));
        Some(Self {
            over_tikhonov: [median(cold)?, median(next)?],
            warned: share(warned.into_iter()),
            scenes: trials.len(),
            count_right: share_of(&|trial| trial.judged.is_count_right())?,
            all_found: share_of(&|trial| trial.judged.faults() == 0)?,
            search: share_of(&is_behind)?,
            misfit: share_of(&|trial| trial.judged.misfit)?,
            cold_us: Quantiles::of(trials.iter().map(|trial| trial.cold_us), 0.95)?,
            next_us: Quantiles::of(trials.iter().flat_map(|trial| trial.next_us.iter().copied()), 0.95)?,
        })
    }
}

impl ContactFigures {
    /// Of visible contacts.
    fn of<'a>(contacts: impl Iterator<Item = &'a TrueContact>) -> Self {
        let contacts: Vec<&TrueContact> = contacts.collect();
        let found = || contacts.iter().filter_map(|contact| contact.found);
        let within = |sigmas: &[f64]| {
            let share_of = |limit: f64| share(sigmas.iter().map(|sigmas| *sigmas <= limit));
            Some([share_of(1.0)?, share_of(2.0)?])
        };
        let place_sigmas: Vec<f64> = found().filter_map(|found| found.place_sigmas).flatten().collect();
        let conductance_sigmas: Vec<f64> = found().filter_map(|found| found.conductance_sigmas).collect();
        Self {
            visible: contacts.len(),
            found: share(contacts.iter().map(|contact| contact.found.is_some())),
            error_m: Quantiles::of(found().map(|found| found.error_m), 0.9),
            over_bound: Quantiles::of(found().filter_map(|found: Match| found.over_bound), 0.9),
            place_within: within(&place_sigmas),
            conductance_within: within(&conductance_sigmas),
        }
    }
}

impl Quantiles {
    fn of(values: impl Iterator<Item = f64>, share: f64) -> Option<Self> {
        quantiles(values, [0.5, share]).map(|[median, high]| Self { median, high })
    }
}

/// Share of yes; `None` of nothing.
fn share(all: impl ExactSizeIterator<Item = bool>) -> Option<f64> {
    let count = all.len();
    (count > 0).then(|| all.filter(|is| *is).count() as f64 / count as f64)
}

#[cfg(test)]
mod tests {
    use super::super::Scenes;
    use super::super::judge::Judged;
    use super::*;
    use crate::bound::Bound;
    use tactomo_physics::detector::Detector;
    use tactomo_physics::scene::{Contact, Touch};
    use tactomo_touch::solve::{FoundContact, Solution, Uncertainty};

    const CLEAR: Bound = Bound { position_m: 1e-4, conductance: 0.05, axes_m: [0.0; 2] };

    /// Contacts in a row, a centimetre apart, of a radius (mm) and a conductance (sheet conductances), and those found this far off (mm).
    fn trial(sizes: &[(f64, f64)], off_mm: &[f64]) -> Trial {
        let detector = Detector::default();
        let uncertainty = Some(Uncertainty { x_m: 2e-4, y_m: 1e-4, correlation: 0.0, conductance_s: 1e-5 });
        let truth: Vec<Contact> = (0..)
            .zip(sizes)
            .map(|(index, (radius_mm, sheets))| {
                let sheet_s = detector.sheet_conductance_s();
                Contact::flat(0.01 * f64::from(index) - 0.02, 0.0, 1e-3 * radius_mm, sheets * sheet_s)
            })
            .collect();
        let found = |(contact, off_mm): (&Contact, &f64)| FoundContact {
            uncertainty,
            ..FoundContact::flat(contact.x_m + 1e-3 * off_mm, contact.y_m, contact.conductance_s)
        };
        let contacts = truth.iter().zip(off_mm).map(found).collect();
        let solution = Solution { contacts, ..Solution::default() };
        let touches: Vec<Touch> = truth.iter().copied().map(Touch::from).collect();
        let judged = Judged::new(&detector, &touches, Some(&vec![CLEAR; truth.len()]), &solution);
        Trial {
            case: String::new(),
            solver: "auto".to_owned(),
            scene: 0,
            kind: None,
            detector: detector.name,
            judged,
            behind_nats: off_mm.is_empty().then_some(2.0),
            cold_us: 1e3,
            next_us: vec![10.0, 30.0, 20.0],
            tikhonov_us: 5.0,
        }
    }

    fn case() -> Case {
        Case::of("", Scenes::Random, vec![Detector::default()])
    }

    fn rows_of(trials: &[Trial]) -> Vec<Row> {
        rows(&case(), "auto", &trials.iter().collect::<Vec<_>>())
    }

    fn row(rows: &[Row], class: &str) -> Row {
        rows.iter().find(|row| row.class == class).unwrap().clone()
    }

    #[test]
    fn scenes_are_counted_by_class() {
        let (light, firm) = ((2.5, 0.003), (1.5, 1.5));
        let trials = [trial(&[firm], &[0.1]), trial(&[firm, light], &[0.3]), trial(&[light, light], &[0.1, 0.1])];
        let rows = rows_of(&trials);
        let find = |class: &str| rows.iter().find(|row| row.class == class);
        let scenes = |class: &str| find(class)?.scenes.as_ref().map(|figures| (figures.scenes, figures.all_found));
        assert_eq!(scenes("1 contact"), Some((1, 1.0)));
        assert_eq!(scenes("2 contacts"), Some((2, 0.5)));
        assert_eq!(scenes("3 contacts"), None);
        assert_eq!(scenes("contrast above 100"), Some((1, 0.0)));
        assert_eq!(scenes("in corners"), None, "a class of contacts");
        let all = row(&rows, "all").scenes.unwrap();
        assert_eq!((all.cold_us.median, all.next_us), (1e3, Quantiles { median: 20.0, high: 30.0 }));
        assert!((all.count_right - 2.0 / 3.0).abs() < 1e-12 && all.misfit == 0.0 && all.warned == Some(0.0));
        assert_eq!(all.over_tikhonov, [200.0, 4.0]);
        assert!(
            !rows.iter().any(|row| row.class == "above 1 sheet" && row.contacts.visible == 0),
            "nothing has no row"
        );
    }

    #[test]
    fn contacts_are_counted_by_class() {
        let rows =
            rows_of(&[trial(&[(1.5, 2.0), (2.5, 0.5), (4.0, 0.01)], &[0.1, 0.3]), trial(&[(1.5, 0.01)], &[0.5])]);
        let small = row(&rows, "radius below 2 mm").contacts;
        assert_eq!((small.visible, small.found), (2, Some(1.0)));
        let error = small.error_m.unwrap();
        assert!((error.median - 5e-4).abs() < 1e-9, "the upper of two: {error:?}");
        let wide = row(&rows, "radius above 3.5 mm").contacts;
        assert_eq!((wide.visible, wide.found, wide.error_m, wide.place_within), (1, Some(0.0), None, None));
        assert_eq!(row(&rows, "below 0.1 sheets").contacts.found, Some(0.5));
        let firm = row(&rows, "above 1 sheet").contacts;
        assert!(firm.over_bound.is_some_and(|ratio| (ratio.median - 1.0).abs() < 1e-9), "{firm:?}");
    }

    #[test]
    fn claims_are_held_against_how_often_they_are_right() {
        let of = |off_mm: &[f64], certainty: Option<f64>| {
            let mut trial = trial(&[(2.0, 0.5)], off_mm);
            trial.judged.certainty = certainty;
            trial
        };
        let all = [of(&[0.1], Some(0.99)), of(&[], Some(0.97)), of(&[9.0], Some(0.5)), of(&[], None)];
        let (case_name, solver) = (String::new, || "auto".to_owned());
        let row = |least, scenes, claimed, right| Claims {
            case: case_name(),
            solver: solver(),
            least,
            scenes,
            claimed,
            right,
        };
        let expected =
            [row(Some(0.95), 2, Some(0.98), 0.5), row(Some(0.5), 1, Some(0.5), 1.0), row(None, 1, None, 0.0)];
        assert_eq!(claims(&case(), "auto", &all.iter().collect::<Vec<_>>()), expected);
    }

    #[test]
    fn coordinates_within_one_and_two_standard_errors_are_counted() {
        // Errors of x are 0.5, 1.5 and 2.5 standard errors, those of y none.
        let rows = rows_of(&[trial(&[(2.0, 0.5); 3], &[0.1, 0.3, 0.5])]);
        let all = row(&rows, "all").contacts;
        assert_eq!(all.place_within, Some([4.0 / 6.0, 5.0 / 6.0]));
        assert_eq!(all.conductance_within, Some([1.0, 1.0]));
    }
}
