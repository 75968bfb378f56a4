//! What was found, for people, as JSON, CSV or NPZ.

use std::fs::File;
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use serde::Serialize;
use tactomo::forward::ImageMesh;
use tactomo::solve::{Choice, Flags, FoundContact, Solution};
use tactomo::table::NpzWriter;

/// First line of a CSV file.
const COLUMNS: &str = "frame,time_s,frame_us,contact,id,x_m,y_m,z_m,conductance_s,radius_m,force_n,error_x_m,error_y_m,\
                       error_conductance_s,residual,saturated,misfit,unfinished";

/// A frame solved.
pub struct Found {
    /// Its number in the file, from 0.
    pub frame: usize,
    /// Time since the first frame (s), if the file tells.
    pub time_s: Option<f64>,
    /// Time that the solver took (us).
    pub frame_us: f64,
    /// What it found.
    pub solution: Solution,
}

/// A frame in JSON.
#[derive(Serialize)]
struct Line<'a> {
    frame: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    time_s: Option<f64>,
    frame_us: f64,
    contacts: &'a [FoundContact],
    residual: Option<f64>,
    flags: &'a Flags,
    choice: Option<&'a Choice>,
    #[serde(skip_serializing_if = "Option::is_none")]
    image_s_per_m2: Option<&'a [f32]>,
}

/// Where it goes.
pub struct Writer {
    form: Form,
    images: bool,
    out: Box<dyn Write>,
    arrays: Option<(PathBuf, Arrays)>,
}

enum Form {
    People,
    Json,
    Csv,
    Npz,
}

/// Columns of an NPZ file.
#[derive(Default)]
struct Arrays {
    frames: Vec<f64>,
    times_s: Vec<f64>,
    frame_us: Vec<f64>,
    residuals: Vec<f64>,
    flags: Vec<f64>,
    /// Frame, x, y, z, conductance and force of each contact.
    contacts: Vec<f64>,
    images: Vec<f64>,
}

impl Writer {
    /// To a file, whose name tells its form, or to stdout.
    pub fn new(file: Option<&Path>, json: bool, images: bool) -> anyhow::Result<Self> {
        let Some(path) = file else {
            let form = if json { Form::Json } else { Form::People };
            return Ok(Self { form, images, out: Box::new(BufWriter::new(io::stdout())), arrays: None });
        };
        let form = match path.extension().and_then(|extension| extension.to_str()) {
            Some("csv") => Form::Csv,
            Some("npz") => Form::Npz,
            Some("json" | "jsonl") => Form::Json,
            _ => bail!("{}: a name that ends in .csv, .npz, .json or .jsonl is needed", path.display()),
        };
        let created = File::create(path).with_context(|| format!("cannot write {}", path.display()))?;
        let mut out = BufWriter::new(created);
        if let Form::Csv = form {
            writeln!(out, "{COLUMNS}")?;
        }
        let arrays = matches!(form, Form::Npz).then(|| (path.to_owned(), Arrays::default()));
        Ok(Self { form, images, out: Box::new(out), arrays })
    }

    /// Writes a frame. A reader that closed the pipe has seen enough.
    pub fn write(&mut self, found: &Found) -> anyhow::Result<()> {
        let written = match self.form {
            Form::People => writeln!(self.out, "{}", sentence(found)),
            Form::Json => writeln!(self.out, "{}", serde_json::to_string(&line(found, self.images))?),
            Form::Csv => csv_lines(found).iter().try_for_each(|line| writeln!(self.out, "{line}")),
            Form::Npz => {
                self.arrays.iter_mut().for_each(|(_, arrays)| arrays.push(found, self.images));
                Ok(())
            }
        };
        ended(written)
    }

    /// Writes what is left.
    pub fn finish(mut self, mesh: Option<&ImageMesh>) -> anyhow::Result<()> {
        if let Some((path, arrays)) = self.arrays {
            return arrays.write(&path, mesh).with_context(|| format!("cannot write {}", path.display()));
        }
        ended(self.out.flush())
    }
}

fn ended(written: io::Result<()>) -> anyhow::Result<()> {
    match written {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => Ok(written?),
    }
}

fn line(found: &Found, images: bool) -> Line<'_> {
    let Solution { image_s_per_m2, contacts, residual, flags, choice } = &found.solution;
    Line {
        frame: found.frame,
        time_s: found.time_s,
        frame_us: found.frame_us,
        contacts,
        residual: *residual,
        flags,
        choice: choice.as_ref(),
        image_s_per_m2: image_s_per_m2.as_deref().filter(|_| images),
    }
}

/// A frame for people.
fn sentence(found: &Found) -> String {
    let contact = |found: &FoundContact| {
        let strength = match found.force_n {
            Some(force_n) => format!("{force_n:.2} N"),
            None => format!("{:.2e} S", found.conductance_s),
        };
        format!("({:.2}, {:.2}) mm {strength}", found.x_m * 1e3, found.y_m * 1e3)
    };
    let contacts: Vec<_> = found.solution.contacts.iter().map(contact).collect();
    let time = found.time_s.map_or_else(String::new, |time_s| format!(" at {time_s:.3} s"));
    let contacts = if contacts.is_empty() { "no contact".to_owned() } else { contacts.join(", ") };
    let misfit = if found.solution.flags.misfit { "; the readings do not fit" } else { "" };
    format!("frame {}{time}: {contacts}{misfit}", found.frame)
}

/// A line for each contact; for a frame without one, a line with no contact in it.
fn csv_lines(found: &Found) -> Vec<String> {
    let Solution { contacts, residual, flags, .. } = &found.solution;
    let text = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
    let start = format!("{},{},{:.3}", found.frame, text(found.time_s), found.frame_us);
    let end = format!(
        "{},{},{},{}",
        text(*residual),
        u8::from(flags.saturated),
        u8::from(flags.misfit),
        u8::from(flags.unfinished)
    );
    if contacts.is_empty() {
        return vec![format!("{start},,,,,,,,,,,,{end}")];
    }
    let line = |(index, contact): (usize, &FoundContact)| {
        let FoundContact { x_m, y_m, z_m, conductance_s, radius_m, force_n, uncertainty, id } = contact;
        let id = id.map_or_else(String::new, |id| id.to_string());
        let errors = uncertainty
            .map_or_else(|| ",,".to_owned(), |error| format!("{},{},{}", error.x_m, error.y_m, error.conductance_s));
        let optional = format!("{},{}", text(*radius_m), text(*force_n));
        format!("{start},{index},{id},{x_m},{y_m},{z_m},{conductance_s},{optional},{errors},{end}")
    };
    contacts.iter().enumerate().map(line).collect()
}

impl Arrays {
    fn push(&mut self, found: &Found, images: bool) {
        let Solution { image_s_per_m2, contacts, residual, flags, .. } = &found.solution;
        self.frames.push(found.frame as f64);
        self.times_s.push(found.time_s.unwrap_or(f64::NAN));
        self.frame_us.push(found.frame_us);
        self.residuals.push(residual.unwrap_or(f64::NAN));
        self.flags.extend([flags.saturated, flags.misfit, flags.unfinished].map(|flag| f64::from(u8::from(flag))));
        for contact in contacts {
            let FoundContact { x_m, y_m, z_m, conductance_s, force_n, .. } = *contact;
            self.contacts.extend([found.frame as f64, x_m, y_m, z_m, conductance_s, force_n.unwrap_or(f64::NAN)]);
        }
        if images {
            self.images.extend(image_s_per_m2.iter().flatten().map(|&value| f64::from(value)));
        }
    }

    fn write(&self, path: &Path, mesh: Option<&ImageMesh>) -> io::Result<()> {
        let frames = self.frames.len();
        let mut writer = NpzWriter::new(BufWriter::new(File::create(path)?));
        writer.add("frame", &[frames], &self.frames)?;
        writer.add("time_s", &[frames], &self.times_s)?;
        writer.add("frame_us", &[frames], &self.frame_us)?;
        writer.add("residual", &[frames], &self.residuals)?;
        writer.add("saturated_misfit_unfinished", &[frames, 3], &self.flags)?;
        writer.add("contact_frame_x_y_z_m_conductance_s_force_n", &[self.contacts.len() / 6, 6], &self.contacts)?;
        if let Some(mesh) = mesh.filter(|_| !self.images.is_empty()) {
            let nodes = mesh.nodes_m.len();
            let places: Vec<f64> = (0..nodes).flat_map(|node| mesh.place_m(node)).collect();
            writer.add("node_x_y_z_m", &[nodes, 3], &places)?;
            writer.add("image_s_per_m2", &[self.images.len() / nodes, nodes], &self.images)?;
        }
        writer.finish()
    }
}
