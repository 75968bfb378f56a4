//! Two boards with one detector's file, as a person shows them: each keeps what was learned of it in a file of its own.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use serialport::{SerialPort, TTYPort};
use tactomo::board::identity::port_label;
use tactomo::board::link::Link;
use tactomo::board::simulated::{BoardModel, Options, SimulatedBoard};
use tactomo::detector::Detector;
use tactomo::forward::readings_v;
use tactomo::scene::{Contact, Hand, Scene, SceneName};
use tactomo::simulate::{Simulation, drawn, finer_model};
use tactomo::solve::{Method, Problem};
use tactomo_tests::{Folder, TACTOMO};

/// Names of the boards, and seeds of the detectors that they are on.
const BOARDS: [(&str, u64); 2] = [("left", 3), ("right", 8)];
/// Longest wait until what was learned of both is kept: some 6 s on two quiet cores.
const PATIENCE: Duration = Duration::from_secs(300);

/// A simulated board whose line is a pseudo-terminal.
struct Bridge {
    port: PathBuf,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Bridge {
    /// Plugs in a board with a finger that wanders over a detector as built.
    fn plug((name, built): (&str, u64)) -> Self {
        let described = Detector::preset("square-60").unwrap();
        let scene = Scene::new(SceneName::Wandering, &described, Hand::relative(&described), built);
        let simulation = Simulation::new(&drawn(&described, built), scene, &[], built).unwrap();
        let options = Options { seed: built, model: BoardModel::Ideal };
        let board = SimulatedBoard::simulate(&described, simulation, options).unwrap();
        let (mut master, slave) = TTYPort::pair().unwrap();
        master.set_timeout(Duration::from_millis(1)).unwrap();
        let port = std::env::temp_dir().join(format!("tactomo-{}-{name}", std::process::id()));
        std::os::unix::fs::symlink(slave.name().unwrap(), &port).unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let thread = Some(thread::spawn(move || pass_on(board, master, &stopped)));
        Self { port, stop, thread }
    }

    /// The file that what is learned of it is kept in.
    fn kept(&self, folder: &Folder) -> PathBuf {
        folder.path(&format!("my.{}.learned.toml", port_label(self.name()))).into()
    }

    fn name(&self) -> &str {
        self.port.to_str().unwrap()
    }
}

impl Drop for Bridge {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        drop(self.thread.take().map(JoinHandle::join));
        drop(std::fs::remove_file(&self.port));
    }
}

/// Passes bytes on in both directions. Where nobody listens they are lost, as on a line.
fn pass_on(mut board: SimulatedBoard, mut master: TTYPort, stop: &AtomicBool) {
    let mut bytes = [0; 4096];
    while !stop.load(Ordering::Relaxed) {
        let count = board.read(&mut bytes).unwrap();
        drop(master.write_all(&bytes[..count]));
        if let Ok(count) = master.read(&mut bytes) {
            board.write_all(&bytes[..count]).unwrap();
        }
    }
}

/// Shows both boards until `is_enough`.
fn live(boards: &[Bridge; 2], detector: &str, is_enough: impl Fn() -> bool) -> Output {
    let [left, right] = boards.each_ref().map(Bridge::name);
    let args = ["live", "--port", left, "--port", right, "--detector", detector, "--max-fps", "400", "--json"];
    let child = TACTOMO.command().args(args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let begun = Instant::now();
    while begun.elapsed() < PATIENCE && !is_enough() {
        thread::sleep(Duration::from_millis(50));
    }
    let ended = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(ended.success());
    child.wait_with_output().unwrap()
}

/// Residual of contacts on a learned detector, taken as exact, for a finger on one as built: median of three places, in standard deviations of the noise.
fn residual(learned: &Detector, built: u64) -> f64 {
    let built = drawn(&Detector::preset("square-60").unwrap(), built);
    let model = finer_model(&built, &[], 0).unwrap();
    let mut solver = Method::Contacts.build(&Problem::of(&learned.taken_as_exact()).unwrap()).unwrap();
    let mut residuals = [[-0.01, 0.006], [0.004, -0.013], [0.012, 0.009]].map(|[x_m, y_m]| {
        let pressed_ohm = model.impedance_ohm(&[Contact::flat(x_m, y_m, 0.004, 2e-3)]).unwrap();
        // Each by itself: nothing moved from one place to the next.
        solver.reset();
        solver.solve(&readings_v(&pressed_ohm, &built)).unwrap().residual.unwrap()
    });
    residuals.sort_by(f64::total_cmp);
    residuals[1]
}

#[test]
fn two_boards_with_one_detectors_file_keep_what_is_learned_of_each() {
    let folder = Folder::new("learned-ports");
    let described = folder.with("my.toml", TACTOMO.succeeds(&["detector", "show", "square-60", "--toml"]));
    let boards = BOARDS.map(Bridge::plug);
    let files = boards.each_ref().map(|board| board.kept(&folder));
    let are_there = || files.iter().all(|file| file.exists());
    let output = live(&boards, &described, are_there);
    assert!(are_there(), "{}", String::from_utf8_lossy(&output.stderr));
    let told = |file: &Path| format!("what was learned before of this sensor is used: {}", file.display());
    // Once more, each begins with what is its own, and neither takes or replaces the other's.
    let begun = Instant::now();
    let again = live(&boards, &described, || begun.elapsed() > Duration::from_secs(10));
    let messages = String::from_utf8(again.stderr).unwrap();
    assert!(files.iter().all(|file| messages.matches(&told(file)).count() == 1), "{messages}");
    for (((_, own), (_, other)), (file, board)) in
        [(BOARDS[0], BOARDS[1]), (BOARDS[1], BOARDS[0])].into_iter().zip(files.iter().zip(&boards))
    {
        let learned = Detector::read(file).unwrap();
        assert_eq!(learned.calibration.as_ref().unwrap().sensor.as_deref(), Some(board.name()));
        let residuals = [own, other].map(|built| residual(&learned, built));
        // After many presses 0.2 and 3; after the first ones, with which a slow machine ends, 2.2 and 4.3.
        assert!(residuals[0] < residuals[1], "{}: residuals {residuals:?} on its own and the other", file.display());
    }
    let kept = std::fs::read_dir(folder.path("")).unwrap().count();
    assert_eq!(kept, 3, "the description, and a file for each");
}
