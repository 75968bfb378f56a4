//! Where answers go besides the page: streams, Foxglove, MCAP files.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use anyhow::ensure;
use tactomo::detector::Detector;
use tactomo::forward::ImageMesh;
use tactomo::schema::SCHEMA;
use tactomo::sink::Sinks;
use tactomo::sink::address::Address;
use tactomo::sink::channels::Messages;
use tactomo::sink::door::Door;
use tactomo::sink::foxglove;
use tactomo::sink::lines::Fields;
use tactomo::sink::place::Place;
use tactomo::sink::target::{Form, Target};
use tactomo::solve::{ContactSettings, Problem};

use tactomo_cli::options;
use tactomo_cli::output::message;

/// Where answers go besides the page.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Streams")]
pub struct StreamArgs {
    /// Writes each answer as a line of JSON: to a new file, to stdout with `-`, to all who connect to `tcp:PORT` (of this machine; of
    /// others with `tcp:ADDRESS:PORT`), or as a datagram to `udp:ADDRESS:PORT`. May be given several times. docs/streams.md says what is
    /// in a line
    #[arg(long, value_name = "FILE|-|tcp:PORT|udp:ADDRESS:PORT")]
    stream: Vec<Target>,
    /// Lines of streams a second at most: the newest answers
    #[arg(long, value_name = "LINES", requires = "stream", value_parser = options::number("a rate (lines a second)", 1e-3..=1e6))]
    stream_hz: Option<f64>,
    /// What lines of streams have: only `contacts`; also what to know of the `answer`; its `image`; the `readings`; or `all`. A list, such
    /// as contacts,image [default: answer]
    #[arg(long, value_name = "FIELDS", requires = "stream")]
    stream_fields: Option<Fields>,
    /// Serves Foxglove's app: open ws://127.0.0.1:8765 in it. Programs that can reach the address can read what is touched; of pages in a
    /// browser Foxglove's own, and those that --allow-origin names
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1)]
    foxglove: Option<Option<Address>>,
    /// Keeps all answers and readings in a new MCAP file, for Foxglove and Python
    #[arg(long, value_name = "FILE")]
    mcap: Option<PathBuf>,
}

impl StreamArgs {
    /// Checks what can be checked before anything begins; `json` is what `--json` says.
    pub fn check(&self, json: bool) -> anyhow::Result<()> {
        let on_stdout = self.stream.iter().filter(|target| **target == Target::Stdout).count();
        ensure!(on_stdout == 0 || !json, "--json and --stream - would both write to stdout: give the stream a file");
        ensure!(on_stdout < 2, "--stream - is given twice: there is only one stdout");
        Ok(())
    }

    /// Whether a stream goes to stdout.
    pub fn use_stdout(&self) -> bool {
        self.stream.contains(&Target::Stdout)
    }

    /// Begins all of them, of one detector or several. `stop` is set when whoever reads stdout has gone, and `door` lets pages in.
    pub fn begin(&self, detectors: Vec<Streamed>, door: Door, stop: Arc<AtomicBool>) -> anyhow::Result<Sinks> {
        let mut sinks = Sinks::new(stop);
        let form = Form { fields: self.stream_fields.unwrap_or_default(), most_per_s: self.stream_hz };
        for target in &self.stream {
            if let Some(at) = sinks.add_stream(target, form)? {
                message!("stream: tcp:{at}");
            }
        }
        let (messages, about) = Streamed::parts(detectors);
        if let Some(address) = &self.foxglove {
            let address = address.clone().unwrap_or(Address::local(foxglove::DEFAULT_PORT));
            let at = sinks.add_foxglove(&address, messages.clone(), door)?;
            message!("Foxglove: open ws://{at} in the app");
        }
        if let Some(path) = &self.mcap {
            sinks.add_mcap(path, messages, about)?;
        }
        Ok(sinks)
    }
}

/// A detector, as streams know it.
#[derive(Clone)]
pub struct Streamed {
    messages: Messages,
    about: BTreeMap<String, String>,
}

impl Streamed {
    /// Of a detector whose readings come from such a source.
    pub fn new(problem: &Problem, source: &str) -> Self {
        Self::of(problem.detector(), &problem.jacobian.image_mesh, ContactSettings::of(problem).radius_m, source)
    }

    /// The same of a detector with images on such a mesh; contacts whose radius is not known are drawn with the usual one (m).
    pub fn of(detector: &Detector, mesh: &ImageMesh, usual_radius_m: f64, source: &str) -> Self {
        Self { messages: Messages::new(detector, mesh.clone(), usual_radius_m), about: about(detector, source) }
    }

    /// The same, of one of several by this name, at its place on the body; an empty name is of a detector that is alone.
    pub fn of_patch(self, name: &str, place: Option<Place>) -> Self {
        if name.is_empty() {
            return self;
        }
        let placed = place.map(|place| ("place".to_owned(), place.to_string()));
        let about = self.about.into_iter().chain(placed).map(|(key, value)| (format!("{name}.{key}"), value)).collect();
        Self { messages: self.messages.of_patch(name).at(place), about }
    }

    /// What makes the messages of all, and what an MCAP file of them says of itself.
    pub fn parts(all: Vec<Self>) -> (Vec<Messages>, BTreeMap<String, String>) {
        let (messages, about): (Vec<_>, Vec<_>) = all.into_iter().map(|of| (of.messages, of.about)).unzip();
        (messages, about.into_iter().flatten().collect())
    }
}

/// What an MCAP file says of itself.
fn about(detector: &Detector, source: &str) -> BTreeMap<String, String> {
    let about = [
        ("schema", SCHEMA.to_string()),
        ("detector", detector.name.clone()),
        ("detector_toml", detector.to_toml()),
        ("source", source.to_owned()),
    ];
    about.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
}
