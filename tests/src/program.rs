//! A program as a person runs it.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

/// The program for the sensor.
pub const TACTOMO: Program = Program("tactomo");
/// The program for measurements and designs.
pub const LAB: Program = Program("tactomo-lab");

/// A program by its name.
#[derive(Clone, Copy, Debug)]
pub struct Program(&'static str);

impl Program {
    /// Where it is: beside the test that runs, in the folder of all that is built.
    ///
    /// # Panics
    /// If it was not built: Cargo builds the programs of the packages that are tested, `cargo test --workspace` all of them.
    pub fn path(self) -> PathBuf {
        let test = std::env::current_exe().unwrap();
        let folder = test.parent().and_then(Path::parent).unwrap();
        let path = folder.join(self.0).with_extension(std::env::consts::EXE_EXTENSION);
        assert!(path.exists(), "{} is not built: cargo build --workspace", path.display());
        path
    }

    /// To be started with more than arguments.
    pub fn command(self) -> Command {
        Command::new(self.path())
    }

    /// What it answers.
    pub fn run(self, args: &[&str]) -> Output {
        self.command().args(args).output().unwrap()
    }

    /// What it prints on stdout; it has to succeed.
    pub fn succeeds(self, args: &[&str]) -> Vec<u8> {
        let output = self.run(args);
        assert_eq!(output.status.code(), Some(0), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
        output.stdout
    }

    /// What it prints as JSON; it has to succeed.
    pub fn json(self, args: &[&str]) -> Value {
        serde_json::from_slice(&self.succeeds(args)).unwrap()
    }

    /// What it prints as lines of JSON; it has to succeed.
    pub fn lines(self, args: &[&str]) -> Vec<Value> {
        let printed = String::from_utf8(self.succeeds(args)).unwrap();
        printed.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    }

    /// Exit code and stderr where it fails, or is used wrongly: then there is nothing on stdout.
    pub fn failure(self, args: &[&str]) -> (Option<i32>, String) {
        let output = self.run(args);
        assert!(output.stdout.is_empty(), "{args:?}: only machine output belongs on stdout");
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    }

    /// Stderr where it fails with exit code 1.
    pub fn refused(self, args: &[&str]) -> String {
        let (code, message) = self.failure(args);
        assert_eq!(code, Some(1), "{args:?}: {message}");
        message
    }
}
