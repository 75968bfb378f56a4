//! The states that the page can be in, made up: for pictures of them, and for what must hold in all of them.

use std::sync::Arc;

use anyhow::Result;
use tactomo::board::link::Playing;
use tactomo::board::record::Loss;
use tactomo::calibrate::Rub;
use tactomo::detector::Detector;
use tactomo::run::calibration::{Calibrating, Compared, Coverage, Stage as Step, Target};
use tactomo::run::{LinkState, Snapshot};
use tactomo::scene::SceneName;
use tactomo::solve::{
    Alternative, Choice, Flags, FoundContact, FoundLine, FoundRing, FoundShape, Solution, Uncertainty,
};
use tactomo_protocol::Hello;

use crate::chromium::Page;
use crate::script::Script;

/// A state of the page.
pub struct State {
    /// Its name, as of a file.
    pub name: &'static str,
    /// What is to be seen, in a sentence.
    pub says: &'static str,
    /// What the page is told.
    set: fn(&Script),
    /// What a person has clicked, if anything, and clicks again to leave.
    click: Option<&'static str>,
    /// Whether the page is dark.
    dark: bool,
}

const fn state(name: &'static str, says: &'static str, set: fn(&Script)) -> State {
    State { name, says, set, click: None, dark: false }
}

/// All of them.
pub const STATES: [State; 18] = [
    state("waiting", "No board yet. The page says what it waits for, and what to check.", |script| {
        script.set(|snapshot| {
            *snapshot = Snapshot { link: LinkState::Searching, playing: Playing::Board, ..Snapshot::default() };
        });
    }),
    state("nothing", "Frames come, and nothing touches.", |script| script.solution(Solution::default())),
    state("one", "One contact: how firm and where, in the picture, in the table and over time.", |script| {
        script.solution(sure(vec![contact(1, [9.0, -6.0], 2.4e-4)]));
    }),
    State {
        dark: true,
        ..state("one-dark", "The same in dark colours.", |script| {
            script.solution(sure(vec![contact(1, [9.0, -6.0], 2.4e-4)]));
        })
    },
    state("several", "Several contacts, each with its number and colour.", |script| script.solution(hand())),
    State { dark: true, ..state("several-dark", "The same in dark colours.", |script| script.solution(hand())) },
    State {
        click: Some("view-space"),
        ..state("space", "In 3-D: height is pressure.", |script| script.solution(hand()))
    },
    state("line", "A line: its ends are in the table.", |script| {
        let line = FoundLine {
            from_m: [-18.0e-3, -6.0e-3],
            to_m: [15.0e-3, 12.0e-3],
            width_m: 4e-3,
            conductance_s: 9e-4,
            uncertainty: None,
        };
        script.solution(Solution { shape: Some(FoundShape::Line(line)), ..Solution::default() });
    }),
    state("ring", "A ring: its middle is in the table.", |script| {
        let ring = FoundRing {
            centre_m: [4e-3, -3e-3],
            radius_m: 11e-3,
            width_m: 3e-3,
            conductance_s: 9e-4,
            uncertainty: None,
        };
        script.solution(Solution { shape: Some(FoundShape::Ring(ring)), ..Solution::default() });
    }),
    state("uncertain", "The readings allow two answers: both are named.", |script| {
        let alternative = Some(Alternative { contacts: 3, certainty: 0.3 });
        script.solution(Solution { certainty: Some(0.66), alternative, ..sure(hand().contacts[..4].to_vec()) });
    }),
    state("looking", "Something has just touched, and is still searched for.", |script| {
        let choice = Some(Choice { what: "searching".to_owned(), why: String::new() });
        script.patch([-6.0, 8.0], 3.0);
        script.set(|snapshot| {
            if let Some(answer) = &mut snapshot.answer {
                Arc::make_mut(answer).solution.choice = choice;
            }
        });
    }),
    state("electrode", "A broken wire: its electrode is crossed out, and left out.", |script| {
        let flags = Flags { excluded: vec![3], ..Flags::default() };
        script.solution(Solution { flags, ..sure(vec![contact(1, [9.0, -6.0], 2.4e-4)]) });
    }),
    state("notice", "A notice of the program, in one line on top.", |script| {
        script.solution(sure(vec![contact(1, [9.0, -6.0], 2.4e-4)]));
        script.set(|snapshot| {
            snapshot.refused.control =
                Some("Not re-zeroed: something presses. Let go of the sensor, and try again.".to_owned())
        });
    }),
    state("lost", "The link is lost: the last answer is pale, and the page says that it tries again.", |script| {
        script.solution(hand());
        script.set(|snapshot| snapshot.link = LinkState::Lost("/dev/ttyUSB0 is gone".to_owned()));
    }),
    state("recording", "A recording, played.", |script| {
        script.solution(hand());
        script.set(|snapshot| snapshot.playing = played());
    }),
    state(
        "calibrating",
        "Calibrating: where to press next and how hard, and what has been pressed so far.",
        |script| {
            script.solution(sure(vec![contact(1, [-8.0, 12.0], 2.4e-4)]));
            script.set(|snapshot| snapshot.calibrating = Some(Arc::new(calibrating())));
        },
    ),
    state("calibrated", "A new calibration that is better on presses set aside, so it is recommended.", |script| {
        script.set(|snapshot| snapshot.calibrating = Some(Arc::new(calibrated())));
    }),
    state("kept", "A new calibration that is no better: the page says to keep the present one, and why.", |script| {
        script.set(|snapshot| snapshot.calibrating = Some(Arc::new(kept())));
    }),
];

impl State {
    /// Brings the page there.
    pub async fn enter(&self, script: &Script, page: &Page) -> Result<()> {
        script.set(|snapshot| {
            *snapshot = Snapshot {
                link: LinkState::Streaming,
                hello: Some(Hello { adc_full_scale_mv: 2000, ..Hello::example(16) }),
                playing: Playing::Simulated { scene: SceneName::Rest, faults: Vec::new() },
                ..Snapshot::default()
            };
            snapshot.statistics.frames_per_s = 428.0;
            snapshot.statistics.solved_per_s = 428.0;
            (snapshot.statistics.age.p50, snapshot.statistics.age.p99) = (810.0, 2300.0);
        });
        script.solution(Solution::default());
        (self.set)(script);
        page.theme(if self.dark { "dark" } else { "light" }).await?;
        if let Some(click) = self.click {
            page.click(click).await?;
        }
        Ok(())
    }

    /// Leaves what a person has opened.
    pub async fn leave(&self, page: &Page) -> Result<()> {
        match self.click {
            Some("view-space") => page.click("view-flat").await,
            _ => Ok(()),
        }
    }
}

fn contact(id: u32, [x_mm, y_mm]: [f64; 2], conductance_s: f64) -> FoundContact {
    let flat = FoundContact::flat(x_mm * 1e-3, y_mm * 1e-3, conductance_s);
    FoundContact { id: Some(id), apparent_conductance_s: Some(0.8 * conductance_s), ..flat }
}

fn sure(contacts: Vec<FoundContact>) -> Solution {
    Solution { contacts, residual: Some(1.0), certainty: Some(0.99), ..Solution::default() }
}

/// Five fingertips of a hand: firm and light, one of them blurred.
fn hand() -> Solution {
    let tips = [[-18.0, -12.0], [-12.0, 10.0], [-1.0, 16.0], [9.0, 13.0], [18.0, 3.0]];
    let firmness = [8e-4, 3e-4, 6e-4, 1.2e-4, 3e-5];
    let errors = Uncertainty { x_m: 0.0015, y_m: 0.0008, correlation: 0.4, conductance_s: 4e-6 };
    let mut contacts: Vec<_> = (1..).zip(tips).zip(firmness).map(|((id, tip), s)| contact(id, tip, s)).collect();
    contacts[4].uncertainty = Some(errors);
    contacts[0].radius_m = Some(0.005);
    sure(contacts)
}

fn played() -> Playing {
    Playing::Recording {
        position_s: 7.4,
        length_s: 20.0,
        speed: 0.5,
        paused: false,
        looped: true,
        ended: false,
        damage: Loss::default(),
    }
}

/// A calibration half-way: the left part of the sensor was pressed firmly, some of that lightly too.
fn calibrating() -> Calibrating {
    let cells = 12;
    let felt = |cell: usize| match (cell % cells, cell / cells) {
        (column, row) if column < 4 && row > 5 => 3,
        (column, _) if column < 6 => 2,
        _ => 0,
    };
    Calibrating {
        stage: Step::Rubbing,
        coverage: Coverage {
            cells: [cells; 2],
            bounds_m: [[-0.03; 2], [0.03; 2]],
            felt: (0..cells * cells).map(|cell| Some(felt(cell))).collect(),
        },
        target: Some(Target { at_m: [7.5e-3, 12.5e-3], firm: true }),
        touched: 4210,
        fitting: true,
        errors_m: vec![0.92e-3, 0.61e-3, 0.38e-3],
        fit: Some(Arc::new(rub(0.38e-3))),
        compared: None,
        keep: None,
        trouble: None,
        saved: None,
        used: false,
    }
}

fn calibrated() -> Calibrating {
    let mut done = calibrating();
    done.coverage.felt.fill(Some(3));
    done.errors_m.extend([0.24e-3, 0.19e-3]);
    Calibrating {
        stage: Step::Done,
        target: None,
        fitting: false,
        fit: Some(Arc::new(rub(0.19e-3))),
        compared: Some(Compared { presses: 24, residuals: [4.6, 1.0], place_errors_m: [0.92e-3, 0.19e-3] }),
        ..done
    }
}

fn kept() -> Calibrating {
    let why = "The new calibration explains presses that were set aside worse than the one in use. To do better: press harder now and then: \
               hardly a press was firm.";
    let compared = Compared { presses: 24, residuals: [1.0, 1.4], place_errors_m: [0.21e-3, 0.26e-3] };
    let errors_m = vec![0.92e-3, 0.61e-3, 0.38e-3, 0.28e-3, 0.26e-3];
    Calibrating { errors_m, compared: Some(compared), keep: Some(why.to_owned()), ..calibrated() }
}

/// A fit whose expected error is this in the middle (m), and five times as large at the corners.
fn rub(error_m: f64) -> Rub {
    let along = |i: i32| 0.008 * f64::from(i - 3);
    let places = (0..49).map(|i| [along(i % 7), along(i / 7)]);
    let place_errors_m = places.map(|[x, y]| ([x, y], error_m * (0.8 + 4.0 * (x * y / 0.000576).abs()))).collect();
    Rub {
        detector: Detector::default(),
        wires: None,
        left_out: Vec::new(),
        touched: 4210,
        single: 4000,
        presses: 60,
        known: 0,
        held_out: None,
        missing: Vec::new(),
        chi_square: [9.0, 1.0],
        place_errors_m,
    }
}
