//! What a search asks for, and what it makes of that, on made-up fits.

use std::vec::Vec;

use crate::normal::{ANY_RADIUS, USUAL_RADIUS};
use crate::scan::{Candidate, Candidates, no_candidates};
use crate::search::Terms;
use crate::tests::{Fit, Scene, spot};

type Search = crate::search::Search<f32, 3, 0>;
type Wants = crate::search::Wants<f32, 3, 0>;

const KNOWN: Terms = Terms { is_known: true, most: 3, radius_m: 0.0025, bounds_m: [[-0.03; 2], [0.03; 2]] };
/// What a contact costs in these fits (squared deviations).
const PRICE: f32 = 21.0;

/// A fit of so many contacts that leaves so much, and says so much for each.
fn fit(contacts: usize, cost: f32, information: f32) -> Fit {
    let scene = (0..contacts).fold(Scene::EMPTY, |scene, k| scene.with(spot(0.01 * k as f32, 0.0, 1.0)));
    Fit { scene, cost, evidence: -cost - PRICE * scene.count as f32, information: [information; 3], ..Fit::NONE }
}

fn starts(gains: &[f32]) -> Candidates<f32> {
    let mut all = no_candidates();
    all.iter_mut()
        .zip(gains)
        .for_each(|(one, gain)| *one = Candidate { spot: spot(0.02, 0.01, 1.0), gain: *gain, half_of: None });
    all
}

/// Runs a search on made-up fits, by how many contacts they have; what it asked to be fitted, and what it found.
fn run(
    search: &mut Search,
    mut wants: Wants,
    mut of: impl FnMut(&Scene, f32) -> Option<Fit>,
    mut gain: impl FnMut(&Scene) -> f32,
) -> (Vec<(usize, f32)>, Option<Fit>) {
    let mut asked = Vec::new();
    for _ in 0..200 {
        wants = match wants {
            Wants::Fit(scene, deviation, _) => {
                asked.push((scene.count, deviation));
                let found = of(&scene, deviation);
                search.fitted(found, 240.0)
            }
            Wants::First => {
                search.starts = starts(&[gain(&Scene::EMPTY)]);
                search.placed(240.0)
            }
            Wants::Beside(scene, _) => {
                search.starts = starts(&[gain(&scene)]);
                search.placed(240.0)
            }
            Wants::Nothing(found) => return (asked, found),
        };
    }
    panic!("a search without end: {asked:?}");
}

#[test]
fn a_search_grows_exchanges_and_reduces() {
    // Nothing there.
    let mut search = Search::NONE;
    let wants = search.begin(None, Some(starts(&[59.0])), 240.0, KNOWN);
    assert!(matches!(wants, Wants::Nothing(None)));
    // Two contacts, each worth it: one leaves so much that it need not be found exactly, two are tried with usual radii, then fitted with any.
    let costs = [0.0, 5000.0, 230.0, 229.0];
    let by_count =
        |scene: &Scene, _| Some(fit(scene.count, costs[scene.count], 2000.0)).filter(|fit| fit.scene.count > 0);
    let gains = |scene: &Scene| if scene.count < 2 { 4000.0 } else { 5.0 };
    let wants = search.begin(None, None, 240.0, KNOWN);
    let (asked, found) = run(&mut search, wants, by_count, gains);
    assert_eq!(found.unwrap().scene.count, 2);
    let [usual, any] = [USUAL_RADIUS, ANY_RADIUS];
    assert_eq!(asked, [(1, usual), (2, usual), (2, any)]);
    assert!(!search.more);
    // What was followed and fits is taken on; what left room for more is not.
    let wants = search.begin(Some(fit(2, 400.0, 2000.0)), None, 240.0, KNOWN);
    let (asked, _) = run(&mut search, wants, by_count, gains);
    assert_eq!(asked, [(2, any)]);
    search.more = true;
    let wants = search.begin(Some(fit(2, 400.0, 2000.0)), None, 240.0, KNOWN);
    assert!(run(&mut search, wants, by_count, gains).0.len() > 1);
    // Contacts that leave too much: each is looked for anew, beside the one that stays.
    let bad = |scene: &Scene, _| {
        Some(fit(scene.count, 9000.0 / (scene.count as f32 + 1.0), 2000.0)).filter(|fit| fit.scene.count > 0)
    };
    let mut search = Search::NONE;
    let wants = search.begin(None, None, 240.0, KNOWN);
    let (asked, found) = run(&mut search, wants, bad, gains);
    assert_eq!(found.unwrap().scene.count, 2);
    let anew = asked.windows(2).filter(|two| two[0] == (2, any) && two[1] == (1, usual)).count();
    assert_eq!(anew, 2, "{asked:?}");
    // One of which little is known goes where the other does as well: it is looked for anew, or where the detector is not known only left out.
    for (is_known, deviation) in [(true, usual), (false, any)] {
        let of = |count: usize, cost: f32| fit(count, cost, 40.0);
        let alike = |scene: &Scene, _| {
            Some(of(scene.count, if scene.count == 1 { 241.0 } else { 230.0 })).filter(|fit| fit.scene.count > 0)
        };
        let mut search = Search::NONE;
        let wants = search.begin(Some(of(2, 230.0)), None, 240.0, Terms { is_known, ..KNOWN });
        let (asked, found) = run(&mut search, wants, alike, |_| 0.0);
        assert_eq!((found.unwrap().scene.count, &asked[1..3]), (1, &[(1, deviation), (1, any)][..]));
    }
    // One that readings do not speak for goes, and with the last of them all.
    let wants = search.begin(Some(fit(1, 230.0, 20.0)), None, 240.0, KNOWN);
    assert!(
        run(
            &mut search,
            wants,
            |scene, _| Some(fit(scene.count, 230.0, 20.0)).filter(|fit| fit.scene.count > 0),
            |_| 0.0
        )
        .1
        .is_none()
    );
    // Where one more beside three would explain much, that is said.
    let mut search = Search::NONE;
    let wants = search.begin(None, None, 240.0, KNOWN);
    let (_, found) = run(
        &mut search,
        wants,
        |scene, _| Some(fit(scene.count, 900.0 / scene.count.max(1) as f32, 2000.0)).filter(|fit| fit.scene.count > 0),
        |_| 500.0,
    );
    assert!(search.more && found.unwrap().scene.count == 3);
}

/// What one more contact cannot be added to, or leaves more than before, is what is found; and what another one has made needless is left out on the way.
#[test]
fn what_more_contacts_do_not_mend_is_kept() {
    for spoilt in [None, Some(9000.0)] {
        let costs = |scene: &Scene, _| match scene.count {
            0 => None,
            1 | 2 => Some(fit(scene.count, 8000.0 - scene.count as f32, 2000.0)),
            _ => spoilt.map(|cost| fit(scene.count, cost, 2000.0)),
        };
        let mut search = Search::NONE;
        let wants = search.begin(None, None, 240.0, KNOWN);
        let (asked, found) = run(&mut search, wants, costs, |_| 4000.0);
        assert!(asked.contains(&(2, ANY_RADIUS)), "{spoilt:?} {asked:?}");
        assert_eq!(found.unwrap().scene.count, 2, "{spoilt:?} {asked:?}");
    }
    let needless = |scene: &Scene, _| {
        let mut of = fit(scene.count, 20_000.0 / scene.count.max(1) as f32, 2000.0);
        of.information[0] = 1.0;
        Some(of).filter(|of| of.scene.count > 0)
    };
    let mut search = Search::NONE;
    let wants = search.begin(None, None, 240.0, KNOWN);
    let (asked, _) = run(&mut search, wants, needless, |_| 4000.0);
    let numbers: Vec<_> = asked.iter().map(|(count, _)| *count).collect();
    assert_eq!(numbers[..3], [1, 2, 2], "the first is left out, where there is a second: {asked:?}");
}

/// A contact alone that explains its frame badly is looked for anew, at all places that may do.
#[test]
fn a_contact_alone_that_went_astray_is_looked_for_anew() {
    let mut tries = 0;
    let astray = |scene: &Scene, _| {
        tries += 1;
        let cost = if tries > 2 { 230.0 } else { 900.0 };
        Some(fit(scene.count, cost, 2000.0)).filter(|of| of.scene.count > 0)
    };
    let mut search = Search::NONE;
    let wants = search.begin(Some(fit(1, 900.0, 2000.0)), None, 240.0, KNOWN);
    let (_, found) = run(&mut search, wants, astray, |scene| if scene.count == 0 { 4000.0 } else { 0.0 });
    assert_eq!(found.map(|found| (found.scene.count, found.cost)), Some((1, 230.0)));
}

/// Shares of numbers of contacts are as their evidence.
#[test]
fn how_sure_a_number_is_goes_with_the_evidence() {
    let sure = crate::Certainty::of(3, 100.0, &[None, None, Some(100.0)], true);
    assert_eq!((sure.share, sure.other), (1.0, None));
    let untried = crate::Certainty::of(2, 100.0, &[None, Some(100.0), None], true);
    assert!(untried.share > 0.96 && untried.share < 0.98 && untried.other.is_none(), "{untried:?}");
    // Where what the detector may differ by is fitted, a third of the evidence over more contacts counts.
    for (is_known, nats) in [(true, 3f32.ln()), (false, 3.0 * 3f32.ln())] {
        let tried = [Some(300.0), Some(100.0), Some(100.0 + 2.0 * nats)];
        let unsure = crate::Certainty::of(2, 100.0, &tried, is_known);
        let (other, share) = unsure.other.unwrap();
        assert!((unsure.share - 0.75).abs() < 1e-5 && other == 3 && (share - 0.25).abs() < 1e-5, "{unsure:?}");
    }
    // A search tells it of what it has tried.
    let costs = [0.0, 5000.0, 230.0, 210.0];
    let by_count = |scene: &Scene, radius_deviation| {
        let of = fit(scene.count, costs[scene.count], 2000.0);
        Some(Fit { radius_deviation, ..of }).filter(|of| of.scene.count > 0)
    };
    let mut search = Search::NONE;
    let wants = search.begin(None, None, 240.0, KNOWN);
    let (_, found) = run(&mut search, wants, by_count, |scene| if scene.count < 2 { 4000.0 } else { 20.0 });
    let told = search.certainty(&found.unwrap());
    // Three leave 20 less and cost 21 more.
    let odds = (-0.5f32).exp();
    assert!((told.share - 1.0 / (1.0 + odds)).abs() < 1e-3 && told.other.unwrap().0 == 3, "{told:?}");
}

/// What a search that begins with some contacts asks to be fitted and finds, where all contacts together leave as much as noise does and one leaves so much.
fn others_of(contacts_m: &[[f32; 2]], loose: u32, one_leaves: f32) -> (Vec<Scene>, Option<Fit>) {
    let begun = contacts_m.iter().fold(Scene::EMPTY, |scene, [x_m, y_m]| scene.with(spot(*x_m, *y_m, 1.0)));
    let of = |scene: &Scene| {
        let cost = if scene.count < contacts_m.len() { one_leaves } else { 230.0 };
        Fit { scene: *scene, loose, ..fit(scene.count, cost, 2000.0) }
    };
    let (mut asked, mut search) = (Vec::new(), Search::NONE);
    let wants = search.begin(Some(of(&begun)), None, 240.0, KNOWN);
    let fitted = |scene: &Scene, _| {
        asked.push(*scene);
        Some(of(scene))
    };
    let (_, found) = run(&mut search, wants, fitted, |_| 0.0);
    (asked, found)
}

#[test]
fn contacts_side_by_side_are_tried_as_one() {
    let row_m = [[0.0, 0.0], [0.006, 0.0], [0.012, 0.0]];
    let is_one = |scene: &&Scene| scene.count == 1;
    let (asked, found) = others_of(&row_m, 0, 235.0);
    let one = asked.iter().find(is_one).unwrap().spots[0];
    assert!((one.at_m[0] - 0.006).abs() < 1e-6 && one.at_m[1] == 0.0 && found.unwrap().scene.count == 1, "{one:?}");
    // Of as much resistance as the three beside each other, and a disc of as much second moment: the square of its radius, in usual ones, is one and twice the mean of 2.4 squared, none and that.
    let three = spot(0.0, 0.0, 1.0).ln_ohm - 3.0_f32.ln();
    assert!((one.ln_ohm - three).abs() < 1e-4 && (one.ln_radius - 0.5 * 8.68_f32.ln()).abs() < 1e-4, "{one:?}");
    // It is not better; two are left to be left out, and one is too far.
    assert_eq!(others_of(&row_m, 0, 400.0).1.unwrap().scene.count, 3);
    assert!(!others_of(&row_m[..2], 0, 235.0).0.iter().any(|scene| is_one(&scene)));
    assert!(!others_of(&[[0.0, 0.0], [0.006, 0.0], [0.02, 0.0]], 0, 235.0).0.iter().any(|scene| is_one(&scene)));
}

#[test]
fn contacts_that_are_placed_badly_are_tried_beyond_the_ridge_before_a_wall() {
    let near_m = [[0.001, 0.028]];
    let moved =
        |loose: u32| others_of(&near_m, loose, 0.0).0.iter().map(|scene| scene.spots[0].at_m[1]).collect::<Vec<_>>();
    assert!(moved(0).iter().all(|y_m| *y_m == 0.028));
    assert!(moved(1).iter().any(|y_m| (y_m - 0.022).abs() < 1e-6), "{:?}", moved(1));
}
