//! A line of JSON for each event: `docs/streams.md` says what is in it.

use std::str::FromStr;

use tactomo_touch::schema::FrameReport;

use super::feed::Delivery;

/// Which fields a line has besides the contacts, numbers and times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fields {
    /// What to know of the answer: shape, residual, certainty, flags and choice.
    pub answer: bool,
    /// The image, if the answer has one.
    pub image: bool,
    /// The readings as measured, as they are used, and as the solver got them.
    pub readings: bool,
}

impl Default for Fields {
    /// Contacts and what to know of the answer.
    fn default() -> Self {
        Self { answer: true, image: false, readings: false }
    }
}

/// A list of `contacts`, `answer`, `image`, `readings` and `all`.
impl FromStr for Fields {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let none = Self { answer: false, image: false, readings: false };
        text.split(',').try_fold(none, |fields, name| match name.trim() {
            "contacts" => Ok(fields),
            "answer" => Ok(Self { answer: true, ..fields }),
            "image" => Ok(Self { image: true, ..fields }),
            "readings" => Ok(Self { readings: true, ..fields }),
            "all" => Ok(Self { answer: true, image: true, readings: true }),
            other => Err(format!("`{other}` is none of contacts, answer, image, readings and all")),
        })
    }
}

impl Fields {
    /// What such a line has.
    pub fn of(self, delivery: &Delivery) -> FrameReport<'_> {
        let all = FrameReport {
            patch: Some(&*delivery.patch).filter(|patch| !patch.is_empty()),
            lost_before: Some(delivery.lost_before),
            missed_before: Some(delivery.missed_before),
            events: &delivery.pointer_events,
            contacts: &delivery.changed.contacts,
            ended: &delivery.changed.ended,
            ..delivery.event.report()
        };
        FrameReport {
            shape: all.shape.filter(|_| self.answer),
            residual: all.residual.filter(|_| self.answer),
            certainty: all.certainty.filter(|_| self.answer),
            alternative: all.alternative.filter(|_| self.answer),
            flags: all.flags.filter(|_| self.answer),
            choice: all.choice.filter(|_| self.answer),
            image_s_per_m2: all.image_s_per_m2.filter(|_| self.image),
            readings_v: all.readings_v.filter(|_| self.readings),
            used_v: all.used_v.filter(|_| self.readings),
            touch_v: all.touch_v.filter(|_| self.readings),
            averaged: all.averaged.filter(|_| self.readings),
            ..all
        }
    }

    /// The line, with its end.
    ///
    /// # Errors
    /// If memory ends, which `serde_json` cannot tell from anything else.
    pub fn line(self, delivery: &Delivery, line: &mut Vec<u8>) -> std::io::Result<()> {
        line.clear();
        serde_json::to_writer(&mut *line, &self.of(delivery))?;
        line.push(b'\n');
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use serde_json::Value;
    use tactomo_touch::changes::Changes;
    use tactomo_touch::pointer::PointerEvent;
    use tactomo_touch::solve::{FoundContact, Solution};

    use super::*;
    use crate::run::TouchEvent;

    fn line(fields: &str) -> Value {
        let solution = Solution {
            contacts: vec![FoundContact::flat(0.01, 0.0, 1e-3)],
            image_s_per_m2: Some(vec![1.5, 2.5]),
            residual: Some(1.25),
            ..Solution::default()
        };
        let delivery = Delivery {
            lost_before: 2,
            missed_before: 3,
            pointer_events: vec![PointerEvent::Press],
            ..Delivery::at_once(TouchEvent::of(7, solution), &mut Changes::default())
        };
        let mut line = Vec::new();
        fields.parse::<Fields>().unwrap().line(&delivery, &mut line).unwrap();
        assert_eq!(line.pop(), Some(b'\n'));
        serde_json::from_slice(&line).unwrap()
    }

    fn has(line: &Value, names: &[&str]) -> Vec<bool> {
        names.iter().map(|name| line.get(name).is_some()).collect()
    }

    #[test]
    fn a_line_has_the_fields_that_were_asked_for() {
        let names = ["contacts", "flags", "residual", "image_s_per_m2", "readings_v", "used_v", "touch_v"];
        assert_eq!(has(&line("contacts"), &names), [true, false, false, false, false, false, false]);
        assert_eq!(has(&line("answer"), &names), [true, true, true, false, false, false, false]);
        assert_eq!(has(&line("contacts,image"), &names), [true, false, false, true, false, false, false]);
        assert_eq!(has(&line("answer,readings"), &names), [true, true, true, false, true, true, true]);
        assert_eq!(has(&line("all"), &names), [true; 7]);
        assert!("contacts,forces".parse::<Fields>().is_err_and(|error| error.contains("`forces`")));
    }

    #[test]
    fn every_line_has_its_number_times_and_losses() {
        let line = line("contacts");
        assert_eq!((&line["schema"], &line["sequence"]), (&1.into(), &7.into()));
        assert!(line["time_s"].as_f64().is_some_and(|time_s| (time_s - 0.007).abs() < 1e-12), "{line}");
        assert_eq!((&line["lost_before"], &line["missed_before"]), (&2.into(), &3.into()));
        assert_eq!((&line["contacts"][0]["x_m"], &line["events"][0]["kind"]), (&0.01.into(), &"press".into()));
        assert!(line["arrived_unix_s"].as_f64().is_some_and(|at_s| at_s > 1.7e9) && line["age_us"].is_f64());
    }
}
