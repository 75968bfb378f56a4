//! What was found, for people, as JSON, CSV or NPZ: the names are those of [`tactomo::schema`].

use std::fs::File;
use std::io::{self, BufWriter, Cursor, Write};

use anyhow::bail;
use tactomo::board::frames::{BOARD, hello_bytes};
use tactomo::detector::short;
use tactomo::forward::ImageMesh;
use tactomo::schema::{
    self, CONTACT_COLUMNS, EVENT_COLUMNS, FRAME_COLUMNS, FrameReport, Kind, Of, SHAPE_COLUMNS, TOTAL_COLUMNS,
};
use tactomo::solve::{FoundContact, FoundShape};
use tactomo::table::{CsvWriter, NpzWriter, Values};

use super::Args;
use tactomo_cli::output::{NewFile, unless_closed};
use tactomo_protocol::Hello;

/// Where frames go.
pub struct Writer {
    form: Form,
    file: Option<NewFile>,
}

/// Forms of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileForm {
    /// One contact a row.
    Csv,
    /// Arrays.
    Npz,
    /// One frame a line.
    JsonLines,
}

enum Form {
    People(Box<dyn Write>),
    Json(Box<dyn Write>),
    Csv(Box<CsvWriter<BufWriter<File>>>),
    Npz(Box<Arrays>),
}

/// Columns of an NPZ file, gathered until its end.
#[derive(Default)]
struct Arrays {
    frames: Frames,
    /// Of each frame, whether it has a shape or not.
    totals: [Vec<f64>; TOTAL_COLUMNS.len()],
    shapes: [Vec<f64>; SHAPE_COLUMNS.len()],
    /// Number of the frame of each contact, and the contacts' own columns.
    contact_frames: Vec<f64>,
    contacts: [Vec<f64>; CONTACT_COLUMNS.len()],
    /// Number of the frame of each image: a solver need not make one of every frame.
    image_frames: Vec<f64>,
    images: Vec<f64>,
    /// Number of the frame of each event of the pointer, and the events' own columns.
    event_frames: Vec<f64>,
    events: [Vec<f64>; EVENT_COLUMNS.len()],
    /// Of each frame, if they are wanted: electrodes, and readings as measured, as they are used, and as the solver got them (V).
    electrodes: usize,
    readings: [Vec<f64>; 3],
}

/// The figures of frames, each in its own kind.
struct Frames([FrameValues; FRAME_COLUMNS.len()]);

/// A figure of frames, and how it is got of one. What is not known is -1 of an integer, false of a flag and NaN of a number.
enum FrameValues {
    Integers(fn(&FrameReport) -> Option<u64>, Vec<i64>),
    Flags(fn(&FrameReport) -> Option<bool>, Vec<bool>),
    Numbers(fn(&FrameReport) -> Option<f64>, Vec<f64>),
}

impl Default for Frames {
    fn default() -> Self {
        Self(FRAME_COLUMNS.each_ref().map(|column| match column.of {
            Of::Integer(of) => FrameValues::Integers(of, Vec::new()),
            Of::Flag(of) => FrameValues::Flags(of, Vec::new()),
            Of::Number(of) => FrameValues::Numbers(of, Vec::new()),
        }))
    }
}

impl FrameValues {
    fn push(&mut self, frame: &FrameReport) {
        match self {
            Self::Integers(of, values) => values.push(of(frame).and_then(|value| value.try_into().ok()).unwrap_or(-1)),
            Self::Flags(of, values) => values.push(of(frame).unwrap_or_default()),
            Self::Numbers(of, values) => values.push(of(frame).unwrap_or(f64::NAN)),
        }
    }

    fn values(&self) -> (usize, Values<'_>) {
        match self {
            Self::Integers(_, values) => (values.len(), Values::Integers(values)),
            Self::Flags(_, values) => (values.len(), Values::Flags(values)),
            Self::Numbers(_, values) => (values.len(), Values::Numbers(values)),
        }
    }
}

impl Writer {
    /// To the file that is wanted, whose name chooses the form, or to stdout.
    pub fn new(args: &Args) -> anyhow::Result<Self> {
        let Some(path) = args.out.as_deref() else {
            let out = Box::new(BufWriter::new(io::stdout()));
            return Ok(Self { form: if args.json { Form::Json(out) } else { Form::People(out) }, file: None });
        };
        let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
        if !["csv", "npz", "json", "jsonl"].contains(&extension) {
            bail!("{}: a name that ends in .csv, .npz, .json or .jsonl is needed", path.display());
        }
        let form = match extension {
            "npz" => FileForm::Npz,
            "csv" => FileForm::Csv,
            _ => FileForm::JsonLines,
        };
        Self::to_file(form, NewFile::new(path)?)
    }

    /// To a file of such a form.
    pub fn to_file(form: FileForm, file: NewFile) -> anyhow::Result<Self> {
        let form = match form {
            FileForm::Npz => Form::Npz(Box::default()),
            FileForm::Csv => {
                let mut table = CsvWriter::new(file.create()?);
                table.row(schema::csv_heads()).map_err(|error| file.failed(error))?;
                Form::Csv(Box::new(table))
            }
            FileForm::JsonLines => Form::Json(Box::new(file.create()?)),
        };
        Ok(Self { form, file: Some(file) })
    }

    /// Writes a frame; `false` if nobody reads it any more.
    pub fn write(&mut self, frame: &FrameReport) -> anyhow::Result<bool> {
        let written = match &mut self.form {
            Form::People(out) => writeln!(out, "{}", sentence(frame)),
            Form::Json(out) => writeln!(out, "{}", serde_json::to_string(frame)?),
            Form::Csv(table) => schema::csv_rows(frame).into_iter().try_for_each(|row| table.row(row)),
            Form::Npz(arrays) => {
                arrays.push(frame);
                Ok(())
            }
        };
        unless_closed(written).map_err(|error| self.failed(error))
    }

    /// Why no more can be written, as the system says it.
    fn failed(&self, error: io::Error) -> anyhow::Error {
        match &self.file {
            Some(file) => file.failed(error).into(),
            None => anyhow::Error::new(error).context("cannot write to stdout"),
        }
    }

    /// Writes what is left: the places of images, and the board that readings are of.
    pub fn finish(mut self, mesh: Option<&ImageMesh>, board: Option<&Hello>) -> anyhow::Result<()> {
        let board = board.map(hello_bytes).transpose()?;
        let written = match (&mut self.form, &self.file) {
            (Form::People(out) | Form::Json(out), _) => out.flush(),
            (Form::Csv(table), _) => table.flush(),
            (Form::Npz(arrays), Some(file)) => arrays.write(file.create()?, mesh, board.as_deref()),
            (Form::Npz(_), None) => Ok(()),
        };
        unless_closed(written).map_err(|error| self.failed(error))?;
        Ok(self.file.map_or(Ok(()), NewFile::finish)?)
    }
}

/// A frame for people.
fn sentence(frame: &FrameReport) -> String {
    let contact = |found: &FoundContact| {
        let strength = match (found.force_n, found.known_conductance_s()) {
            (Some(force_n), _) => format!(" {}", force_sentence(force_n, found)),
            (None, Some(conductance_s)) => format!(" {conductance_s:.2e} S"),
            (None, None) => String::new(),
        };
        format!("({:.2}, {:.2}) mm{strength}", found.x_m * 1e3, found.y_m * 1e3)
    };
    let contacts: Vec<_> = frame.contacts.iter().map(contact).collect();
    let number = frame.frame.map_or_else(String::new, |number| format!(" {number}"));
    let time = frame.time_s.map_or_else(String::new, |time_s| format!(" at {time_s:.3} s"));
    let found = match frame.shape {
        Some(shape) => shape_sentence(shape),
        None if contacts.is_empty() => "no contact".to_owned(),
        None => contacts.join(", "),
    };
    let misfit = if frame.flags.is_some_and(|flags| flags.misfit) { "; does not fit the readings" } else { "" };
    let lost = match frame.lost_before {
        None | Some(0) => String::new(),
        Some(count) => format!(" ({count} lost before it)"),
    };
    format!("frame{number}{time}{lost}: {found}{misfit}")
}

/// A force for people, with its standard error if that is known.
fn force_sentence(force_n: f64, found: &FoundContact) -> String {
    let error = found.force_deviation_n.map_or_else(String::new, |error_n| format!(" \u{b1} {}", short(error_n)));
    let beyond = if found.force_beyond_maximum == Some(true) { " (beyond the largest that can be told)" } else { "" };
    format!("{}{error} N{beyond}", short(force_n))
}

/// A shape for people.
fn shape_sentence(shape: &FoundShape) -> String {
    let place = |[x_m, y_m]: [f64; 2]| format!("({:.2}, {:.2}) mm", x_m * 1e3, y_m * 1e3);
    let where_it_is = match shape {
        FoundShape::Line(line) => format!("line from {} to {}", place(line.from_m), place(line.to_m)),
        FoundShape::Ring(ring) => format!("ring about {}, radius {:.2} mm", place(ring.centre_m), 1e3 * ring.radius_m),
    };
    format!("{where_it_is}, {:.1} mm wide, {:.2e} S", 1e3 * shape.width_m(), shape.conductance_s())
}

impl Arrays {
    fn push(&mut self, frame: &FrameReport) {
        let number = frame.frame.map_or(f64::NAN, |frame| frame as f64);
        self.frames.0.iter_mut().for_each(|values| values.push(frame));
        for (column, values) in TOTAL_COLUMNS.iter().zip(&mut self.totals) {
            values.push(frame.total.and_then(|total| column.value(&total)).unwrap_or(f64::NAN));
        }
        for (column, values) in SHAPE_COLUMNS.iter().zip(&mut self.shapes) {
            values.push(frame.shape.and_then(|shape| column.value(shape)).unwrap_or(f64::NAN));
        }
        for contact in frame.contacts {
            self.contact_frames.push(number);
            for (column, values) in CONTACT_COLUMNS.iter().zip(&mut self.contacts) {
                values.push(column.value(contact).unwrap_or(f64::NAN));
            }
        }
        if let Some(image) = frame.image_s_per_m2 {
            self.image_frames.push(number);
            self.images.extend(image.iter().map(|&value| f64::from(value)));
        }
        for event in frame.events {
            self.event_frames.push(number);
            for (column, values) in EVENT_COLUMNS.iter().zip(&mut self.events) {
                values.push(column.value(event).unwrap_or(f64::NAN));
            }
        }
        if let (Some(measured), Some(used), Some(touch)) = (frame.readings_v, frame.used_v, frame.touch_v) {
            self.electrodes = measured.electrodes();
            for (all, readings) in self.readings.iter_mut().zip([measured, used, touch]) {
                all.extend(readings.read_v());
            }
        }
    }

    fn write(&self, mut out: BufWriter<File>, mesh: Option<&ImageMesh>, board: Option<&[i64]>) -> io::Result<()> {
        // In memory, as the arrays are: an archive that cannot be ended says so on stderr by itself.
        let mut bytes = Vec::new();
        let mut writer = NpzWriter::new(Cursor::new(&mut bytes));
        for (frame, values) in FRAME_COLUMNS.iter().zip(&self.frames.0) {
            let (count, values) = values.values();
            writer.add_values(frame.name, &[count], values)?;
        }
        for (total, values) in TOTAL_COLUMNS.iter().zip(&self.totals) {
            column(&mut writer, total.name, Kind::Number, values)?;
        }
        for (shape, values) in SHAPE_COLUMNS.iter().zip(&self.shapes) {
            column(&mut writer, shape.name, Kind::Number, values)?;
        }
        column(&mut writer, "contact_frame", Kind::Integer, &self.contact_frames)?;
        for (contact, values) in CONTACT_COLUMNS.iter().zip(&self.contacts) {
            column(&mut writer, &format!("contact_{}", contact.name), contact.kind, values)?;
        }
        column(&mut writer, "event_frame", Kind::Integer, &self.event_frames)?;
        for (event, values) in EVENT_COLUMNS.iter().zip(&self.events) {
            column(&mut writer, &format!("event_{}", event.name), event.kind, values)?;
        }
        if let Some(mesh) = mesh.filter(|_| !self.images.is_empty()) {
            column(&mut writer, "image_frame", Kind::Integer, &self.image_frames)?;
            let nodes = mesh.nodes_m.len();
            let places: Vec<f64> = (0..nodes).flat_map(|node| mesh.place_m(node)).collect();
            writer.add("node_x_y_z_m", &[nodes, 3], &places)?;
            writer.add("image_s_per_m2", &[self.image_frames.len(), nodes], &self.images)?;
        }
        if self.electrodes > 0 {
            let n = self.electrodes;
            let shape = [self.readings[0].len() / (n * n), n, n];
            for (name, readings) in ["readings_v", "used_v", "touch_v"].into_iter().zip(&self.readings) {
                writer.add(name, &shape, readings)?;
            }
            if let Some(board) = board {
                writer.add_values(BOARD, &[board.len()], Values::Integers(board))?;
            }
        }
        writer.finish()?;
        out.write_all(&bytes)?;
        out.flush()
    }
}

/// Adds a column in its kind; what is not known is -1 of an integer and false of a flag.
fn column(writer: &mut NpzWriter<Cursor<&mut Vec<u8>>>, name: &str, kind: Kind, values: &[f64]) -> io::Result<()> {
    let shape = [values.len()];
    match kind {
        Kind::Number => writer.add(name, &shape, values),
        Kind::Integer | Kind::Word(_) => {
            let values: Vec<i64> = values.iter().map(|value| if value.is_nan() { -1 } else { *value as i64 }).collect();
            writer.add_values(name, &shape, Values::Integers(&values))
        }
        Kind::Flag => {
            let values: Vec<bool> = values.iter().map(|value| *value == 1.0).collect();
            writer.add_values(name, &shape, Values::Flags(&values))
        }
    }
}
