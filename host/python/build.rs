//! Symbols of the interpreter are found where the module is loaded: linkers that mind are told so.

fn main() {
    pyo3_build_config::add_extension_module_link_args();
}
