//! What the solvers' tests share.

use tactomo_physics::detector::Detector;
use tactomo_physics::forward::jacobian::Jacobian;
use tactomo_physics::forward::shell::Shell;
use tactomo_physics::forward::{ForwardModel, readings_v};
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::Contact;

/// A light contact beside the middle of `square-60`.
pub const CONTACT: Contact = Contact::flat(0.009, -0.006, 0.003, 2e-4);

/// The linear theory of `square-60` as a shell.
pub fn jacobian(nodes: usize) -> Jacobian {
    Jacobian::of(&shell(nodes))
}

/// Readings of a contact by a finer mesh than the ones that are inverted.
pub fn readings(contact: Contact) -> Readings {
    let model = shell(5000);
    match model.impedance_ohm(&[contact]) {
        Ok(impedance_ohm) => readings_v(&impedance_ohm, model.detector()),
        Err(error) => panic!("{error}"),
    }
}

fn shell(nodes: usize) -> Shell {
    match Detector::preset("square-60").map(|detector| Shell::with_nodes(&detector, nodes)) {
        Some(Ok(shell)) => shell,
        _ => panic!("no shell"),
    }
}
