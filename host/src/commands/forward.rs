//! `tactomo forward`: readings of a detector for given contacts.

use std::path::PathBuf;

use anyhow::ensure;
use nalgebra::DMatrix;
use serde::Serialize;
use tactomo::detector::Detector;
use tactomo::forward::jacobian::Jacobian;
use tactomo::forward::{ForwardModel, touched_impedance_ohm};
use tactomo::readings::Readings;
use tactomo::scene::{Contact, SceneName, Touch};
use tactomo::simulate::{self, Foam, Measurement, Pressed};

use super::as_built::AsBuiltArgs;
use super::scene::{self, Press, SceneArgs};
use tactomo_cli::choice::{self, DetectorArgs, Model};
use tactomo_cli::options;
use tactomo_cli::output::{self, NewFile, message};

/// Computes the readings of a detector for given contacts, or saves its Jacobian.
///
/// Examples:
///   tactomo forward --detector square-60 --contact 3,-4,2.5,0.001 --json
///   tactomo forward --model slab --press 3,-4,2.5,0.5 --fault open:3 --measured
///   tactomo forward --model slab --scene ring --force 5 --seed 7 --json
///   tactomo forward --scene single --as-built 7 --measured --json
///   tactomo forward --save-jacobian square-60.jacobian
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    #[command(flatten)]
    detector: DetectorArgs,
    /// A contact, in millimetres and siemens; give it again for more
    #[arg(long, value_name = "X,Y,RADIUS,CONDUCTANCE", value_parser = choice::contact, allow_hyphen_values = true)]
    contact: Vec<Contact>,
    /// A ball pressed on the detector, in millimetres and newtons; give it again for more
    #[arg(long, value_name = "X,Y,RADIUS,FORCE", value_parser = scene::press, allow_hyphen_values = true)]
    press: Vec<Press>,
    /// Touches of any shape, as `--json` prints them: a list of `{centre_m, shape, conductance_s}`, with shapes
    /// `{"disc": {radius_m}}`, `{"ring": {radius_m, width_m}}`, `{"line": {length_m, width_m, angle_rad}}` and
    /// `{"polygon": {corners_m}}`
    #[arg(long, value_name = "FILE")]
    touches: Option<PathBuf>,
    #[command(flatten)]
    scene: SceneArgs,
    /// Time in the scene, and of what creeps or drifts (s); contacts, presses and touches are held from time 0
    #[arg(long, value_name = "SECONDS", default_value = "1", value_parser = options::time_s())]
    time: f64,
    /// Adds the converter's noise and rounds to its steps
    #[arg(long)]
    measured: bool,
    /// Forward model
    #[arg(long, value_enum, default_value = "auto")]
    model: Model,
    /// Approximate number of nodes of the shell's mesh
    #[arg(long, value_parser = clap::value_parser!(u32).range(100..=1_000_000))]
    nodes: Option<u32>,
    /// Saves the Jacobian to a file, for `live --jacobian`
    #[arg(long, value_name = "FILE", conflicts_with = AsBuiltArgs::NAME)]
    save_jacobian: Option<PathBuf>,
    /// Prints `{model, detector, as_built?, image_nodes, touches, faults, readings_v, impedance_ohm}` as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report<'a> {
    model: &'a str,
    detector: &'a str,
    /// The detector that was simulated, as TOML, where that is not the one described.
    #[serde(skip_serializing_if = "Option::is_none")]
    as_built: Option<String>,
    image_nodes: usize,
    touches: &'a [Touch],
    faults: Vec<String>,
    /// `readings_v[g][e]`.
    readings_v: Vec<Vec<f64>>,
    /// Between the electrodes, whatever is wrong with their wires.
    impedance_ohm: Vec<Vec<f64>>,
}

/// Computes and prints.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let (detector, pressed) = pressed(args)?;
    let leaks = simulate::driving_layer(&detector, &args.scene.fault).leak_s > 0.0;
    let (computes, saves) = (leaks || !pressed.touches.is_empty(), args.save_jacobian.is_some());
    ensure!(
        computes || saves,
        "nothing to compute: give --contact, --press, --touches, --scene (at a time when something touches) or --save-jacobian"
    );
    ensure!(!(leaks && saves), "a detector that leaks has no Jacobian at no contact: leave out --fault leak");
    let jacobian = NewFile::optional(args.save_jacobian.as_ref())?;
    let built = args.scene.as_built.of(&detector)?;
    let model = model(args, &built)?;
    if let (Some(file), Some(path)) = (jacobian, &args.save_jacobian) {
        file.write(Jacobian::of(&*model).to_bytes()?)?;
        message!("saved the Jacobian of {} ({}) to {}", detector.name, model.name(), path.display());
    }
    if !computes {
        return Ok(());
    }
    let impedance_ohm = touched_impedance_ohm(&*model, &pressed.before_drift())? / pressed.factor;
    let readings = readings(args, &built, &impedance_ohm)?;
    if args.json {
        let report = Report {
            model: model.name(),
            detector: &detector.name,
            as_built: args.scene.as_built.is_given().then(|| built.to_toml()),
            image_nodes: model.image_mesh().nodes_m.len(),
            touches: &pressed.touches,
            faults: args.scene.fault.iter().map(ToString::to_string).collect(),
            readings_v: rows_of_readings(&readings),
            impedance_ohm: rows(&impedance_ohm),
        };
        output::print(&serde_json::to_string(&report)?)?;
    } else {
        output::print(&table(&readings))?;
    }
    Ok(())
}

/// The detector, and all that touches it.
fn pressed(args: &Args) -> anyhow::Result<(Detector, Pressed)> {
    let detector = args.detector.get_or(args.scene.preset())?;
    let mut held: Vec<Touch> = args.contact.iter().copied().map(Touch::from).collect();
    if !args.press.is_empty() {
        let hertz = args.scene.hertz(&detector)?;
        held.extend(args.press.iter().map(|press| press.touch(&hertz)));
    }
    if let Some(path) = &args.touches {
        held.extend(scene::read_touches(path)?);
    }
    let scene = args.scene.scene(SceneName::Rest, &detector)?;
    let pressed =
        Foam::after(&args.scene.fault, args.time, |time_s| held.iter().cloned().chain(scene.at(time_s)).collect());
    Ok((detector, pressed))
}

fn model(args: &Args, detector: &Detector) -> anyhow::Result<Box<dyn ForwardModel>> {
    let nodes = args.nodes.map(|nodes| nodes as usize);
    let driving = simulate::driving_layer(detector, &args.scene.fault);
    let detector = simulate::as_built(detector, &args.scene.fault, args.scene.seed());
    Ok(args.model.build_under(&detector, nodes, driving)?)
}

fn readings(args: &Args, detector: &Detector, impedance_ohm: &DMatrix<f64>) -> anyhow::Result<Readings> {
    let mut measurement = Measurement::new(detector, &args.scene.fault, args.scene.seed())?;
    Ok(match args.measured {
        true => measurement.readings_v(Some(impedance_ohm)),
        false => measurement.pad_voltages(Some(impedance_ohm)),
    })
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
