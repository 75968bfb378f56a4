//! Errors as one line.
//!
//! What an error says is its own part only; what caused it is its [`source`](Error::source) and says its own part. Whoever shows
//! an error shows all of them, each once: the program at its end, Python in its exceptions, and [`with_causes`] wherever one line is logged or drawn.

use std::error::Error;

/// What an error says, and after it what each of its causes says, separated by colons.
pub fn with_causes(error: &(dyn Error + '_)) -> String {
    let mut line = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        line.push_str(": ");
        line.push_str(&error.to_string());
        cause = error.source();
    }
    line
}
