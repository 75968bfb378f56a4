//! Holds documents, figures and pictures against each other, and figures against what the program says now.

use std::fs;
use std::path::Path;

use anyhow::{Result, ensure};

use crate::figure::{Figure, is_near};
use crate::job::{JOBS, Job, Tools, root};
use crate::marks::{line_of, marks};
use crate::picture::PICTURES;
use crate::store::{FILE, Store};
use crate::take::{documents, is_asked};
use crate::{COMMAND, table};

/// Fails with all that is wrong.
///
/// # Errors
/// What is wrong, a line each; or that something cannot be read or run.
pub fn run(ids: &[String], all: bool, written: bool) -> Result<()> {
    let root = root()?;
    let (store, figures) = (Store::read(&root)?, table::figures());
    let mut wrong = complete(&store, &figures);
    wrong.extend(marked(&root, &store)?);
    for picture in PICTURES {
        wrong.extend(picture.trouble(&root, &store)?);
    }
    if !written {
        let tools = Tools::build()?;
        for job in JOBS.iter().filter(|job| !job.is_of_machine) {
            let of_job: Vec<_> = figures.iter().filter(|figure| figure.job == job.name).collect();
            let is_wanted = match ids {
                [] => all || job.is_quick,
                ids => is_asked(ids, job.name) || of_job.iter().any(|figure| is_asked(ids, &figure.id)),
            };
            if is_wanted && !of_job.is_empty() {
                wrong.extend(moved(&tools, &store, job, &of_job)?);
            }
        }
    }
    for line in &wrong {
        eprintln!("{line}");
    }
    ensure!(wrong.is_empty(), "{} of figures, documents and pictures are not what they should be", wrong.len());
    eprintln!("{} figures and {} pictures are what they should be", store.figures.len(), store.pictures.len());
    Ok(())
}

/// Figures that were never taken, or that there are no more.
fn complete(store: &Store, figures: &[Figure]) -> Vec<String> {
    let missing = figures.iter().filter(|figure| !store.figures.contains_key(&figure.id));
    let missing = missing.map(|figure| format!("{FILE}: {} was never taken: {COMMAND} -- {0}", figure.id));
    let surplus = store.figures.keys().filter(|id| figures.iter().all(|figure| figure.id != **id));
    missing.chain(surplus.map(|id| format!("{FILE}: there is no figure {id} any more: {COMMAND}"))).collect()
}

/// Numbers in documents that are not those of the figures.
fn marked(root: &Path, store: &Store) -> Result<Vec<String>> {
    let mut wrong = Vec::new();
    for path in documents(root)? {
        let text = fs::read_to_string(&path)?;
        let name = path.strip_prefix(root).unwrap_or(&path).display().to_string();
        let all = match marks(&text) {
            Ok(all) => all,
            Err(error) => {
                wrong.push(format!("{name}:{}: {}", error.line, error.what));
                continue;
            }
        };
        for mark in all {
            let line = line_of(&text, mark.at);
            match store.figures.get(&mark.id).map(|taken| mark.shown(&text, &taken.value)) {
                None => wrong.push(format!("{name}:{line}: there is no figure `{}`", mark.id)),
                Some(Err(error)) => wrong.push(format!("{name}:{}: {}", error.line, error.what)),
                Some(Ok((range, wanted))) if text[range.clone()] != wanted => {
                    wrong.push(format!("{name}:{line}: {} is `{wanted}`, not `{}`", mark.id, &text[range]));
                }
                Some(Ok(_)) => {}
            }
        }
    }
    Ok(wrong)
}

/// Figures of a run that are not what they were.
fn moved(tools: &Tools, store: &Store, job: &Job, figures: &[&Figure]) -> Result<Vec<String>> {
    let report = job.run(tools, "")?;
    let mut wrong = Vec::new();
    for figure in figures {
        let Some(taken) = store.figures.get(&figure.id) else { continue };
        let now = figure.of(&report)?;
        if !is_near(&taken.value, &now, taken.spread) {
            wrong.push(format!(
                "{} is {now} {}, and was {} with a spread of {}: if that is right, {}",
                figure.id, figure.unit, taken.value, taken.spread, taken.command
            ));
        }
    }
    Ok(wrong)
}
