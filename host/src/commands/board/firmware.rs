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
    /// ESP32-C6: one ADC input, native USB.
    Esp32c6,
    /// STM32F405: sixteen ADC inputs, native USB.
    Stm32f405,
}

/// A program that flashes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tool {
    /// Its name on the search path.
    pub program: &'static str,
    /// How it is installed, and what else there is.
    pub install: &'static str,
    /// What a board that does not answer to it wants.
    pub advice: &'static str,
}

const ESPFLASH: Tool = Tool {
    program: "espflash",
    install: "`cargo install espflash --locked`, or put a binary from https://github.com/esp-rs/espflash/releases on the search path",
    advice: "A port that is busy is open in another program; a chip that does not answer wants its BOOT button held while it is plugged in or \
             reset",
};

const PROBE_RS: Tool = Tool {
    program: "probe-rs",
    install: "`cargo install probe-rs-tools --locked`, or a binary from https://github.com/probe-rs/probe-rs/releases, with a debug probe such as \
              an ST-Link at the board's pins SWDIO and SWCLK; without a probe see docs/hardware.md",
    advice: "Is the probe plugged in, SWDIO, SWCLK and ground connected, and has the board power?",
};

impl Board {
    /// Its name, as in its folder and in its Hello.
    pub fn name(self) -> &'static str {
        match self {
            Self::Esp32 => "esp32",
            Self::Esp32c3 => "esp32c3",
            Self::Esp32c6 => "esp32c6",
            Self::Stm32f405 => "stm32f405",
        }
    }

    fn target(self) -> &'static str {
        match self {
            Self::Esp32 => "xtensa-esp32-none-elf",
            Self::Esp32c3 => "riscv32imc-unknown-none-elf",
            Self::Esp32c6 => "riscv32imac-unknown-none-elf",
            Self::Stm32f405 => "thumbv7em-none-eabihf",
        }
    }

    /// What flashes it.
    pub fn tool(self) -> Tool {
        match self {
            Self::Esp32 | Self::Esp32c3 | Self::Esp32c6 => ESPFLASH,
            Self::Stm32f405 => PROBE_RS,
        }
    }

    /// Whether it is flashed through its serial port.
    pub fn is_flashed_by_port(self) -> bool {
        self.tool() == ESPFLASH
    }

    /// What the tool is called with for an image, and a serial port if one is named.
    pub fn arguments(self, image: &Path, port: Option<&str>) -> Vec<String> {
        let mut arguments: Vec<&str> = match self {
            Self::Esp32 | Self::Esp32c3 | Self::Esp32c6 => vec!["flash", "--chip", self.name()],
            Self::Stm32f405 => vec!["download", "--chip", "STM32F405RG"],
        };
        arguments.extend(port.into_iter().flat_map(|port| ["--port", port]));
        arguments.into_iter().map(str::to_owned).chain([image.display().to_string()]).collect()
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
                    .to_owned()
            }
            _ => format!("`rustup target add {}`, then ", self.target()),
        };
        format!("{once}`cd {BOARDS}/{} && cargo build --release`", self.name())
    }
}

/// The boards' workspace of the repository that `from` lies in.
pub fn workspace(from: &Path) -> Option<PathBuf> {
    from.ancestors().map(|folder| folder.join(BOARDS)).find(|folder| folder.join("Cargo.toml").is_file())
}
