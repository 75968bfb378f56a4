//! `tactomo board` as a user calls it: a flashing tool that is a script, and checks of the simulated board.
#![cfg(unix)]
#![allow(clippy::unwrap_used, reason = "a test that unwraps fails where it should, and says where")]

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Output;

use serde_json::Value;
use tactomo_tests::TACTOMO;

/// A folder of its own with a tool that writes down what it is called with, and leaves with such a code.
struct Tools(PathBuf);

impl Tools {
    fn new(test: &str, program: &str, code: i32) -> Self {
        let folder = std::env::temp_dir().join(format!("tactomo-{}-board-{test}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let tool = folder.join(program);
        let script = format!("#!/bin/sh\necho \"$@\" > \"{}\"\nexit {code}\n", folder.join("called").display());
        fs::write(&tool, script).unwrap();
        fs::set_permissions(&tool, fs::Permissions::from_mode(0o755)).unwrap();
        Self(folder)
    }

    /// A file beside the tool.
    fn file(&self, name: &str, content: &[u8]) -> PathBuf {
        let path = self.0.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, content).unwrap();
        path
    }

    /// What the tool was called with.
    fn called(&self) -> Option<String> {
        fs::read_to_string(self.0.join("called")).ok().map(|text| text.trim().to_owned())
    }

    fn flash(&self, args: &[&str], here: &Path) -> (Option<i32>, String) {
        let mut command = TACTOMO.command();
        command.args(["board", "flash"]).args(args).current_dir(here).env("PATH", &self.0);
        let output = command.output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    }
}

impl Drop for Tools {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// An ELF file of a processor, with 16 bytes of code at an address and so much data at another, that begins at a third.
fn elf(machine: u16, code_at: u32, (data_at, data): (u32, u32), entry: u32) -> Vec<u8> {
    let word = |value: u32| value.to_le_bytes();
    let mut bytes =
        [&b"\x7fELF\x01\x01\x01"[..], &[0; 9], &2u16.to_le_bytes(), &machine.to_le_bytes(), &word(1)].concat();
    bytes.extend([word(entry), word(52), word(0), word(0)].concat());
    for half in [52u16, 32, 2, 40, 0, 0] {
        bytes.extend(half.to_le_bytes());
    }
    for [from, at, length, flags] in [[116, code_at, 16, 5], [132, data_at, data, 4]] {
        for field in [1, from, at, at, length, length, flags, 4] {
            bytes.extend(word(field));
        }
    }
    bytes.resize(132 + data as usize, 0);
    bytes
}

/// An image that a board could run.
fn image_of(board: &str) -> Vec<u8> {
    let (machine, code_at, data_at) = match board {
        "esp32" => (94, 0x400d_0020, 0x3ffb_0000),
        "esp32c3" => (243, 0x4200_0020, 0x3fc8_0000),
        "esp32c6" => (243, 0x4200_0020, 0x4080_0000),
        _ => (40, 0x0800_0000, 0x2000_0000),
    };
    elf(machine, code_at, (data_at, 64), code_at + 9)
}

#[test]
fn an_image_for_another_board_or_none_is_told_before_a_tool_is_called() {
    let tools = Tools::new("images", "espflash", 0);
    let of_c3 = image_of("esp32c3");
    let long = elf(243, 0x4200_0020, (0x3c00_0000, 0x3b_0000), 0x4200_0020);
    let part = [&of_c3[..16], &1u16.to_le_bytes(), &of_c3[18..]].concat();
    for (image, board, told) in [
        (&b""[..], "esp32c3", "it is empty"),
        (b"\xe9 an image that espflash saved", "esp32c3", "no ELF file"),
        (&of_c3[..20], "esp32c3", "cut off"),
        (&of_c3[..140], "esp32c3", "cut off"),
        (&fs::read(TACTOMO.path()).unwrap()[..4096], "esp32c3", "it is for a computer"),
        (&of_c3, "esp32", "for the processor RISC-V, and the esp32 has Xtensa"),
        (&image_of("stm32f405"), "esp32c3", "for the processor ARM"),
        (&of_c3, "esp32c6", "0x3fc80000, where the esp32c6 has no memory"),
        (&image_of("esp32c6"), "esp32c3", "built for another chip"),
        (
            &elf(40, 0x0800_0000, (0x080d_ffff, 8), 0x0800_0000),
            "stm32f405",
            "0x080dffff, where the stm32f405 has no memory",
        ),
        (&elf(243, 0x4200_0020, (0x3fc8_0000, 8), 0), "esp32c3", "it begins at 0x00000000"),
        (&elf(243, 0x4200_0020, (0x3fc8_0000, 8), 0x3fc8_0000), "esp32c3", "where it has no code"),
        (&part, "esp32c3", "not linked yet"),
        (&long, "esp32c3", "3866640 bytes of flash, and there are 3866624"),
    ] {
        let path = tools.file("some.elf", image);
        let (code, message) = tools.flash(&[board, "--image", path.to_str().unwrap()], &tools.0);
        assert!(code == Some(1) && message.contains(told), "{board}, {told}: {message}");
        assert!(message.contains("some.elf is no image for the board") && message.contains("cargo build"), "{message}");
    }
    assert_eq!(tools.called(), None);
}

#[test]
fn an_image_is_handed_to_the_tool_of_its_chip_and_the_command_is_shown() {
    for (board, program, port, expected) in [
        ("esp32", "espflash", Some("/dev/ttyUSB7"), "flash --chip esp32 --port /dev/ttyUSB7"),
        ("esp32c6", "espflash", None, "flash --chip esp32c6"),
        ("stm32f405", "probe-rs", None, "download --chip STM32F405RG"),
    ] {
        let tools = Tools::new(board, program, 0);
        let image = tools.file("image.elf", &image_of(board));
        let image = image.to_str().unwrap();
        let mut args = vec![board, "--image", image];
        args.extend(port.into_iter().flat_map(|port| ["--port", port]));
        let (code, told) = tools.flash(&args, &tools.0);
        assert_eq!(code, Some(0), "{told}");
        let expected = format!("{expected} {image}");
        assert_eq!(tools.called().as_deref(), Some(&*expected));
        assert!(told.contains(&format!("{program} {expected}")) && told.contains("board check"), "{told}");
    }
}

#[test]
fn the_image_that_was_built_in_the_repository_is_found_from_any_folder_of_it() {
    let tools = Tools::new("built", "espflash", 0);
    tools.file("firmware/boards/Cargo.toml", b"");
    let below = tools.file("docs/page.md", b"");
    let here = below.parent().unwrap();
    let (code, told) = tools.flash(&["esp32c3"], here);
    assert!(code == Some(1) && tools.called().is_none(), "{told}");
    assert!(
        told.contains("not built yet") && told.contains("cd firmware/boards/esp32c3 && cargo build --release"),
        "{told}"
    );
    tools.file("firmware/boards/target/riscv32imc-unknown-none-elf/release/tactomo-esp32c3", &image_of("esp32c3"));
    let (code, told) = tools.flash(&["esp32c3"], here);
    assert_eq!(code, Some(0), "{told}");
    assert!(tools.called().unwrap().ends_with("release/tactomo-esp32c3"));
}

#[test]
fn what_is_missing_or_fails_is_told_with_what_to_do() {
    let other = Tools::new("other", "some-tool", 0);
    let image = other.file("image.elf", &image_of("esp32"));
    let image = image.to_str().unwrap();
    let arm = other.file("arm.elf", &image_of("stm32f405"));
    let arm = arm.to_str().unwrap();
    let failing = Tools::new("failing", "espflash", 3);
    for (tools, args, told) in [
        (&other, &["esp32", "--image", image][..], "cargo install espflash --locked"),
        (&other, &["stm32f405", "--image", arm], "cargo install probe-rs-tools --locked"),
        (&other, &["esp32", "--image", "no.elf"], "there is no image no.elf"),
        (&other, &["esp32"], "--image FILE"),
        (&other, &["stm32f405", "--image", image, "--port", "/dev/ttyACM0"], "leave out --port"),
        (&failing, &["esp32", "--image", image], "BOOT button"),
    ] {
        let (code, message) = tools.flash(args, &other.0);
        assert!(code == Some(1) && message.contains(told), "{args:?}: {message}");
    }
    assert_eq!(other.called(), None);
}

fn check(args: &[&str]) -> Output {
    let mut command = TACTOMO.command();
    command.args(["board", "check", "--simulate"]).args(args).output().unwrap()
}

#[test]
fn a_sound_board_passes_and_a_faulty_one_fails_with_its_electrodes_named() {
    let sound = check(&["--json"]);
    assert_eq!(sound.status.code(), Some(0), "{}", String::from_utf8_lossy(&sound.stderr));
    let sound: Value = serde_json::from_slice(&sound.stdout).unwrap();
    assert_eq!((&sound["sound"], &sound["presses"]), (&true.into(), &4.into()));
    let settling = &sound["settling"];
    assert_eq!((&settling["board"], &settling["suits"]), (&"esp32".into(), &true.into()));
    assert!(settling["pad_ohm"].as_f64().is_some_and(|ohm| (ohm - 550.0).abs() < 5.0), "{settling}");

    let faulty = check(&["--json", "--fault", "short:2,7", "--seed", "3"]);
    assert_eq!(faulty.status.code(), Some(1));
    let faulty: Value = serde_json::from_slice(&faulty.stdout).unwrap();
    let electrodes = faulty["electrodes"].as_array().unwrap();
    let wrong: Vec<_> = electrodes.iter().filter(|electrode| electrode["state"] != "ok").collect();
    assert_eq!(wrong.len(), 2);
    assert_eq!(
        (&wrong[0]["electrode"], &wrong[0]["state"], &wrong[0]["with"][0]),
        (&2.into(), &"shorted".into(), &7.into())
    );
    assert_eq!(wrong[1]["pins"]["grounded_by"], "S8A");

    let text = check(&["--fault", "open:3"]);
    let (told, asked) = (String::from_utf8(text.stdout).unwrap(), String::from_utf8(text.stderr).unwrap());
    assert_eq!(text.status.code(), Some(1));
    assert!(told.contains(" 3o") && told.contains("electrode 3: It is neither grounded nor read"), "{told}");
    assert!(asked.contains("Lay a hand") && asked.contains("error: one electrode"), "{asked}");
}
