//! `tactomo forward`: readings of a detector for given contacts.

use std::path::PathBuf;

use anyhow::ensure;
use nalgebra::DMatrix;
use serde::Serialize;
use tactomo::case::Case;
use tactomo::detector::Detector;
use tactomo::forward::jacobian::Jacobian;
use tactomo::forward::readings_v;
use tactomo::readings::Readings;
use tactomo::scene::Contact;

use super::choice::{self, DetectorArgs, Model};
use super::output;

/// Computes the readings of a detector for given contacts, or saves its Jacobian.
///
/// Examples:
///   tactomo forward --detector square-60 --contact 3,-4,2.5,0.001 --json
///   tactomo forward --save-jacobian square-60.jacobian
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    #[command(flatten)]
    detector: DetectorArgs,
    /// Takes detector and contacts from a case file instead
    #[arg(long, value_name = "FILE", conflicts_with_all = ["detector", "material"])]
    case: Option<PathBuf>,
    /// A contact (millimetres and siemens); give it again for more
    #[arg(long, value_name = "X,Y,RADIUS,CONDUCTANCE", value_parser = choice::contact, allow_hyphen_values = true)]
    contact: Vec<Contact>,
    /// Forward model
    #[arg(long, value_enum, default_value = "shell")]
    model: Model,
    /// Nodes of the shell's mesh, about
    #[arg(long, value_parser = clap::value_parser!(u32).range(100..=1_000_000))]
    nodes: Option<u32>,
    /// Saves the Jacobian to a file, for `live --jacobian`
    #[arg(long, value_name = "FILE")]
    save_jacobian: Option<PathBuf>,
    /// Prints `{model, detector, image_nodes, readings_v, impedance_ohm}` as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report<'a> {
    model: &'a str,
    detector: &'a str,
    image_nodes: usize,
    /// `readings_v[g][e]`.
    readings_v: Vec<Vec<f64>>,
    impedance_ohm: Vec<Vec<f64>>,
}

/// Computes and prints.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let (detector, contacts) = scene(args)?;
    ensure!(
        !contacts.is_empty() || args.save_jacobian.is_some(),
        "nothing to compute: give --contact, --case or --save-jacobian"
    );
    let model = args.model.build(&detector, args.nodes.map(|nodes| nodes as usize))?;
    if let Some(path) = &args.save_jacobian {
        Jacobian::of(&*model).save(path)?;
        eprintln!("saved the Jacobian of {} ({}) to {}", detector.name, model.name(), path.display());
    }
    if contacts.is_empty() {
        return Ok(());
    }
    let impedance_ohm = model.impedance_ohm(&contacts)?;
    let readings = readings_v(&impedance_ohm, &detector);
    if args.json {
        let report = Report {
            model: model.name(),
            detector: &detector.name,
            image_nodes: model.image_mesh().nodes_m.len(),
            readings_v: rows_of_readings(&readings),
            impedance_ohm: rows(&impedance_ohm),
        };
        output::print(&serde_json::to_string(&report)?)?;
    } else {
        output::print(&table(&readings))?;
    }
    Ok(())
}

fn scene(args: &Args) -> anyhow::Result<(Detector, Vec<Contact>)> {
    let (detector, mut contacts) = match &args.case {
        Some(path) => {
            let case = Case::read(path)?;
            (case.detector, case.contacts)
        }
        None => (args.detector.get()?, Vec::new()),
    };
    if !args.contact.is_empty() {
        contacts.clone_from(&args.contact);
    }
    Ok((detector, contacts))
}

fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
}

fn rows_of_readings(readings: &Readings) -> Vec<Vec<f64>> {
    readings.volts().chunks(readings.electrodes()).map(<[f64]>::to_vec).collect()
}

/// Readings in millivolts: a row for each grounded electrode.
fn table(readings: &Readings) -> String {
    let mut lines = vec!["readings (mV): row = grounded electrode, column = electrode read".to_owned()];
    for (g, row) in rows_of_readings(readings).iter().enumerate() {
        let cells: String = row.iter().map(|volts| format!("{:8.2}", volts * 1e3)).collect();
        lines.push(format!("{g:3} {cells}"));
    }
    lines.join("\n")
}
