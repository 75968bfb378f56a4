//! A frame as rows of a CSV table.

use super::{CONTACT_COLUMNS, FRAME_COLUMNS, FrameReport, Kind, SHAPE_COLUMNS, TOTAL_COLUMNS};
use crate::solve::FoundContact;

/// Names of the text columns that follow the numbers in tables.
const TEXT_COLUMNS: [&str; 3] = ["excluded", "choice", "events"];

/// Electrodes left out, with blanks between them, what was chosen, and what the pointer did, as in JSON.
fn texts(frame: &FrameReport) -> [String; TEXT_COLUMNS.len()] {
    let excluded = frame.flags.map(|flags| flags.excluded.iter().map(usize::to_string).collect::<Vec<_>>().join(" "));
    // Names and finite numbers are always JSON.
    let events = || serde_json::to_string(frame.events).unwrap_or_default();
    [
        excluded.unwrap_or_default(),
        frame.choice.map(|choice| choice.what.clone()).unwrap_or_default(),
        if frame.events.is_empty() { String::new() } else { events() },
    ]
}

/// Heads of a CSV table with a contact a row: a frame's columns, its total's, its shape's, `contact` (from 0), a contact's columns in that order,
/// and the texts.
pub fn csv_heads() -> Vec<&'static str> {
    let frame = FRAME_COLUMNS.iter().map(|column| column.name);
    let shape = SHAPE_COLUMNS.iter().map(|column| column.name);
    let contact = CONTACT_COLUMNS.iter().map(|column| column.name);
    let total = TOTAL_COLUMNS.iter().map(|column| column.name);
    frame.chain(total).chain(shape).chain(["contact"]).chain(contact).chain(TEXT_COLUMNS).collect()
}

/// Rows of that table: one for each contact, or one without a contact.
pub fn csv_rows(frame: &FrameReport) -> Vec<Vec<String>> {
    let shape = SHAPE_COLUMNS.iter().map(|column| Kind::Number.text(frame.shape.and_then(|shape| column.value(shape))));
    let total =
        TOTAL_COLUMNS.iter().map(|column| Kind::Number.text(frame.total.and_then(|total| column.value(&total))));
    let own = FRAME_COLUMNS.iter().map(|column| column.text(frame));
    let start: Vec<_> = own.chain(total).chain(shape).collect();
    let end = texts(frame);
    let row = |contact: Option<(usize, &FoundContact)>| {
        let index = contact.map_or_else(String::new, |(index, _)| index.to_string());
        let values = CONTACT_COLUMNS
            .iter()
            .map(|column| column.kind.text(contact.and_then(|(_, contact)| column.value(contact))));
        start.iter().cloned().chain([index]).chain(values).chain(end.iter().cloned()).collect()
    };
    match frame.contacts {
        [] => vec![row(None)],
        contacts => contacts.iter().enumerate().map(|contact| row(Some(contact))).collect(),
    }
}
