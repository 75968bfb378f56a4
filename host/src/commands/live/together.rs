//! Detectors shown together on one page, or one alone: from the moment that all is checked to the end.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::Duration;

use tactomo::board::source::Source;
use tactomo::run::Snapshot;
use tactomo::run::options::{Ends, RunOptions, Summary};
use tactomo::sink::Sinks;
use tactomo::sink::page::{PageSetup, Shown};
use tactomo::sink::place::Place;
use tactomo::solve::ContactSettings;
use tactomo_cli::output::message;
use tactomo_cli::{interrupt, output};
use tokio::sync::watch;

use super::{Show, door, options, problem, sentence, serve};
use crate::commands::streams::{StreamArgs, Streamed};

/// Requests of pages that may wait.
const REQUESTS: usize = 64;

/// A detector that is about to be shown.
struct Begun {
    /// Its name among several.
    name: String,
    /// Where it lies on a body.
    place: Option<Place>,
    source: Box<dyn Source>,
    options: RunOptions,
    ends: Ends,
    sinks: Sinks,
    streamed: Streamed,
    /// Whether what it came to is told as JSON.
    json: bool,
}

/// Serves the page of detectors, each by its name, or only counts, until the end. What ends one leaves the others as they are. `streams` have
/// lines of all.
pub fn show_all(shows: Vec<(String, Show)>, streams: Option<&StreamArgs>) -> anyhow::Result<()> {
    let stop = interrupt::flag()?;
    let Some((_, Show { picture, seconds, .. })) = shows.first() else { return Ok(()) };
    let (picture, has_end) = (picture.clone(), seconds.is_some());
    // Whatever cannot be is said before a page opens.
    let begun = shows.into_iter().map(|(name, show)| begin(name, show, &stop)).collect::<anyhow::Result<Vec<_>>>()?;
    let (mut begun, shown): (Vec<_>, Vec<_>) = begun.into_iter().unzip();
    let mut of_all = Sinks::new(Arc::clone(&stop));
    if let Some(streams) = streams {
        streams.check(picture.json)?;
        let detectors = begun.iter().map(|begun| begun.streamed.clone().of_patch(&begun.name, begun.place)).collect();
        of_all = streams.begin(detectors, door(&picture), Arc::clone(&stop))?;
    }
    let listeners = of_all.listeners(begun.iter().map(|begun| begun.name.as_str()));
    begun.iter_mut().zip(listeners).for_each(|(begun, listener)| begun.options.listeners.extend(listener));
    // The page may outlive the pipelines, so the snapshots have senders here too.
    let _outlive: Vec<_> = begun.iter().map(|begun| begun.ends.snapshots.clone()).collect();
    let server = serve(&picture, shown)?;
    let ended: Vec<_> = thread::scope(|scope| {
        let runs: Vec<_> = begun.into_iter().map(|begun| scope.spawn(|| one(begun, &of_all))).collect();
        runs.into_iter().map(|run| run.join().unwrap_or_else(|panic| resume_unwind(panic))).collect()
    });
    let streamed = of_all.finish();
    ended.into_iter().collect::<anyhow::Result<Vec<_>>>()?;
    streamed?;
    if server.is_some() && !has_end {
        wait(&stop);
    }
    Ok(())
}

/// Makes one detector ready to be shown.
fn begin(name: String, mut show: Show, stop: &Arc<AtomicBool>) -> anyhow::Result<(Begun, Shown)> {
    let problem = problem(&show.picture, &show.detector)?;
    let (snapshots, newest) = watch::channel(Arc::new(Snapshot::default()));
    let (request, requests) = mpsc::sync_channel(REQUESTS);
    show.streams.check(show.picture.json)?;
    let streamed = Streamed::new(&problem, &show.source.name());
    let mut sinks = show.streams.begin(vec![streamed.clone()], door(&show.picture), Arc::clone(stop))?;
    let setup = PageSetup {
        detector: show.detector.clone(),
        mesh: problem.jacobian.image_mesh.clone(),
        usual_radius_m: ContactSettings::of(&problem).radius_m,
        source: show.source.name(),
        finger: show.finger,
    };
    let options = options(&name, &mut show, problem, sinks.listener())?;
    // One of several that is not there yet keeps none of the others waiting.
    let options = RunOptions { waits: !name.is_empty(), ..options };
    let ends = Ends { snapshots, requests, stop: Arc::clone(stop) };
    let Show { source, place, picture, .. } = show;
    let shown = Shown { name: name.clone(), place, setup, snapshots: newest, requests: request };
    Ok((Begun { name, place, source, options, ends, sinks, streamed, json: picture.json }, shown))
}

/// Shows one detector to its end, and says what that came to, unless whoever reads what it or all write has gone: then it ends as quietly as
/// `head` does.
fn one(begun: Begun, of_all: &Sinks) -> anyhow::Result<()> {
    let Begun { name, mut source, options, ends, sinks, json, .. } = begun;
    let named = |error: anyhow::Error| if name.is_empty() { error } else { error.context(format!("patch {name}")) };
    let summary = match tactomo::run::run(&mut *source, options, ends) {
        Ok(summary) => summary,
        Err(error) => {
            let error = named(error.into());
            if !name.is_empty() {
                tracing::error!("{error:#}; the others go on");
            }
            return Err(error);
        }
    };
    let is_left = sinks.reader_is_gone() || of_all.reader_is_gone();
    let ended = sinks.finish();
    if !is_left {
        report(&name, &summary, json)?;
    }
    ended.map_err(|error| named(error.into()))
}

/// Waits for Ctrl-C: the last picture stays on the page.
fn wait(stop: &AtomicBool) {
    if !stop.load(Ordering::Relaxed) {
        message!("the page stays open until Ctrl-C");
    }
    while !stop.load(Ordering::Relaxed) {
        thread::sleep(Duration::from_millis(50));
    }
}

/// What the run of a detector came to, by the name that it has among several.
#[derive(serde::Serialize)]
struct NamedSummary<'a> {
    #[serde(skip_serializing_if = "str::is_empty")]
    patch: &'a str,
    #[serde(flatten)]
    summary: &'a Summary,
}

fn report(patch: &str, summary: &Summary, json: bool) -> anyhow::Result<()> {
    if json {
        return Ok(output::print(&serde_json::to_string(&NamedSummary { patch, summary })?)?);
    }
    let of = if patch.is_empty() { String::new() } else { format!("{patch}: ") };
    message!("{of}{}", sentence(summary));
    Ok(())
}
