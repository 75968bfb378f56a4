//! Pictures of the page in many states, for whoever changes how it looks:
//! `TACTOMO_GALLERY=/tmp/gallery cargo test --release -p tactomo-tests --test page gallery`.

use std::path::Path;
use std::time::Duration;

use anyhow::{Context, Result};
use tactomo::board::link::Playing;
use tactomo::board::record::Loss;
use tactomo::run::{LinkState, Snapshot};
use tactomo::scene::SceneName;
use tactomo::solve::{Choice, Flags, FoundContact, Method, Solution, Uncertainty};

use crate::live::Live;
use crate::script::Script;
use crate::stage::{Stage, in_front_of};

fn contact(id: u32, [x_mm, y_mm]: [f64; 2], conductance_s: f64) -> FoundContact {
    FoundContact { id: Some(id), ..FoundContact::flat(x_mm * 1e-3, y_mm * 1e-3, conductance_s) }
}

/// Five fingertips of a hand.
fn hand() -> Solution {
    let tips = [[-18.0, -12.0], [-12.0, 10.0], [-1.0, 16.0], [9.0, 13.0], [18.0, 3.0]];
    let firmness = [8e-4, 3e-4, 6e-4, 1.2e-4, 3e-5];
    let errors = Uncertainty { x_m: 0.0015, y_m: 0.0008, correlation: 0.4, conductance_s: 4e-6 };
    let mut contacts: Vec<_> = (1..).zip(tips).zip(firmness).map(|((id, tip), s)| contact(id, tip, s)).collect();
    contacts[4].uncertainty = Some(errors);
    contacts[0].radius_m = Some(0.005);
    let choice = Choice { what: "5 contacts".to_owned(), why: "residual 1.0 x noise".to_owned() };
    Solution { contacts, residual: Some(1.0), choice: Some(choice), ..Solution::default() }
}

#[test]
fn gallery() -> Result<()> {
    let Some(folder) = std::env::var_os("TACTOMO_GALLERY") else { return Ok(()) };
    let folder = Path::new(&folder);
    std::fs::create_dir_all(folder)?;
    scripted(folder)?;
    solved(folder, SceneName::Ring, Method::Nonlinear, "ring-image")?;
    solved(folder, SceneName::Ring, Method::Auto, "ring")?;
    solved(folder, SceneName::Line, Method::Auto, "line")?;
    solved(folder, SceneName::FiveFingers, Method::Auto, "five-fingers")
}

fn scripted(folder: &Path) -> Result<()> {
    in_front_of(Script::start, async |stage| {
        let simulated = Playing::Simulated { scene: SceneName::FiveFingers, faults: Vec::new() };
        stage.behind.set(|snapshot| snapshot.playing = simulated);
        shot(stage, folder, "rest").await?;
        stage.behind.solution(hand());
        shot(stage, folder, "hand").await?;
        for (size, name) in
            [((1280, 760), "low"), ((390, 844), "phone"), ((820, 1100), "tablet"), ((1920, 1080), "wide")]
        {
            stage.browser.resize(size.0, size.1).await?;
            shot(stage, folder, name).await?;
        }
        stage.browser.resize(1280, 800).await?;
        stage.browser.click("view-space").await?;
        shot(stage, folder, "space").await?;
        stage.browser.theme("dark").await?;
        shot(stage, folder, "space-dark").await?;
        stage.browser.click("view-flat").await?;
        shot(stage, folder, "hand-dark").await?;
        stage.browser.theme("light").await?;
        states(stage, folder).await
    })
}

async fn states(stage: &Stage<Script>, folder: &Path) -> Result<()> {
    let flags = Flags { excluded: vec![3], misfit: true, ..Flags::default() };
    stage.behind.solution(Solution { flags, ..hand() });
    stage.behind.set(|snapshot| {
        snapshot.baseline = Some("Something pressed at the start: it is shown as the contact that it is.".to_owned());
    });
    shot(stage, folder, "excluded").await?;
    let playing = Playing::Recording {
        position_s: 7.4,
        length_s: 20.0,
        speed: 0.5,
        paused: false,
        looped: true,
        ended: false,
        damage: Loss::default(),
    };
    stage.behind.set(|snapshot| (snapshot.playing, snapshot.baseline) = (playing, None));
    shot(stage, folder, "recording").await?;
    let playing = Playing::Recording {
        position_s: 20.0,
        length_s: 20.0,
        speed: 0.5,
        paused: false,
        looped: false,
        ended: true,
        damage: Loss::default(),
    };
    let link = LinkState::Ended("the recording is over".to_owned());
    stage.behind.set(|snapshot| (snapshot.playing, snapshot.link) = (playing, link));
    shot(stage, folder, "ended").await?;
    let link = LinkState::Silent("no frame for 2 s".to_owned());
    stage.behind.set(|snapshot| *snapshot = Snapshot { link, ..Snapshot::default() });
    shot(stage, folder, "silent").await
}

fn solved(folder: &Path, scene: SceneName, method: Method, name: &str) -> Result<()> {
    in_front_of(
        || Live::start(scene, &[]),
        async |stage| {
            stage.browser.choose(method).await?;
            tokio::time::sleep(Duration::from_secs(9)).await;
            shot(stage, folder, name).await?;
            stage.browser.click("view-space").await?;
            shot(stage, folder, &format!("{name}-space")).await?;
            eprintln!("{name}: drawn in {} ms", stage.browser.told().await?.text("drawMs"));
            Ok(())
        },
    )
}

async fn shot<T>(stage: &Stage<T>, folder: &Path, name: &str) -> Result<()> {
    tokio::time::sleep(Duration::from_millis(1200)).await;
    let picture = stage.browser.client.screenshot().await?;
    std::fs::write(folder.join(format!("{name}.png")), picture).context("the gallery's folder")
}
