//! The boards' firmware: which tool flashes it, and where its image is once it is built.

use std::path::{Path, PathBuf};

use clap::ValueEnum;

/// Folder of the boards' workspace, from the repository's root.
const BOARDS: &str = "firmware/boards";

/// A board that can be flashed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Board {
    /// ESP-WROOM-32: sixteen ADC inputs.
    Esp32,
    /// ESP32-C3: one ADC input, native USB.
    Esp32c3,
}

/// A program that flashes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tool {
    /// Its name on the search path.
    pub program: &'static str,
    /// How it is installed.
    pub install: &'static str,
}

const ESPFLASH: Tool = Tool {
    program: "espflash",
    install: "`cargo install espflash --locked`, or put a binary from https://github.com/esp-rs/espflash/releases on the search path",
};

impl Board {
    /// Its name, as in its folder and in its Hello.
    pub fn name(self) -> &'static str {
        match self {
            Self::Esp32 => "esp32",
            Self::Esp32c3 => "esp32c3",
        }
    }

    fn target(self) -> &'static str {
        match self {
            Self::Esp32 => "xtensa-esp32-none-elf",
            Self::Esp32c3 => "riscv32imc-unknown-none-elf",
        }
    }

    /// What flashes it.
    pub fn tool(self) -> Tool {
        ESPFLASH
    }

    /// What the tool is called with for an image, and a serial port if one is named.
    pub fn arguments(self, image: &Path, port: Option<&str>) -> Vec<String> {
        let mut arguments = vec!["flash".to_owned(), "--chip".to_owned(), self.name().to_owned()];
        arguments.extend(port.into_iter().flat_map(|port| ["--port".to_owned(), port.to_owned()]));
        arguments.push(image.display().to_string());
        arguments
    }

    /// Where its image is built, below the boards' workspace.
    pub fn image(self) -> PathBuf {
        ["target", self.target(), "release"].iter().collect::<PathBuf>().join(format!("tactomo-{}", self.name()))
    }

    /// How its image is built.
    pub fn build(self) -> String {
        let once = match self {
            Self::Esp32 => {
                "with Espressif's toolchain (`cargo install espup --locked`, `espup install`, `. ~/export-esp.sh`), "
            }
            Self::Esp32c3 => "",
        };
        format!("{once}`cd {BOARDS}/{} && cargo build --release`", self.name())
    }
}

/// The boards' workspace of the repository that `from` lies in.
pub fn workspace(from: &Path) -> Option<PathBuf> {
    from.ancestors().map(|folder| folder.join(BOARDS)).find(|folder| folder.join("Cargo.toml").is_file())
}
