//! What the page has to say goes when its cause goes.

use std::time::Duration;

use anyhow::{Context, Result, ensure};
use serde_json::Value;
use tactomo::board::link::Playing;
use tactomo::board::record::Loss;
use tactomo::run::{LinkState, Snapshot, SolverState};
use tactomo::solve::{Flags, FoundContact, Method, Solution};

use crate::script::Script;
use crate::stage::in_front_of;

/// A cause: what a snapshot then has, and what is said of it.
type Cause = (&'static str, fn(&mut Snapshot));

const CAUSES: [Cause; 8] = [
    ("no space left", |snapshot| snapshot.refused.recording = Some("no space left".to_owned())),
    ("the board refuses this settle time", |snapshot| {
        snapshot.refused.settings = Some("the board refuses this settle time".to_owned());
    }),
    ("no such scene", |snapshot| snapshot.refused.control = Some("no such scene".to_owned())),
    ("This method cannot be used: no mesh", |snapshot| {
        let refused = Some("no mesh".to_owned());
        snapshot.solver = Some(SolverState { method: Method::Auto, making: None, refused });
    }),
    ("Something pressed at the start.", |snapshot| {
        snapshot.baseline = Some("Something pressed at the start.".to_owned());
    }),
    ("Press with one finger.", |snapshot| snapshot.wires = Some("Press with one finger.")),
    ("Calibrated on another board.", |snapshot| {
        snapshot.calibration = Some("Calibrated on another board.".to_owned());
    }),
    ("Recording to touch.tactomo", |snapshot| snapshot.recording = Some("touch.tactomo".into())),
];

#[test]
fn a_notice_goes_with_its_cause_and_leaves_the_next_one_to_be_read() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let hidden = "return document.getElementById('notice').hidden";
        for (words, cause) in CAUSES {
            let mut before = Snapshot::default();
            stage.behind.set(|snapshot| {
                before = snapshot.clone();
                cause(snapshot);
            });
            stage.browser.says("notice-text", words).await?;
            ensure!(stage.browser.run(hidden).await? == false, "{words}: it is there, and hidden");
            stage.behind.set(|snapshot| *snapshot = before);
            stage.browser.shows(hidden, |hidden| *hidden == true).await.context(words)?;
        }
        // All at once: each is there once those before it are gone.
        let mut causes = CAUSES.to_vec();
        stage.behind.set(|snapshot| causes.iter().for_each(|(_, cause)| cause(snapshot)));
        while let Some((words, _)) = causes.first() {
            stage.browser.says("notice-text", words).await?;
            causes.remove(0);
            stage.behind.set(|snapshot| {
                let all = std::mem::take(snapshot);
                (snapshot.link, snapshot.answer) = (all.link, all.answer);
                causes.iter().for_each(|(_, cause)| cause(snapshot));
            });
        }
        stage.browser.shows(hidden, |hidden| *hidden == true).await.map(drop)
    })
}

#[test]
fn damage_is_told_of_the_recording_that_has_it() -> Result<()> {
    let playing = |damage| Playing::Recording {
        position_s: 1.0,
        length_s: 9.0,
        speed: 1.0,
        paused: false,
        looped: false,
        ended: false,
        damage,
    };
    in_front_of(Script::start, async |stage| {
        let damage = Loss { damaged_places: 2, left_out_bytes: 90, ..Loss::default() };
        stage.behind.set(|snapshot| snapshot.playing = playing(damage));
        let notice = "return document.getElementById('notice-text').textContent";
        stage
            .browser
            .shows(notice, |words| words.as_str().is_some_and(|words| words.contains("damaged in 2 places")))
            .await?;
        stage.behind.set(|snapshot| snapshot.playing = playing(Loss::default()));
        stage.browser.says("notice-text", "").await
    })
}

#[test]
fn an_electrode_that_is_mended_is_no_longer_crossed_out() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let answer = |excluded| {
            let flags = Flags { excluded, ..Flags::default() };
            Solution { contacts: vec![FoundContact::flat(0.005, 0.0, 2e-4)], flags, ..Solution::default() }
        };
        stage.behind.solution(answer(vec![3]));
        stage.browser.says("warnings", "electrode 3 left out").await?;
        stage.behind.solution(answer(Vec::new()));
        stage.browser.says("warnings", "").await?;
        stage.browser.until("no electrode crossed out", |told| told.text("excluded").is_empty()).await.map(drop)
    })
}

#[test]
fn a_link_that_is_back_is_live_and_its_answer_no_longer_the_last() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let certainty = Some(0.99);
        let contacts = vec![FoundContact::flat(0.005, 0.0, 2e-4)];
        stage.behind.solution(Solution { contacts, certainty, ..Solution::default() });
        stage.browser.says("sure", "sure of the number (99 %)").await?;
        let mut answer = None;
        stage.behind.set(|snapshot| {
            answer = snapshot.answer.take();
            snapshot.link = LinkState::Lost("it was unplugged".to_owned());
        });
        stage.browser.says("sure", "the last answer").await?;
        stage.browser.until("a lost link", |told| told.text("state") == "lost").await?;
        stage.behind.set(|snapshot| (snapshot.link, snapshot.answer) = (LinkState::Streaming, answer));
        stage.browser.says("state-text", "Live").await?;
        stage.browser.says("sure", "sure of the number (99 %)").await?;
        let stale = "return document.body.classList.contains('stale')";
        ensure!(stage.browser.run(stale).await? == false, "still pale");
        Ok(())
    })
}

#[test]
fn what_was_lost_long_ago_does_not_stand_out() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let warned = "return [...document.querySelectorAll('.figure.warning dt')].map((name) => name.textContent)";
        let lose = |dropped| stage.behind.set(|snapshot| snapshot.statistics.dropped = dropped);
        lose(2);
        stage.browser.shows(warned, |names| *names == serde_json::json!(["lost on the line"])).await?;
        // Nothing more is lost: it is calm again, and the count stays.
        tokio::time::sleep(Duration::from_secs(5)).await;
        stage.browser.shows(warned, |names| names.as_array().is_some_and(Vec::is_empty)).await?;
        let counts = stage.browser.told().await?.number("dropped");
        ensure!(counts == 2.0, "{counts} lost");
        lose(3);
        stage.browser.shows(warned, |names| *names != Value::Array(Vec::new())).await.map(drop)
    })
}

#[test]
fn a_program_that_is_gone_no_longer_says_that_it_records() -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let notice = "return document.getElementById('notice').hidden";
        stage.behind.set(|snapshot| snapshot.recording = Some("touch.tactomo".into()));
        stage.browser.shows(notice, |hidden| *hidden == false).await?;
        // As where the program has ended: its socket closes, and no other opens.
        let cut = "WebSocket.prototype.send = function () { this.close(); }; window.WebSocket = class { static OPEN = 1; constructor() { throw new Error('cut'); } }; return 0";
        stage.browser.run(cut).await?;
        stage.browser.until("the program is gone", |told| told.text("state") == "unreachable").await?;
        stage.browser.shows(notice, |hidden| *hidden == true).await.map(drop)
    })
}
