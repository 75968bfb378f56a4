//! Prints the contacts on a board as they come: `cargo run --release --package tactomo --example watch_board -- [SECONDS]`. Without a board on a
//! USB serial port it watches the simulated one.

use std::error::Error;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, mpsc};
use std::time::Duration;

use tactomo::board::link::ports::ports;
use tactomo::board::link::serial::DEFAULT_BAUD;
use tactomo::board::simulated::{BoardModel, Options, SimulatedBoard};
use tactomo::board::source::{AnyBoard, Opened, Source};
use tactomo::detector::Detector;
use tactomo::run::options::{Ends, RunOptions, Solving};
use tactomo::run::{Listener, TouchEvent, run};
use tactomo::scene::{Hand, Scene, SceneName};
use tactomo::simulate::Simulation;
use tactomo::solve::{Method, Problem};

/// Takes each answer. It must not wait; printing a line now and then does not.
struct Print;

impl Listener for Print {
    fn touched(&mut self, event: &Arc<TouchEvent>) {
        for contact in event.solution.contacts.iter().filter(|_| event.frame.sequence.is_multiple_of(50)) {
            println!("{:7.3} s  {:6.2} {:6.2} mm", event.frame.time_s(), 1e3 * contact.x_m, 1e3 * contact.y_m);
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let seconds = std::env::args().nth(1).map_or(Ok(5.0), |text| text.parse())?;
    let detector = Detector::default();
    let mut source: Box<dyn Source> = match ports().iter().any(|port| port.usb) {
        true => Box::new(AnyBoard { baud: DEFAULT_BAUD }),
        false => {
            let scene = Scene::new(SceneName::Wandering, &detector, Hand::relative(&detector), 1);
            let simulation = Simulation::new(&detector, scene, &[], 1)?;
            let board = SimulatedBoard::simulate(&detector, simulation, Options { seed: 1, model: BoardModel::Esp32 })?;
            Box::new(Opened::new(Box::new(board)))
        }
    };
    let options = RunOptions {
        solving: Some(Solving::new(Method::Auto, Problem::of(&detector)?)),
        listeners: vec![Box::new(Print)],
        seconds: Some(Duration::from_secs_f64(seconds)),
        ..RunOptions::new(detector)
    };
    let (_request, requests) = mpsc::sync_channel(1);
    let snapshots = tokio::sync::watch::channel(Arc::default()).0;
    let summary = run(&mut *source, options, Ends { snapshots, requests, stop: Arc::new(AtomicBool::new(false)) })?;
    println!("{summary:?}");
    Ok(())
}
