//! A rustc that can type-check and borrow-check code for Xtensa.
//!
//! Upstream rustc knows the Xtensa targets but refuses `asm!` there (E0472), because the session has no asm architecture.
//! This is the ordinary nightly compiler with two changes, for Xtensa sessions only: `asm!` gets a stand-in architecture,
//! so that its operands are lowered and checked, and no machine code is made. Build scripts and procedural macros, which
//! run on the host, pass through unchanged.
#![feature(rustc_private)]

extern crate rustc_ast;
extern crate rustc_driver;
extern crate rustc_interface;
extern crate rustc_session;
extern crate rustc_target;

use std::process::ExitCode;

use rustc_driver::{Callbacks, Compilation};
use rustc_interface::interface::{Compiler, Config};
use rustc_session::EarlyDiagCtxt;
use rustc_session::config::ErrorOutputType;
use rustc_target::asm::InlineAsmArch;
use rustc_target::spec::Arch;

/// Has general registers of 32 bits that take the same types as Xtensa's, and needs `feature(asm_experimental_arch)` as
/// Xtensa does with Espressif's compiler.
const STAND_IN: InlineAsmArch = InlineAsmArch::Hexagon;

struct XtensaCheck;

impl Callbacks for XtensaCheck {
    /// Leaves code generation out: cargo asks for real libraries of core and alloc, whose data layout LLVM's Xtensa
    /// rejects.
    fn config(&mut self, config: &mut Config) {
        if config.opts.target_triple.tuple().starts_with("xtensa-") {
            config.opts.unstable_opts.no_codegen = true;
        }
    }

    fn after_crate_root_parsing(&mut self, compiler: &Compiler, _: &mut rustc_ast::Crate) -> Compilation {
        let session = &compiler.sess;
        if matches!(session.target.arch, Arch::Xtensa) && session.asm_arch.is_none() {
            let asm_arch = (&raw const session.asm_arch).cast_mut();
            // SAFETY: the crate root has just been parsed: no other thread has the session, and nobody has read the field.
            unsafe { asm_arch.write(Some(STAND_IN)) };
        }
        Compilation::Continue
    }
}

fn main() -> ExitCode {
    rustc_driver::init_rustc_env_logger(&EarlyDiagCtxt::new(ErrorOutputType::default()));
    let arguments: Vec<String> = std::env::args().collect();
    rustc_driver::catch_with_exit_code(|| rustc_driver::run_compiler(&arguments, &mut XtensaCheck))
}
