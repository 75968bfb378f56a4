//! Arguments that choose where the bytes come from.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use anyhow::ensure;
use clap::ArgGroup;
use clap::builder::TypedValueParser;
use tactomo::board::link::serial::DEFAULT_BAUD;
use tactomo::board::record::RecordReader;
use tactomo::board::session::RequestedSettings;
use tactomo::board::simulated::{BoardModel, Options, SimulatedBoard};
use tactomo::board::source::{AnyBoard, NamedPort, Opened, Recording, Source};
use tactomo::detector::Detector;
use tactomo::scene::SceneName;
use tactomo::simulate::Simulation;
use tactomo::sink::page::Finger;
use tactomo_protocol::Settings;

use super::scene::SceneArgs;
use tactomo_cli::choice::{DetectorArgs, board_model};
use tactomo_cli::options::{self, number_in};

/// How firmly the mouse presses on the simulated detector, from 0 to 1.
const MOUSE_FIRMNESS: f64 = 0.3;

/// A board: on the port that is named, or on whichever USB serial port one is found.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Board")]
#[command(group(ArgGroup::new("simulated").args(SceneArgs::NAMES).multiple(true).requires("simulate")))]
pub struct BoardArgs {
    /// Serial port of the board, or the serial number of its USB device, as `ports` prints it [default: the USB serial port on which a board answers]
    #[arg(id = "port", long, value_name = "PORT", conflicts_with = "simulate")]
    pub ports: Vec<String>,
    /// Uses the simulated board: the real firmware on simulated pins
    #[arg(long, value_name = "BOARDS", num_args = 0, default_missing_value = "1", value_parser = clap::value_parser!(u8).range(1..=64))]
    pub simulate: Option<u8>,
    /// Which board is simulated [default: esp32; of more than 16 electrodes ideal]
    #[arg(long, value_name = "BOARD", requires = "simulate", value_parser = board_model())]
    board: Option<BoardModel>,
    /// Baud rate of the serial port, from which board and program agree on a higher one
    #[arg(long, default_value_t = DEFAULT_BAUD, value_parser = clap::value_parser!(u32).range(300..=12_000_000))]
    pub baud: u32,
    #[command(flatten)]
    pub settings: SettingsArgs,
    #[command(flatten)]
    pub scene: SceneArgs,
    /// How many times faster than the simulated board its scene plays and its foam creeps and drifts: a day in 86 seconds with 1000
    #[arg(long, value_name = "FACTOR", default_value = "1", requires = "simulate", value_parser = factor())]
    pub time_factor: f64,
}

/// Settings of the scan; what is not given stays as the board has it.
#[derive(Clone, Copy, Debug, clap::Args)]
#[command(next_help_heading = "Scan settings")]
pub struct SettingsArgs {
    /// Wait after grounding an electrode before its readings (us)
    #[arg(long, value_name = "US")]
    settle_us: Option<u16>,
    /// Conversions averaged for each reading
    #[arg(long, value_name = "1|2|4|...|256", value_parser = average_log2)]
    average: Option<u8>,
    /// Frames per second at most; 0 for as fast as the board can
    #[arg(long, value_name = "FRAMES")]
    max_fps: Option<u16>,
    /// Wait after bringing an electrode to a board's one ADC input before its conversions (us); `board check` says what the foam needs
    #[arg(long, value_name = "US", value_parser = clap::value_parser!(u16).range(..=i64::from(Settings::MAX_SELECT_US)))]
    select_us: Option<u16>,
    /// Conversions of each electrode that are thrown away before those that count
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u8).range(..=i64::from(Settings::MAX_DISCARDED)))]
    discard: Option<u8>,
}

impl BoardArgs {
    /// The board to simulate: one that was chosen, or the default where it has inputs for the detector.
    fn model(&self, detector: &Detector) -> BoardModel {
        self.board.unwrap_or_else(|| BoardModel::usual(detector))
    }

    /// The board on a serial port.
    fn serial(&self) -> Box<dyn Source> {
        let baud = self.baud;
        match self.ports.first() {
            Some(port) => Box::new(NamedPort { port: port.clone(), baud }),
            None => Box::new(AnyBoard { baud }),
        }
    }

    /// Whether the board is simulated.
    pub fn is_simulated(&self) -> bool {
        self.simulate.is_some()
    }

    /// How many boards are asked for.
    pub fn boards(&self) -> usize {
        usize::from(self.simulate.unwrap_or(1)).max(self.ports.len())
    }
}

impl SettingsArgs {
    /// What is asked of the board.
    pub fn requested(&self) -> RequestedSettings {
        RequestedSettings {
            settle_us: self.settle_us,
            average_log2: self.average,
            max_frames_per_s: self.max_fps,
            select_us: self.select_us,
            discarded: self.discard,
        }
    }
}

/// What is told of the detector: one that is simulated is as it is described, unless it is one as built, and has the converter of its board.
pub fn described(args: &BoardArgs, detector: Detector) -> Detector {
    if !args.is_simulated() {
        return detector;
    }
    args.model(&detector).described(detector, args.scene.as_built.is_given())
}

/// The board that is chosen, and what the mouse presses with on a simulated one.
pub fn board(args: &BoardArgs, detector: &Detector) -> anyhow::Result<(Box<dyn Source>, Option<Finger>)> {
    ensure!(args.boards() == 1, "one board at a time, and {} are asked for: `live` takes several", args.boards());
    if !args.is_simulated() {
        return Ok((args.serial(), None));
    }
    let scene = args.scene.scene(SceneName::Wandering, detector)?;
    let finger = scene.hand().tip([0.0; 2], MOUSE_FIRMNESS, 1.0).disc().map(Finger::from);
    let seed = args.scene.seed();
    let built = args.scene.as_built.of(detector)?;
    let simulation = Simulation::new(&built, scene, &args.scene.fault, seed)?.at_speed(args.time_factor);
    let link = SimulatedBoard::simulate(&built, simulation, Options { seed, model: args.model(&built) })?;
    Ok((Box::new(Opened::new(Box::new(link))), finger))
}

/// A recording to be played; for a person who watches it stays open at its end.
pub fn recording(path: PathBuf, speed: f64, is_watched: bool) -> Box<dyn Source> {
    Box::new(Recording { path, speed, stays_open: is_watched && speed.is_finite() })
}

/// The detector that is chosen; unless one is given, that of a recording.
pub fn recorded_detector(chosen: &DetectorArgs, path: &Path) -> anyhow::Result<Detector> {
    chosen.of_recording(path, RecordReader::open(path)?.header())
}

/// Factors that time is stretched or shortened by.
const FACTORS: RangeInclusive<f64> = 1e-3..=1e6;

/// A speed, or `max`.
pub fn speed(text: &str) -> Result<f64, String> {
    match text {
        "max" => Ok(f64::INFINITY),
        _ => number_in(text, "`max`, for as fast as it can be read, or a factor", &FACTORS),
    }
}

/// Parses how many times faster something plays.
fn factor() -> impl TypedValueParser<Value = f64> {
    options::number("a factor", FACTORS)
}

/// Base-2 logarithm of a power of two up to 256.
fn average_log2(text: &str) -> Result<u8, String> {
    let count = text.parse::<u16>().ok().filter(|count| count.is_power_of_two() && *count <= 256);
    count.map(|count| count.ilog2() as u8).ok_or_else(|| "1, 2, 4, 8, 16, 32, 64, 128 or 256".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speeds_and_averages_are_checked() {
        assert_eq!(speed("2.5"), Ok(2.5));
        assert_eq!(speed("max"), Ok(f64::INFINITY));
        for wrong in ["0", "-1", "NaN", "inf", "1e300"] {
            assert!(speed(wrong).is_err_and(|error| error.contains("from 0.001 to 1000000")), "{wrong}");
        }
        assert_eq!(average_log2("256"), Ok(8));
        assert!(average_log2("3").is_err() && average_log2("512").is_err() && average_log2("0").is_err());
    }
}
