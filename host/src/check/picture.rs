//! The electrodes as a picture of text.

use tactomo_physics::detector::Detector;
use tactomo_physics::geometry;

use super::report::{ElectrodeReport, State};

/// Characters across a line at most, and lines.
const WIDTH: usize = 64;
const HEIGHT: usize = 13;
/// Characters of an electrode: two digits, its mark, and room.
const CELL: usize = 5;
/// A character is about so many times as high as it is wide.
const TALL: f64 = 2.0;

/// Draws every electrode where it is, seen from above: its number and its mark, and what the marks mean. Of a curved detector, its map.
pub fn picture(detector: &Detector, reports: &[ElectrodeReport]) -> String {
    let places: Vec<[f64; 2]> = detector.electrodes.iter().map(|pad| [pad.x_m, pad.y_m]).collect();
    let [low, high] = geometry::bounds(&places);
    let [wide_m, high_m] = [0, 1].map(|axis| (high[axis] - low[axis]).max(f64::MIN_POSITIVE));
    // As large as fits, and so that what is square looks square.
    let columns = (WIDTH - CELL) as f64;
    let per_m = (columns / wide_m).min(TALL * (HEIGHT - 1) as f64 / high_m);
    let (last_column, last_line) = ((per_m * wide_m).round() as usize, (per_m * high_m / TALL).round() as usize);
    let mut lines = vec![vec![' '; last_column + CELL]; last_line + 1];
    for (place, report) in places.iter().zip(reports) {
        let column = (per_m * (place[0] - low[0])).round() as usize;
        let line = (per_m * (high[1] - place[1]) / TALL).round() as usize;
        write(&mut lines[line.min(last_line)], column.min(last_column), &cell(report));
    }
    let mut text: Vec<String> = lines.into_iter().map(|line| line.into_iter().collect::<String>()).collect();
    text.iter_mut().for_each(|line| *line = format!("  {}", line.trim_end()));
    text.push(String::new());
    text.push(legend(reports));
    text.join("\n")
}

fn cell(report: &ElectrodeReport) -> String {
    let (number, mark) = (report.electrode, report.state.mark());
    if report.state == State::Ok { format!("{number:>2}{mark} ") } else { format!("{number:>2}{mark}*") }
}

/// Writes a text from a column on, or behind what is there already: electrodes above each other on the map of a curved detector.
fn write(line: &mut Vec<char>, column: usize, text: &str) {
    let length = text.chars().count();
    let is_free = |line: &[char], at: usize| line.iter().skip(at).take(length).all(|character| *character == ' ');
    let at = (column..).find(|at| is_free(line, *at)).unwrap_or(column);
    line.resize(line.len().max(at + length), ' ');
    line.iter_mut().skip(at).zip(text.chars()).for_each(|(place, character)| *place = character);
}

fn legend(reports: &[ElectrodeReport]) -> String {
    let mut states: Vec<State> = Vec::new();
    for report in reports {
        if !states.contains(&report.state) {
            states.push(report.state);
        }
    }
    states.sort_by_key(|state| *state != State::Ok);
    let marks: Vec<String> = states.iter().map(|state| format!("{} {}", state.mark(), state.legend())).collect();
    format!("  {}", marks.join("   "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reports(detector: &Detector, faulty: usize) -> Vec<ElectrodeReport> {
        let state = |electrode| if electrode == faulty { State::Open } else { State::Ok };
        let report = |electrode| ElectrodeReport {
            electrode,
            state: state(electrode),
            with: Vec::new(),
            pins: None,
            advice: None,
        };
        (0..detector.electrodes.len()).map(report).collect()
    }

    #[test]
    fn every_electrode_of_every_preset_is_drawn_within_a_terminal() {
        for name in Detector::preset_names() {
            let detector = Detector::preset(name).unwrap();
            let text = picture(&detector, &reports(&detector, 3));
            assert!(text.lines().all(|line| line.chars().count() <= 80), "{name}\n{text}");
            let legend = text.lines().last().unwrap_or_default();
            assert_eq!(legend.trim(), ". right   o not grounded: open");
            for electrode in 0..detector.electrodes.len() {
                let cell = format!("{electrode:>2}{}", if electrode == 3 { "o" } else { "." });
                assert!(text.contains(&cell), "{name} {cell}\n{text}");
            }
        }
    }

    #[test]
    fn the_picture_is_seen_from_above() {
        let detector = Detector::default();
        let text = picture(&detector, &reports(&detector, 3));
        let line_of =
            |electrode: usize| text.lines().position(|line| line.contains(&format!("{electrode:>2}."))).unwrap();
        let highest =
            (0..16).max_by(|a, b| detector.electrodes[*a].y_m.total_cmp(&detector.electrodes[*b].y_m)).unwrap();
        assert_eq!(line_of(highest), 0, "{text}");
    }
}
