//! Reading a command line: what is refused names the option, the value and what is needed, in plain words.

use std::any::TypeId;
use std::error::Error as _;
use std::num::{IntErrorKind, ParseFloatError, ParseIntError};
use std::ops::RangeInclusive;
use std::time::Duration;

use clap::builder::TypedValueParser;
use clap::error::ErrorKind;
use clap::{Arg, Command, FromArgMatches};
use tactomo_physics::hertz::{FORCE_N, TIP_M};

use crate::output::message;

/// What was asked for on the command line; help and wrong use end the program.
pub fn read<T: FromArgMatches>(command: Command) -> T {
    let matches = taking_negative_numbers(command).try_get_matches();
    matches.and_then(|matches| T::from_arg_matches(&matches)).unwrap_or_else(|error| refuse(&error))
}

/// Options of a program that take numbers, but are refused one of them without saying what is needed: for the tests of programs.
pub fn untold(command: Command) -> Vec<String> {
    let command = taking_negative_numbers(command);
    let all = of_numbers(&command, &[command.get_name().to_owned()]);
    let tried = all
        .iter()
        .flat_map(|words| ["-1e308", "1e308", "nan", "0.5x"].map(|value| [&words[..], &[value.to_owned()]].concat()));
    let is_told = |words: &Vec<String>| match command.clone().try_get_matches_from(words) {
        Ok(_) => false,
        Err(error) => {
            let (told, libraries) = (told(&error), ["invalid digit", "invalid float", "number too"]);
            error.kind() == ErrorKind::ValueValidation && !libraries.iter().any(|words| told.contains(words))
        }
    };
    tried.filter(|words| !is_told(words)).map(|words| words.join(" ")).collect()
}

/// The options that take numbers, each as words of a command line.
fn of_numbers(command: &Command, before: &[String]) -> Vec<Vec<String>> {
    let numbers = [
        TypeId::of::<f64>(),
        TypeId::of::<u8>(),
        TypeId::of::<u16>(),
        TypeId::of::<u32>(),
        TypeId::of::<u64>(),
        TypeId::of::<usize>(),
        TypeId::of::<Duration>(),
    ];
    let is_number = |arg: &&Arg| numbers.iter().any(|number| arg.get_value_parser().type_id() == *number);
    let takes = |arg: &&Arg| has_value(arg) && is_number(arg);
    let option = |arg: &Arg| Some([before, &[format!("--{}", arg.get_long()?)]].concat());
    let own = command.get_arguments().filter(takes).filter_map(option);
    let subs =
        command.get_subcommands().flat_map(|sub| of_numbers(sub, &[before, &[sub.get_name().to_owned()]].concat()));
    own.chain(subs).collect()
}

/// The command, whose options take `-3` as a value: what is wrong with that is said of the value. Else the parser looks for an option of that name.
fn taking_negative_numbers(command: Command) -> Command {
    let take = |arg: Arg| if !arg.is_positional() && has_value(&arg) { arg.allow_negative_numbers(true) } else { arg };
    command.mut_args(take).mut_subcommands(taking_negative_numbers)
}

/// Whether an option has a value, or may have one.
fn has_value(arg: &Arg) -> bool {
    arg.get_action().takes_values() && arg.get_num_args().is_none_or(|count| count.takes_values())
}

/// Says why a command line is refused, or what was asked for by `--help` and `--version`, and ends the program.
fn refuse(error: &clap::Error) -> ! {
    if !error.use_stderr() {
        error.exit();
    }
    message!("{}", told(error).trim_end());
    std::process::exit(error.exit_code());
}

/// What the parser says, with words of its own where it has those of a library.
pub fn told(error: &clap::Error) -> String {
    let text = error.to_string();
    let Some(source) = error.source() else { return text };
    let words = if let Some(error) = source.downcast_ref::<ParseIntError>() {
        match error.kind() {
            IntErrorKind::PosOverflow | IntErrorKind::NegOverflow => "a smaller number is needed",
            _ => "a whole number of 0 or more is needed, in digits",
        }
    } else if source.is::<ParseFloatError>() {
        "a number is needed, such as 0.5"
    } else {
        return text;
    };
    // The value stands before its cause, and may say the same.
    match text.rsplit_once(&source.to_string()) {
        Some((before, after)) => format!("{before}{words}{after}"),
        None => text,
    }
}

/// Parses a number within a range; `what` it is, such as `a force (N)`.
pub fn number(what: &'static str, range: RangeInclusive<f64>) -> impl TypedValueParser<Value = f64> {
    move |text: &str| number_in(text, what, &range)
}

/// Parses a force (N).
pub fn force() -> impl TypedValueParser<Value = f64> {
    number("a force (N)", FORCE_N)
}

/// Parses a length of something that presses, such as a tip's radius (mm).
pub fn tip() -> impl TypedValueParser<Value = f64> {
    number("a length (mm)", 1e3 * TIP_M.start()..=1e3 * TIP_M.end())
}

/// Parses a time from zero on (s).
pub fn time_s() -> impl TypedValueParser<Value = f64> {
    number("a time (s)", 0.0..=*SECONDS.end())
}

/// A time above zero (s).
///
/// # Errors
/// What is needed.
pub fn seconds(text: &str) -> Result<Duration, String> {
    number_in(text, "a time (s)", &SECONDS).map(Duration::from_secs_f64)
}

/// Times that something lasts (s): from a frame to three years.
const SECONDS: RangeInclusive<f64> = 1e-3..=1e8;

/// A number within a range; `what` it is.
///
/// # Errors
/// What is needed.
pub fn number_in(text: &str, what: &str, range: &RangeInclusive<f64>) -> Result<f64, String> {
    let number = text.trim().parse::<f64>().ok().filter(|number| range.contains(number));
    number.ok_or_else(|| format!("{what} from {} to {} is needed", range.start(), range.end()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A command with options of every kind of number.
    fn command() -> Command {
        let option = |name: &'static str| Arg::new(name).long(name);
        let sub = Command::new("sub").arg(option("seed").value_parser(clap::value_parser!(u64)));
        Command::new("it")
            .arg(option("force").value_parser(number("a force (N)", 1e-3..=1e3)))
            .arg(option("nodes").value_parser(clap::value_parser!(u16).range(2..=9)))
            .arg(option("share").value_parser(clap::value_parser!(f64)))
            .arg(option("at").value_parser(clap::value_parser!(f64)))
            .arg(option("quick").action(clap::ArgAction::SetTrue))
            .subcommand(sub)
    }

    fn refused(words: &[&str]) -> String {
        let command = taking_negative_numbers(command());
        let matches = command.try_get_matches_from([&["it"], words].concat());
        told(&matches.expect_err("it is wrong"))
    }

    #[test]
    fn options_that_do_not_say_what_is_needed_are_found() {
        let share = ["nan", "1e308", "-1e308"].map(|value| format!("it --share {value}"));
        let found = untold(command());
        assert!(share.iter().all(|words| found.contains(words)), "{found:?}");
        assert!(
            !found.iter().any(|words| ["--force", "--nodes", "--seed"].iter().any(|name| words.contains(name))),
            "{found:?}"
        );
    }

    #[test]
    fn wrong_numbers_are_told_by_option_value_and_what_is_needed() {
        let force = "a force (N) from 0.001 to 1000 is needed";
        let whole = "a whole number of 0 or more is needed";
        for (words, named, needed) in [
            (&["--force", "-3"][..], "invalid value '-3' for '--force <force>'", force),
            (&["--force", "1e308"], "invalid value '1e308' for '--force <force>'", force),
            (&["--force", "-1e308"], "invalid value '-1e308' for '--force <force>'", force),
            (&["--force", "nan"], "invalid value 'nan' for '--force <force>'", force),
            (&["--force=-inf"], "invalid value '-inf' for '--force <force>'", force),
            (&["--nodes", "-1"], "'-1' for '--nodes <nodes>'", "-1 is not in 2..=9"),
            (&["--nodes", "2.5"], "'2.5' for '--nodes <nodes>'", whole),
            (&["--nodes", "99999999999999999999"], "for '--nodes <nodes>'", "a smaller number is needed"),
            (&["--share", "much"], "'much' for '--share <share>'", "a number is needed, such as 0.5"),
            (&["sub", "--seed", "-7"], "'-7' for '--seed <seed>'", whole),
            (&["sub", "--seed", "1e308"], "'1e308' for '--seed <seed>'", whole),
        ] {
            let text = refused(words);
            assert!(text.contains(named) && text.contains(needed), "{words:?}: {text}");
        }
        let taken = taking_negative_numbers(command()).try_get_matches_from(["it", "--at", "-2.5", "--quick"]);
        assert_eq!(taken.ok().and_then(|taken| taken.get_one::<f64>("at").copied()), Some(-2.5));
    }
}
