//! What scan plans bring on an ESP32's budget, live: the whole program on a simulated ESP32 at its real pace.
//!
//! `cargo run --release --example scanning -- [moving|touch|rest|all] [SECONDS [SEED]]`, by default all for 8 s, seed 1.
//!
//! * `moving`: a contact that runs on a circle of 15 mm at 0.5 m/s, and one that stands. Mean distance of each answer from where the contact
//!   was in its frame, and from where it is when the answer is ready.
//! * `touch`: touches from rest, twice a second: time from the touch to the first answer with a contact.
//! * `rest`: nothing touches: answers with contacts, which are invented.

use std::error::Error;
use std::f64::consts::TAU;
use std::sync::{Arc, Mutex, OnceLock, mpsc};
use std::time::{Duration, Instant};

use nalgebra::DMatrix;
use tactomo::board::link::Opened;
use tactomo::board::simulated::{BoardModel, Options, SimulatedBoard};
use tactomo::detector::Detector;
use tactomo::forward::readings_v;
use tactomo::readings::Readings;
use tactomo::run::plan::{Ends, Plan, Solving, Summary};
use tactomo::run::scanning::ScanChoice;
use tactomo::run::{Listener, Snapshot, TouchEvent};
use tactomo::scene::Contact;
use tactomo::simulate::{Physics, finer_model};
use tactomo::solve::{Method, Problem};
use tokio::sync::watch;

const CIRCLE_M: f64 = 0.015;
/// Places on the circle whose impedances are made beforehand; between them they are interpolated.
const PLACES: usize = 240;
/// The scene begins with the first scan; answers count from here on (s).
const SETTLED_S: f64 = 0.5;
/// Touches from rest: how often, and for how long (s).
const EVERY_S: f64 = 0.5;
const TOUCHED_S: f64 = 0.2;

/// What presses.
#[derive(Clone, Copy, PartialEq)]
enum Course {
    Runs(f64),
    Touches,
    Rests,
}

/// A contact on a circle.
#[derive(Clone)]
struct Circle {
    detector: Detector,
    impedances_ohm: Arc<Vec<DMatrix<f64>>>,
    course: Course,
    /// When the scene has begun, with the first scan.
    begun: Arc<OnceLock<Instant>>,
}

impl Circle {
    /// The same with another course, from its beginning.
    fn on(&self, course: Course) -> Self {
        Self { course, begun: Arc::default(), ..self.clone() }
    }

    fn angle(&self, time_s: f64) -> f64 {
        match self.course {
            Course::Runs(speed_m_per_s) => speed_m_per_s * time_s / CIRCLE_M,
            // Each touch is elsewhere.
            Course::Touches | Course::Rests => 2.4 * (time_s / EVERY_S).floor(),
        }
    }

    fn place_m(&self, time_s: f64) -> [f64; 2] {
        let (sin, cos) = self.angle(time_s).sin_cos();
        [CIRCLE_M * cos, CIRCLE_M * sin]
    }

    fn touches(&self, time_s: f64) -> bool {
        match self.course {
            Course::Runs(_) => true,
            Course::Touches => time_s.rem_euclid(EVERY_S) > EVERY_S - TOUCHED_S,
            Course::Rests => false,
        }
    }
}

impl Physics for Circle {
    fn readings_v(&mut self, time_s: f64) -> Readings {
        self.begun.get_or_init(Instant::now);
        if !self.touches(time_s) {
            return Readings::from_fn(self.detector.electrodes.len(), |_, _| 0.0);
        }
        let place = (self.angle(time_s).rem_euclid(TAU) / TAU) * PLACES as f64;
        let (before, share) = (place as usize % PLACES, place.fract());
        let [a, b] = [before, (before + 1) % PLACES].map(|place| &self.impedances_ohm[place]);
        readings_v(&(a * (1.0 - share) + b * share), &self.detector)
    }
}

/// An answer: time of its frame and when it was ready, since the scene began (s), and where contacts are (m).
struct Answer {
    frame_s: f64,
    ready_s: f64,
    places_m: Vec<[f64; 2]>,
}

struct Keeper {
    begun: Instant,
    kept: Arc<Mutex<Vec<Answer>>>,
}

impl Listener for Keeper {
    fn touched(&mut self, event: &Arc<TouchEvent>) {
        let places_m = event.solution.contacts.iter().map(|contact| [contact.x_m, contact.y_m]).collect();
        let frame_s = event.time_s();
        let answer = Answer { frame_s, ready_s: self.begun.elapsed().as_secs_f64(), places_m };
        if let Ok(mut kept) = self.kept.lock() {
            kept.push(answer);
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let argument = |index: usize| std::env::args().nth(index);
    let what = argument(1).unwrap_or_else(|| "all".to_owned());
    let seconds: f64 = argument(2).map_or(Ok(8.0), |text| text.parse())?;
    let seed: u64 = argument(3).map_or(Ok(1), |text| text.parse())?;
    let adc = BoardModel::Esp32.adc(Detector::default().adc);
    let detector = Detector { adc, ..Detector::preset(Detector::DEFAULT).ok_or("no preset")?.taken_as_exact() };
    let fine = finer_model(&detector, &[], seed)?;
    let contact = |place: usize| {
        let (sin, cos) = (TAU * place as f64 / PLACES as f64).sin_cos();
        Contact::flat(CIRCLE_M * cos, CIRCLE_M * sin, 0.0025, 0.6 * detector.sheet_conductance_s())
    };
    let impedances_ohm = (0..PLACES).map(|place| fine.impedance_ohm(&[contact(place)])).collect::<Result<_, _>>()?;
    let circle = Circle {
        detector: detector.clone(),
        impedances_ohm: Arc::new(impedances_ohm),
        course: Course::Rests,
        begun: Arc::default(),
    };
    let problem = Problem::of(&detector)?;
    for scan in ["whole", "four", "adaptive"] {
        let scan: ScanChoice = scan.parse()?;
        let run = |circle: &Circle| run(&problem, circle, &scan, seconds, seed);
        if matches!(&*what, "moving" | "all") {
            for speed_m_per_s in [0.0, 0.05, 0.5] {
                let circle = circle.on(Course::Runs(speed_m_per_s));
                let (answers, summary) = run(&circle)?;
                moving(&scan, speed_m_per_s, &circle, &answers, &summary);
            }
        }
        if matches!(&*what, "touch" | "all") {
            let circle = circle.on(Course::Touches);
            let (answers, _) = run(&circle)?;
            touches(&scan, &circle, &answers);
        }
        if matches!(&*what, "rest" | "all") {
            let (answers, _) = run(&circle.on(Course::Rests))?;
            let invented = answers.iter().filter(|answer| !answer.places_m.is_empty()).count();
            println!("{scan:<10} at rest for {seconds} s: {} answers, {invented} of them with contacts", answers.len());
        }
    }
    Ok(())
}

fn run(
    problem: &Problem,
    circle: &Circle,
    scan: &ScanChoice,
    seconds: f64,
    seed: u64,
) -> Result<(Vec<Answer>, Summary), Box<dyn Error>> {
    let detector = circle.detector.clone();
    let kept = Arc::new(Mutex::new(Vec::new()));
    let options = Options { seed, model: BoardModel::Esp32 };
    let begun = Instant::now();
    let board = SimulatedBoard::start(&detector, Box::new(circle.clone()), options)?;
    let plan = Plan {
        solving: Some(Solving::new(Method::Auto, problem.clone())),
        scan: scan.clone(),
        listeners: vec![Box::new(Keeper { begun, kept: Arc::clone(&kept) })],
        seconds: Some(Duration::from_secs_f64(seconds)),
        ..Plan::new(detector)
    };
    let (snapshots, _page) = watch::channel(Arc::new(Snapshot::default()));
    let (_requests, requests) = mpsc::sync_channel(1);
    let ends = Ends { snapshots, requests, stop: Arc::default() };
    let summary = tactomo::run::run(&mut Opened::new(Box::new(board)), plan, ends)?;
    let mut kept = kept.lock().map_err(|_| "a listener has panicked")?;
    // The board's clock begins as it is started, the scene with the first scan.
    let first_s = circle.begun.get().map_or(0.0, |first| (*first - begun).as_secs_f64());
    let mut answers = std::mem::take(&mut *kept);
    for answer in &mut answers {
        (answer.frame_s, answer.ready_s) = (answer.frame_s - first_s, answer.ready_s - first_s);
    }
    Ok((answers, summary))
}

fn moving(scan: &ScanChoice, speed_m_per_s: f64, circle: &Circle, answers: &[Answer], summary: &Summary) {
    let counted: Vec<&Answer> = answers.iter().filter(|answer| answer.frame_s > SETTLED_S).collect();
    let single: Vec<&&Answer> = counted.iter().filter(|answer| answer.places_m.len() == 1).collect();
    let off_mm = |answer: &Answer, time_s: f64| {
        let ([x_m, y_m], found) = (circle.place_m(time_s), answer.places_m[0]);
        1e3 * (found[0] - x_m).hypot(found[1] - y_m)
    };
    let mean =
        |off: &dyn Fn(&Answer) -> f64| single.iter().map(|answer| off(answer)).sum::<f64>() / single.len() as f64;
    let span_s = counted.last().map_or(0.0, |last| last.frame_s) - counted.first().map_or(0.0, |first| first.frame_s);
    println!(
        "{:<10} {speed_m_per_s} m/s: {:.0} answers/s, age p99 {:.2} ms; one contact in {:.1} %; off by {:.3} mm in its frame, {:.3} mm when it is ready",
        scan.to_string(),
        counted.len() as f64 / span_s,
        1e-3 * summary.age_us.p99,
        100.0 * single.len() as f64 / counted.len().max(1) as f64,
        mean(&|answer| off_mm(answer, answer.frame_s)),
        mean(&|answer| off_mm(answer, answer.ready_s)),
    );
}

fn touches(scan: &ScanChoice, circle: &Circle, answers: &[Answer]) {
    let last_s = answers.last().map_or(0.0, |answer| answer.ready_s);
    let mut delays_ms = Vec::new();
    let mut wrong = 0;
    for touch in 1..(last_s / EVERY_S) as usize {
        let begins_s = EVERY_S * touch as f64 + EVERY_S - TOUCHED_S;
        let since = |answer: &&Answer| answer.ready_s > begins_s && answer.ready_s < begins_s + TOUCHED_S;
        if let Some(seen) = answers.iter().filter(since).find(|answer| !answer.places_m.is_empty()) {
            delays_ms.push(1e3 * (seen.ready_s - begins_s));
            let [x_m, y_m] = circle.place_m(begins_s);
            wrong += usize::from((seen.places_m[0][0] - x_m).hypot(seen.places_m[0][1] - y_m) > 2e-3);
        }
    }
    delays_ms.sort_by(f64::total_cmp);
    let at = |share: f64| delays_ms.get((share * (delays_ms.len() as f64 - 1.0)) as usize).copied().unwrap_or(f64::NAN);
    println!(
        "{:<10} {} touches from rest: seen after {:.2} ms (median), {:.2} ms (most); {wrong} first answers more than 2 mm off",
        scan.to_string(),
        delays_ms.len(),
        at(0.5),
        at(1.0)
    );
}
