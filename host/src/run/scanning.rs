//! Which rows the board is asked to scan: whole frames, some grounds, or those that tell most of what touches at the moment.
//!
//! A wire carries so many rows a second, whatever they are. While nothing touches two grounds see a touch come, wherever it is; then the
//! grounds that tell most of the contacts that are there are scanned most, and all others in turn, for what is new. Where the answer is
//! no contact, but a line, a ring or an image, whole frames are scanned.

use std::fmt;
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use tactomo_physics::detector::Detector;
use tactomo_protocol::{MAX_PLAN_ROWS, Plan, Settings};

/// Rows of a frame of an adaptive plan: 1400 frames/s at 921600 baud, where one row would be 2100 and tell each time of one ground alone.
const ROWS: usize = 2;
/// Rows from one of the others to the next, at least: what is new is seen within 25 ms.
const OTHERS: usize = 4;
/// Grounds that are told apart in one plan.
const FOCUS: usize = 3;
/// Time between two plans, at least: to take one over costs the board a millisecond or two.
const PAUSE: Duration = Duration::from_millis(40);
/// The same where a touch comes or goes.
const SHORT_PAUSE: Duration = Duration::from_millis(5);
/// Rows of a frame of a list, at most.
const LIST_ROWS: usize = 8;

/// What to scan.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum ScanChoice {
    /// All electrodes under every ground.
    #[default]
    Whole,
    /// All electrodes under four grounds, as in the paper's second demonstration.
    Four,
    /// What tells most at the moment.
    Adaptive,
    /// All electrodes under these grounds, in this order.
    Grounds(Vec<u8>),
}

impl FromStr for ScanChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "whole" => return Ok(Self::Whole),
            "four" => return Ok(Self::Four),
            "adaptive" => return Ok(Self::Adaptive),
            _ => {}
        }
        let wrong = || {
            format!(
                "`{text}` is no scan: choose whole, four, adaptive, or a list of electrodes to ground such as 0,5,10,15"
            )
        };
        let grounds: Vec<u8> =
            text.split(',').map(|ground| ground.trim().parse().map_err(|_| wrong())).collect::<Result<_, _>>()?;
        match grounds.len() {
            1..=MAX_PLAN_ROWS => Ok(Self::Grounds(grounds)),
            count => Err(format!("{count} grounds: a plan has {MAX_PLAN_ROWS} at most")),
        }
    }
}

impl fmt::Display for ScanChoice {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Whole => formatter.write_str("whole"),
            Self::Four => formatter.write_str("four"),
            Self::Adaptive => formatter.write_str("adaptive"),
            Self::Grounds(grounds) => {
                let grounds: Vec<String> = grounds.iter().map(u8::to_string).collect();
                formatter.write_str(&grounds.join(","))
            }
        }
    }
}

impl ScanChoice {
    /// Checks that a detector has the electrodes.
    ///
    /// # Errors
    /// Which one it does not have.
    pub fn check(&self, electrodes: usize) -> Result<(), String> {
        let Self::Grounds(grounds) = self else { return Ok(()) };
        match grounds.iter().find(|ground| usize::from(**ground) >= electrodes) {
            Some(ground) => {
                Err(format!("there is no electrode {ground} to ground: the detector has 0 to {}", electrodes - 1))
            }
            None => Ok(()),
        }
    }
}

/// Share of the frames that the line has no room for from which each reading is the mean of twice as many conversions: the converters have
/// time for them. Then as many come, with half the variance.
const CROWDED: f64 = 0.5;
/// Frames in which that share is counted.
const COUNTED: u64 = 400;
/// Doublings at most.
const MOST_DOUBLINGS: u8 = 2;

/// The plan that is wanted, on its way from the follower to the reader, and how the line fares with it.
#[derive(Debug, Default)]
pub(super) struct PlanWish {
    wanted: Mutex<Option<Plan>>,
    refused: AtomicBool,
    /// Frames that came, and those that the line had no room for.
    came: AtomicU64,
    dropped: AtomicU64,
}

impl PlanWish {
    fn put(&self, plan: Plan) {
        *self.wanted.lock().unwrap_or_else(PoisonError::into_inner) = Some(plan);
    }

    /// The plan that was put since the last call, if one was.
    pub fn take(&self) -> Option<Plan> {
        self.wanted.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// Counts a frame of rows that came after so many were dropped.
    pub fn count(&self, dropped: u64) {
        self.came.fetch_add(1, Ordering::Relaxed);
        self.dropped.fetch_add(dropped, Ordering::Relaxed);
    }

    /// Whether the line has no room for half of the frames, once enough were counted.
    fn is_crowded(&self) -> bool {
        let [came, dropped] = [&self.came, &self.dropped].map(|count| count.load(Ordering::Relaxed));
        if came + dropped < COUNTED {
            return false;
        }
        self.came.store(0, Ordering::Relaxed);
        self.dropped.store(0, Ordering::Relaxed);
        dropped as f64 > CROWDED * (came + dropped) as f64
    }

    /// The board takes no plan, or does again.
    pub fn set_refused(&self, refused: bool) {
        self.refused.store(refused, Ordering::Relaxed);
    }
}

/// Chooses plans.
pub(super) struct Planner {
    choice: ScanChoice,
    /// The grounds of the last plan, and when it was chosen.
    last: Option<(Focus, Instant)>,
    /// Doublings of the conversions for a reading.
    doublings: u8,
}

/// What a plan is about.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Focus {
    Whole,
    /// Nothing touches, or something that these grounds tell of.
    Rest(Vec<usize>),
    Touch(Vec<usize>),
}

impl Planner {
    pub fn new(choice: ScanChoice) -> Self {
        Self { choice, last: None, doublings: 0 }
    }

    /// Begins anew, as with another board.
    pub fn restart(&mut self) {
        (self.last, self.doublings) = (None, 0);
    }

    /// Wishes a plan, if it is time for another: `telling` are the grounds that tell most, so many as they are asked for, and
    /// `touches` is whether anything touches, `conversions` how many a reading is the mean of by the settings.
    pub fn consider(
        &mut self,
        wish: &PlanWish,
        detector: &Detector,
        (touches, conversions): (bool, u32),
        telling: impl FnOnce(usize) -> Option<Vec<usize>>,
    ) {
        if self.choice == ScanChoice::Whole || wish.refused.load(Ordering::Relaxed) {
            return;
        }
        let now = Instant::now();
        let was_touched = self.last.as_ref().is_some_and(|(focus, _)| !matches!(focus, Focus::Rest(_)));
        let pause = if was_touched == touches { PAUSE } else { SHORT_PAUSE };
        let is_due = self.last.as_ref().is_none_or(|(_, at)| now.saturating_duration_since(*at) >= pause);
        if !is_due || self.choice != ScanChoice::Adaptive && self.last.is_some() {
            return;
        }
        let electrodes = detector.electrodes.len();
        let focus = match &self.choice {
            ScanChoice::Whole => Focus::Whole,
            ScanChoice::Four => Focus::Touch(spread(detector, 4)),
            ScanChoice::Grounds(grounds) => Focus::Touch(grounds.iter().map(|ground| usize::from(*ground)).collect()),
            ScanChoice::Adaptive => match (telling(FOCUS), touches) {
                (None, _) => Focus::Whole,
                (Some(grounds), true) => Focus::Touch(sorted(grounds)),
                (Some(grounds), false) => Focus::Rest(sorted(grounds)),
            },
        };
        let doubles = self.doublings < MOST_DOUBLINGS && wish.is_crowded();
        self.doublings += u8::from(doubles);
        let is_new = self.last.as_ref().is_none_or(|(last, _)| *last != focus);
        if is_new || doubles {
            let plan = match (&self.choice, &focus) {
                (_, Focus::Whole) => Plan::default(),
                (ScanChoice::Adaptive, Focus::Rest(grounds) | Focus::Touch(grounds)) => adaptive(grounds, electrodes),
                (_, Focus::Rest(grounds) | Focus::Touch(grounds)) => listed(grounds, electrodes),
            };
            let average_log2 = conversions.max(1).ilog2() as u8 + self.doublings;
            let average_log2 = if plan.is_whole() { 0 } else { average_log2.min(Settings::MAX_AVERAGE_LOG2) };
            wish.put(Plan { average_log2, ..plan });
        }
        self.last = Some((focus, now));
    }
}

/// The same grounds in another order are the same plan.
fn sorted(mut grounds: Vec<usize>) -> Vec<usize> {
    grounds.sort_unstable();
    grounds
}

/// Electrodes that are far apart: each the one farthest from those before, from a corner on.
fn spread(detector: &Detector, count: usize) -> Vec<usize> {
    let pads = &detector.electrodes;
    let apart_m = |a: usize, b: usize| (pads[a].x_m - pads[b].x_m).hypot(pads[a].y_m - pads[b].y_m);
    let mut chosen: Vec<usize> = (0..pads.len())
        .max_by(|a, b| {
            let from_middle_m = |pad: &usize| pads[*pad].x_m.hypot(pads[*pad].y_m);
            from_middle_m(a).total_cmp(&from_middle_m(b))
        })
        .into_iter()
        .collect();
    while chosen.len() < count.min(pads.len()) {
        let nearest_m = |pad: &usize| chosen.iter().map(|other| apart_m(*pad, *other)).fold(f64::INFINITY, f64::min);
        let Some(next) = (0..pads.len()).max_by(|a, b| nearest_m(a).total_cmp(&nearest_m(b))) else { break };
        chosen.push(next);
    }
    chosen.sort_unstable();
    chosen
}

/// A plan of these grounds, round and round.
fn listed(grounds: &[usize], electrodes: usize) -> Plan {
    let rows_a_frame =
        (1..=LIST_ROWS.min(electrodes)).rev().find(|rows| grounds.len().is_multiple_of(*rows)).unwrap_or(1);
    plan(grounds.iter().copied(), rows_a_frame, electrodes)
}

/// A plan of these grounds, and all others in turn.
fn adaptive(focus: &[usize], electrodes: usize) -> Plan {
    let between = OTHERS.min(MAX_PLAN_ROWS / electrodes.max(1)).max(2);
    let mut next = focus.iter().copied().cycle();
    let rows = (0..electrodes * between).filter_map(|row| match row % between {
        last if last + 1 == between => Some(row / between),
        _ => next.next(),
    });
    let rows: Vec<usize> = rows.collect();
    let rows_a_frame = if rows.len().is_multiple_of(ROWS) { ROWS } else { 1 };
    plan(rows.into_iter(), rows_a_frame, electrodes)
}

fn plan(grounds: impl Iterator<Item = usize>, rows_a_frame: usize, electrodes: usize) -> Plan {
    Plan {
        grounds: grounds.take(MAX_PLAN_ROWS).filter_map(|ground| u8::try_from(ground).ok()).collect(),
        reads: u32::MAX >> (u32::BITS as usize - electrodes.clamp(1, u32::BITS as usize)),
        rows_a_frame: rows_a_frame as u8,
        average_log2: 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn detector() -> Detector {
        Detector::preset(Detector::DEFAULT).unwrap()
    }

    #[test]
    fn choices_are_read_and_told_and_wrong_ones_explained() {
        for text in ["whole", "four", "adaptive", "3", "0,5,10,15"] {
            assert_eq!(text.parse::<ScanChoice>().unwrap().to_string(), text);
        }
        assert!("some".parse::<ScanChoice>().unwrap_err().contains("whole, four, adaptive"));
        assert!("1,,2".parse::<ScanChoice>().is_err());
        let wrong = ScanChoice::Grounds(vec![3, 16]).check(16).unwrap_err();
        assert!(wrong.contains("electrode 16") && wrong.contains("0 to 15"), "{wrong}");
    }

    #[test]
    fn plans_are_those_that_boards_take() {
        for electrodes in [4, 9, 16, 25, 32] {
            for focus in [vec![1, 2], vec![0, 1, 3]] {
                let plan = adaptive(&focus, electrodes);
                assert!(plan.is_valid(electrodes as u8), "{electrodes}: {plan:?}");
                let all = (0..electrodes as u8).all(|ground| plan.grounds.contains(&ground));
                assert!(all, "{electrodes}: every ground has its turn");
            }
            assert!(listed(&[0, 3, 1], electrodes).is_valid(electrodes as u8));
        }
        let of_16 = adaptive(&[5, 10], 16);
        assert_eq!((&of_16.grounds[..8], of_16.rows_a_frame), (&[5, 10, 5, 0, 10, 5, 10, 1][..], 2));
    }

    #[test]
    fn the_four_are_the_corners() {
        assert_eq!(spread(&detector(), 4), [0, 3, 12, 15]);
    }

    #[test]
    fn a_plan_is_wished_when_what_touches_has_changed() {
        let (wish, detector) = (PlanWish::default(), detector());
        let mut planner = Planner::new(ScanChoice::Adaptive);
        planner.consider(&wish, &detector, (false, 1), |_| Some(vec![5, 10]));
        let at_rest = wish.take().unwrap();
        planner.consider(&wish, &detector, (false, 1), |_| Some(vec![6, 9]));
        assert_eq!(wish.take(), None, "too soon");
        std::thread::sleep(SHORT_PAUSE);
        planner.consider(&wish, &detector, (true, 1), |count| Some(vec![1; count]));
        let touched = wish.take().unwrap();
        assert!(touched != at_rest && touched.grounds[..3] == [1, 1, 1]);
        std::thread::sleep(PAUSE);
        planner.consider(&wish, &detector, (true, 1), |_| None);
        assert!(wish.take().unwrap().is_whole(), "an image takes whole frames");
        wish.set_refused(true);
        std::thread::sleep(PAUSE);
        planner.consider(&wish, &detector, (false, 1), |_| Some(vec![5, 10]));
        assert_eq!(wish.take(), None);
    }

    #[test]
    fn a_line_without_room_makes_readings_means_of_more() {
        let (wish, detector) = (PlanWish::default(), detector());
        let mut planner = Planner::new(ScanChoice::Adaptive);
        let mut averages = Vec::new();
        for dropped in [0, 2, 2, 2, 0] {
            (0..COUNTED).for_each(|_| wish.count(dropped));
            planner.consider(&wish, &detector, (true, 1), |_| Some(vec![5, 10]));
            averages.extend(wish.take().map(|plan| plan.average_log2));
            std::thread::sleep(PAUSE);
        }
        assert_eq!(averages, [0, 1, 2], "no more, and never fewer");
    }

    #[test]
    fn whole_frames_are_nothing_to_ask_for() {
        let wish = PlanWish::default();
        Planner::new(ScanChoice::Whole).consider(&wish, &detector(), (true, 1), |_| Some(vec![1, 2]));
        assert_eq!(wish.take(), None);
    }
}
