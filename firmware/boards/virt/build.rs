//! Hands the linker the memory layout at the root of the repository, and the scripts of riscv-rt and defmt.

use std::path::Path;

fn main() {
    let boards = Path::new(env!("CARGO_MANIFEST_DIR"));
    let root = boards.ancestors().nth(3).expect("the board lies three folders below the root");
    println!("cargo:rustc-link-search={}", root.display());
    println!("cargo:rustc-link-arg=-Tmemory.x");
    println!("cargo:rustc-link-arg=-Tlink.x");
    println!("cargo:rustc-link-arg=-Tdefmt.x");
    println!("cargo:rerun-if-changed={}", root.join("memory.x").display());
}
