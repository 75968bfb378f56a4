//! Examples that `--help` prints run as they are printed, from the repository's root: those that need no board and no minutes.

#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should, and says where")]

use std::path::{Path, PathBuf};
use std::process::Command;

use tactomo::detector::Detector;

use tactomo_tests::TACTOMO;

/// Commands all of whose examples run here.
const COMMANDS: [&[&str]; 2] = [&["detector"], &["forward"]];

/// A folder like the repository's root, for what examples write, with a detector of one's own that they take.
struct Root(PathBuf);

impl Root {
    fn new() -> Self {
        let folder = std::env::temp_dir().join(format!("tactomo-examples-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let repository = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
        for part in ["tests", "host"] {
            std::os::unix::fs::symlink(repository.join(part), folder.join(part)).unwrap();
        }
        std::fs::write(folder.join("my.toml"), Detector::default().to_toml()).unwrap();
        Self(folder)
    }
}

impl Drop for Root {
    fn drop(&mut self) {
        drop(std::fs::remove_dir_all(&self.0));
    }
}

/// The examples of a command's help, as a shell takes them: three spaces begin a remark.
fn examples(command: &[&str]) -> Vec<String> {
    let help = TACTOMO.command().args(command).arg("--help").output().unwrap();
    let help = String::from_utf8(help.stdout).unwrap();
    let lines = help.lines().filter_map(|line| line.strip_prefix("  tactomo "));
    lines.map(|line| line.split("   ").next().unwrap_or_default().to_owned()).collect()
}

#[cfg(unix)]
#[test]
fn they_run_as_printed() {
    let root = Root::new();
    for command in COMMANDS {
        let examples = examples(command);
        assert!(examples.len() >= 2, "{command:?} has {} examples", examples.len());
        for example in examples {
            let ran = Command::new("sh")
                .current_dir(&root.0)
                .args(["-c", &format!("'{}' {example}", TACTOMO.path().display())])
                .output()
                .unwrap();
            let said = String::from_utf8_lossy(&ran.stderr);
            assert!(ran.status.success(), "{example}: {said}");
        }
    }
}
