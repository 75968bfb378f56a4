//! The program, at work beside a test.

use std::io::{BufRead, BufReader, Read};
use std::path::PathBuf;
use std::process::{Child, ChildStderr, ChildStdout, Command, Stdio};

use tactomo_tests::TACTOMO;

/// `tactomo live` on the simulated board.
pub struct Live {
    pub child: Child,
    stderr: BufReader<ChildStderr>,
    said: String,
}

/// `tactomo` with such arguments.
pub fn tactomo(args: &[&str]) -> Command {
    let mut command = TACTOMO.command();
    command.args(args);
    command
}

/// A file name that nothing else has.
pub fn path(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("tactomo-{}-streams-{name}", std::process::id()))
}

impl Live {
    /// Starts it on a simulated board.
    pub fn start(args: &[&str]) -> Self {
        Self::of(&[&["--simulate", "--scene", "wandering"], args].concat())
    }

    /// Starts it without a page that opens.
    pub fn of(args: &[&str]) -> Self {
        let all = [&["live", "--no-open"], args].concat();
        let mut child = tactomo(&all).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let stderr = BufReader::new(child.stderr.take().unwrap());
        Self { child, stderr, said: String::new() }
    }

    /// What follows `before` in a line that it says, up to a blank.
    pub fn told(&mut self, before: &str) -> String {
        loop {
            let mut line = String::new();
            assert_ne!(self.stderr.read_line(&mut line).unwrap(), 0, "it ended before: {}", self.said);
            self.said.push_str(&line);
            if let Some((_, rest)) = line.split_once(before) {
                return rest.split_whitespace().next().unwrap().to_owned();
            }
        }
    }

    pub fn stdout(&mut self) -> BufReader<ChildStdout> {
        BufReader::new(self.child.stdout.take().unwrap())
    }

    /// Waits for its end: its exit code, and all that it said.
    pub fn end(mut self) -> (Option<i32>, String) {
        self.stderr.read_to_string(&mut self.said).unwrap();
        (self.child.wait().unwrap().code(), self.said)
    }
}
