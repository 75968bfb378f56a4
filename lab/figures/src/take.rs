//! Takes figures and pictures.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;

use crate::browser;
use crate::figure::Figure;
use crate::job::{JOBS, Job, Tools};
use crate::live;
use crate::marks::marks;
use crate::picture::{How, PICTURES, Picture};
use crate::store::{self, Place, Store, Taken};
use crate::{COMMAND, table};

/// A machine with a higher load is too busy for times.
const QUIET: f64 = 0.3;

/// Prints all ids.
pub fn list() {
    for job in JOBS {
        println!("{:<24} {}", job.name, job.command());
        for figure in table::figures().iter().filter(|figure| figure.job == job.name) {
            println!("  {:<40} {}", figure.id, figure.says);
        }
    }
    for picture in PICTURES {
        println!("{:<24} {}", picture.id(), picture.file);
    }
}

/// Whether `id` is asked for: by itself, or by its beginning.
pub fn is_asked(ids: &[String], id: &str) -> bool {
    ids.iter().any(|asked| asked.strip_suffix('*').map_or(asked == id, |begin| id.starts_with(begin)))
}

/// Takes what is asked for, all if nothing is; writes it, and the numbers in the documents.
///
/// # Errors
/// If an id is unknown, a run fails, or something cannot be written. What was taken before is kept.
pub fn run(ids: &[String], pictures: bool) -> Result<()> {
    let figures = table::figures();
    known(ids, &figures)?;
    let wanted = |id: &str| ids.is_empty() || is_asked(ids, id);
    let tools = Tools::build()?;
    let mut store = Store::read(&tools.root)?;
    forget(&mut store, &figures);
    if let Some(load) = store::load().filter(|load| *load > QUIET) {
        eprintln!(
            "load {load}: this machine is busy, so times will be too long; it stands beside them in {}",
            store::FILE
        );
    }
    // What fails is told at the end, and costs nothing else.
    let mut failed = Vec::new();
    for job in JOBS {
        let of_job = || figures.iter().filter(|figure| figure.job == job.name);
        let charts: Vec<_> = PICTURES.iter().filter(|picture| pictures && is_chart_of(picture, job)).collect();
        // A chart shows what its run's figures say, so both are of one run.
        let is_asked = wanted(job.name)
            || of_job().any(|figure| wanted(&figure.id))
            || charts.iter().any(|chart| wanted(chart.id()));
        if is_asked && (of_job().next().is_some() || !charts.is_empty()) {
            failed.extend(take_job(&tools, &mut store, job, &figures, &charts).err());
        }
    }
    for picture in PICTURES.iter().filter(|picture| pictures && wanted(picture.id())) {
        failed.extend(take_picture(&tools, &mut store, picture).err());
        store.write(&tools.root)?;
    }
    store.write(&tools.root)?;
    rewrite(&tools.root, &store)?;
    failed.iter().for_each(|error| eprintln!("{error:#}"));
    ensure!(failed.is_empty(), "{} runs or pictures have failed; what they would give is as it was", failed.len());
    Ok(())
}

fn is_chart_of(picture: &Picture, job: &Job) -> bool {
    matches!(picture.how, How::Chart { job: name, .. } if name == job.name)
}

fn known(ids: &[String], figures: &[Figure]) -> Result<()> {
    let own = JOBS.iter().map(|job| job.name).chain(PICTURES.iter().map(Picture::id));
    let all: Vec<&str> = figures.iter().map(|figure| figure.id.as_str()).chain(own.map(|id| -> &str { id })).collect();
    for asked in ids {
        let is_there = all.iter().any(|id| is_asked(std::slice::from_ref(asked), id));
        ensure!(is_there, "there is no figure, run or picture `{asked}`: `{COMMAND} -- --list` has all");
    }
    Ok(())
}

/// Forgets what there is no figure, run or picture of any more.
fn forget(store: &mut Store, figures: &[Figure]) {
    store.figures.retain(|id, _| figures.iter().any(|figure| figure.id == *id));
    store.runs.retain(|name, _| figures.iter().any(|figure| figure.job == name));
    store.pictures.retain(|file, _| PICTURES.iter().any(|picture| picture.file == file));
}

fn take_job(tools: &Tools, store: &mut Store, job: &Job, figures: &[Figure], charts: &[&Picture]) -> Result<()> {
    let place = Place::now(&tools.root);
    let folder = std::env::temp_dir().join(format!("tactomo-charts-{}", std::process::id()));
    fs::create_dir_all(&folder)?;
    let taken = with_charts(tools, job, charts, &folder);
    fs::remove_dir_all(&folder)?;
    let report = taken?;
    let mut failed = Vec::new();
    store.keep(job, place.clone(), report["seconds"].as_f64().unwrap_or_default());
    for figure in figures.iter().filter(|figure| figure.job == job.name) {
        let value = match figure.of(&report) {
            Ok(value) => value,
            Err(error) => {
                failed.push(format!("{error:#}"));
                continue;
            }
        };
        let spread = figure.spread_at(&value);
        eprintln!("  {} = {value} {}", figure.id, figure.unit);
        store.figures.insert(
            figure.id.clone(),
            Taken {
                value,
                unit: figure.unit.to_owned(),
                spread: (spread * 1e6).round() / 1e6,
                says: figure.says.clone(),
                depends_on_machine: job.is_of_machine,
                run: job.name.to_owned(),
                command: format!("{COMMAND} -- {}", figure.id),
            },
        );
    }
    for chart in charts {
        chart.keep(tools, store, place.clone(), format!("what `{}` found", job.command()))?;
    }
    store.write(&tools.root)?;
    ensure!(failed.is_empty(), "{}", failed.join("\n"));
    Ok(())
}

fn with_charts(tools: &Tools, job: &Job, charts: &[&Picture], folder: &Path) -> Result<Value> {
    let page = |chart: &Picture| -> PathBuf { folder.join(format!("{}.html", chart.id())) };
    let option = |chart: &&Picture| match chart.how {
        How::Chart { option, .. } => format!("{option} '{}'", page(chart).display()),
        _ => String::new(),
    };
    let options: Vec<String> = charts.iter().map(option).collect();
    let report = job.run(tools, &options.join(" "))?;
    for chart in charts {
        browser::picture_of_file(&page(chart), chart.size, &tools.root.join(chart.file))?;
        eprintln!("  {}", chart.file);
    }
    Ok(report)
}

fn take_picture(tools: &Tools, store: &mut Store, picture: &Picture) -> Result<()> {
    let place = Place::now(&tools.root);
    let file = tools.root.join(picture.file);
    let shows = match &picture.how {
        How::Chart { .. } => return Ok(()),
        How::Live(state) => {
            eprintln!("{}: tactomo live --simulate {}", picture.file, state.args);
            live::picture_of_live(tools, state, picture.size, &file).with_context(|| picture.file)?
        }
        How::Film(film) => {
            eprintln!("{}: {} s of tactomo live --simulate {}", picture.file, film.seconds, film.live.args);
            live::film_of_live(tools, film, picture.size, &file).with_context(|| picture.file)?
        }
        How::Drawn { example } => {
            eprintln!("{}: example {example}", picture.file);
            let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
            let args =
                ["run", "--release", "--locked", "--package", "tactomo-lab", "--example", example, "--", picture.file];
            let run = Command::new(cargo).args(args).current_dir(&tools.root).status()?;
            ensure!(run.success(), "the example {example} has failed");
            format!("what the example `{example}` measures")
        }
    };
    eprintln!("  {shows}");
    picture.keep(tools, store, place, shows)
}

/// Writes the marked numbers of all documents as they are now.
fn rewrite(root: &Path, store: &Store) -> Result<()> {
    for path in documents(root)? {
        let mut text = fs::read_to_string(&path)?;
        let failed = |wrong: crate::marks::Wrong| format!("{}:{}: {}", path.display(), wrong.line, wrong.what);
        // From the end, so that what comes before stays where it is.
        for mark in marks(&text).map_err(failed).map_err(anyhow::Error::msg)?.into_iter().rev() {
            let Some(taken) = store.figures.get(&mark.id) else {
                eprintln!("{}: there is no figure {} yet", path.display(), mark.id);
                continue;
            };
            match mark.shown(&text, &taken.value) {
                Ok((range, wanted)) => text.replace_range(range, &wanted),
                Err(wrong) => bail!(failed(wrong)),
            }
        }
        if text != fs::read_to_string(&path)? {
            eprintln!("{}: numbers written anew", path.display());
            fs::write(&path, text)?;
        }
    }
    Ok(())
}

/// All documents that may have marked numbers.
///
/// # Errors
/// If the folder cannot be read.
pub fn documents(root: &Path) -> Result<Vec<PathBuf>> {
    let mut all = vec![root.join("README.md")];
    for entry in fs::read_dir(root.join("docs"))? {
        let path = entry?.path();
        if path.extension().is_some_and(|extension| extension == "md") {
            all.push(path);
        }
    }
    all.sort();
    Ok(all)
}
