//! What is in a recording, in words and as JSON.

use std::path::{Path, PathBuf};

use anyhow::ensure;
use serde::Serialize;
use tactomo::board::frames::{RecordingLoss, Survey};
use tactomo::board::record::Note;
use tactomo::causes::with_causes;
use tactomo::date::date_time;

use tactomo_cli::output;

/// What is in a recording, as JSON has it.
#[derive(Serialize)]
struct Info<'a> {
    file: String,
    detector: &'a str,
    source: &'a str,
    started_unix_s: f64,
    notes: &'a str,
    board: &'a str,
    electrodes: u8,
    frames: u64,
    without_readings: u64,
    seconds: f64,
    frames_per_s: f64,
    longest_pause_s: f64,
    missing_frames: u64,
    missing_s: f64,
    corrupt: u64,
    is_damaged: bool,
    loss: String,
    marks: Vec<Mark<'a>>,
    joined_at_s: Vec<f64>,
}

#[derive(Serialize)]
struct Mark<'a> {
    time_s: f64,
    text: &'a str,
}

impl<'a> Info<'a> {
    fn of(file: &Path, survey: &'a Survey) -> Self {
        let Survey { header, board, loss, .. } = survey;
        let joined = survey.notes.iter().filter(|(_, note)| matches!(note, Note::Joined { .. }));
        Self {
            file: file.display().to_string(),
            detector: &header.detector,
            source: &header.source,
            started_unix_s: header.started().as_secs_f64(),
            notes: &header.notes,
            board: &board.board,
            electrodes: board.electrodes,
            frames: survey.frames,
            without_readings: survey.without_readings,
            seconds: survey.seconds,
            frames_per_s: survey.frames_per_s(),
            longest_pause_s: survey.longest_pause_s,
            missing_frames: loss.missing_frames,
            missing_s: loss.missing_us as f64 * 1e-6,
            corrupt: loss.corrupt,
            is_damaged: loss.is_damage(),
            loss: lost(loss),
            marks: survey.marks().map(|(time_s, text)| Mark { time_s, text }).collect(),
            joined_at_s: joined.map(|(time_s, _)| *time_s).collect(),
        }
    }
}

/// Prints what is in a recording.
pub fn print(file: &Path, json: bool) -> anyhow::Result<()> {
    let survey = Survey::of(file)?;
    let info = Info::of(file, &survey);
    let text = if json { serde_json::to_string(&info)? } else { in_words(&info, &survey) };
    Ok(output::print(&text)?)
}

/// A recording in a line.
pub fn line(file: &Path) -> anyhow::Result<String> {
    Ok(sum(file, &Survey::of(file)?))
}

fn sum(file: &Path, survey: &Survey) -> String {
    format!("{}: {} frames in {:.3} s; {}", file.display(), survey.frames, survey.seconds, lost(&survey.loss))
}

/// What is lost, and where it was lost that is missing in a file that is whole.
fn lost(loss: &RecordingLoss) -> String {
    let on_line = (loss.missing_frames > 0 || loss.corrupt > 0) && !loss.is_damage();
    format!("{loss}{}", if on_line { ", lost on the line; the file is whole" } else { "" })
}

fn in_words(info: &Info, survey: &Survey) -> String {
    let Info {
        file, detector, source, notes, board, electrodes, frames, without_readings, seconds, frames_per_s, ..
    } = info;
    let calibrated = survey.notes.iter().any(|(_, note)| matches!(note, Note::Detector { .. }));
    let calibrated = if calibrated { ", calibrated while it was recorded" } else { "" };
    let mut lines = vec![
        file.clone(),
        format!("  detector   {detector}{calibrated}"),
        format!("  source     {source}; board {board}, {electrodes} electrodes"),
        format!("  started    {}", date_time(survey.header.started())),
        format!(
            "  frames     {frames} in {seconds:.3} s, {frames_per_s:.0} a second; longest pause {:.4} s",
            info.longest_pause_s
        ),
        format!("  loss       {}", info.loss),
    ];
    if *without_readings > 0 {
        lines.push(format!(
            "  contacts   {without_readings} frames have no readings, but the contacts that the board found"
        ));
    }
    if !notes.is_empty() {
        lines.push(format!("  notes      {notes}"));
    }
    lines.extend(info.joined_at_s.iter().map(|time_s| format!("  joined     another recording at {time_s:.3} s")));
    lines.extend(
        info.marks
            .iter()
            .map(|Mark { time_s, text }| format!("  mark       {time_s:.3} s  {text}").trim_end().to_owned()),
    );
    lines.join("\n")
}

/// Prints what is damaged or missing in each recording.
///
/// # Errors
/// How many files are damaged, and how many cannot be read, if any.
pub fn check(files: &[PathBuf]) -> anyhow::Result<()> {
    let (mut damaged, mut unread) = (0, 0);
    for file in files {
        let line = match Survey::of(file) {
            Ok(survey) => {
                damaged += usize::from(survey.loss.is_damage());
                sum(file, &survey)
            }
            Err(error) => {
                unread += 1;
                with_causes(&error)
            }
        };
        output::print(&line)?;
    }
    let of_all = |count: usize, what: [&str; 2]| {
        (count > 0).then(|| format!("{count} of {} {}", files.len(), what[usize::from(count > 1)]))
    };
    let wrong = [of_all(damaged, ["is damaged", "are damaged"]), of_all(unread, ["cannot be read"; 2])];
    let wrong: Vec<_> = wrong.into_iter().flatten().collect();
    ensure!(wrong.is_empty(), "of the recordings, {}", wrong.join(", and "));
    Ok(())
}
