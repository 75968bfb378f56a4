//! Where a study ran.

use std::env::consts::{ARCH, OS};
use std::fs;
use std::thread::available_parallelism;

/// The machine and the program, for a report.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Machine {
    /// Processor, as it names itself.
    pub processor: String,
    /// Cores that the program may use.
    pub cores: usize,
    /// Operating system and architecture.
    pub system: String,
    /// Version of the program.
    pub version: String,
    /// Whether the program was built for speed.
    pub optimised: bool,
}

impl Machine {
    /// This one.
    pub fn this() -> Self {
        let processors = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        Self {
            processor: model_name(&processors).unwrap_or(ARCH).to_owned(),
            cores: available_parallelism().map_or(1, |count| count.get()),
            system: format!("{OS} {ARCH}"),
            version: format!("tactomo {}", env!("CARGO_PKG_VERSION")),
            optimised: !cfg!(debug_assertions),
        }
    }
}

/// The first name in Linux's list of processors.
fn model_name(processors: &str) -> Option<&str> {
    let line = processors.lines().find(|line| line.starts_with("model name"))?;
    line.split_once(':').map(|(_, name)| name.trim())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_processor_is_the_first_in_the_list() {
        assert_eq!(
            model_name("processor\t: 0\nmodel name\t: Some CPU @ 2 GHz\nmodel name\t: Other\n"),
            Some("Some CPU @ 2 GHz")
        );
        assert_eq!(model_name(""), None);
    }
}
