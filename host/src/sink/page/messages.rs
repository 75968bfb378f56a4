//! What a page may ask, parsed strictly: names and shapes other than these, numbers out of range and lists that are too long
//! are refused.

use serde::de::Error;
use serde::{Deserialize, Deserializer};

use super::PageSetup;
use crate::run::Request;
use crate::run::calibration::Calibrate;
use tactomo_board::link::Control;
use tactomo_board::session::RequestedSettings;
use tactomo_physics::scene::{Contact, SceneName};
use tactomo_physics::simulate::Fault;
use tactomo_touch::solve::Method;

/// Most fingers of a page: two hands.
const MAX_FINGERS: usize = 10;

/// Most faults at a time.
const MAX_FAULTS: usize = 16;

/// Most bytes of a mark.
const MAX_MARK: usize = 1000;

/// Slowest and fastest play of a recording, beside as fast as it can be read.
const SPEEDS: std::ops::RangeInclusive<f64> = 0.01..=100.0;

/// What a page asks.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum PageMessage {
    /// The last message is dealt with.
    Taken,
    /// Takes the baseline anew.
    Rezero,
    /// Reads the touch by the method of this name.
    Solver(#[serde(deserialize_with = "by_name")] Method),
    /// Presses on the simulated detector with these fingers and no others.
    Press(Vec<Place>),
    /// Begins a recording, or ends it.
    Record(bool),
    /// Sets a mark in the recording, with what is said of it.
    Mark(String),
    /// Asks the board for other settings.
    Settings(Settings),
    /// Plays another scene on the simulated detector.
    Scene(#[serde(deserialize_with = "by_name")] SceneName),
    /// Gives the simulated detector these faults and no others.
    Faults(Vec<FaultText>),
    /// Holds the recording, or goes on.
    Pause(bool),
    /// Goes on with the recording from here (s).
    SeekS(f64),
    /// Plays the recording so many times as fast; `null` for as fast as it can be read.
    Speed(Option<f64>),
    /// Begins the recording again where it ends, or not.
    Loop(bool),
    /// Asks something of the calibration by rubbing.
    Calibrate(Calibrate),
}

/// A place on the detector's map (m).
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Place {
    x_m: f64,
    y_m: f64,
}

/// Settings of the scan; what is not given stays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Settings {
    settle_us: Option<u16>,
    average_log2: Option<u8>,
    max_frames_per_s: Option<u16>,
    select_us: Option<u16>,
    discarded: Option<u8>,
}

/// A fault as it is written on the command line: `open:3`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
pub(super) struct FaultText(#[serde(deserialize_with = "by_name")] Fault);

/// A value by the name that it has on the command line.
fn by_name<'de, D: Deserializer<'de>, T: std::str::FromStr<Err: std::fmt::Display>>(name: D) -> Result<T, D::Error> {
    String::deserialize(name)?.parse().map_err(D::Error::custom)
}

impl PageMessage {
    /// Parses what a page sent.
    ///
    /// # Errors
    /// With what the page is told before its socket is closed.
    pub(super) fn parse(text: &str) -> Result<Self, &'static str> {
        serde_json::from_str(text).map_err(|_| "a message that this version does not know: reload the page")
    }

    /// What this asks of the program; `None` for what the socket does itself, and for presses beside the detector.
    ///
    /// # Errors
    /// With what the page is told before its socket is closed.
    pub(super) fn request(self, setup: &PageSetup) -> Result<Option<Request>, &'static str> {
        Ok(Some(match self {
            Self::Taken => return Ok(None),
            Self::Rezero => Request::Rezero,
            Self::Solver(method) => Request::Solver(method),
            Self::Calibrate(ask) => Request::Calibrate(ask),
            Self::Record(on) => Request::Record(on),
            Self::Mark(text) if text.len() > MAX_MARK => return Err("a mark is too long"),
            Self::Mark(text) => Request::Mark(text),
            Self::Settings(settings) => Request::Settings(settings.requested()?),
            Self::Press(places) => match press(&places, setup)? {
                Some(contacts) => Request::Control(Control::Press(contacts)),
                None => return Ok(None),
            },
            other => Request::Control(other.control(setup)?),
        }))
    }

    fn control(self, setup: &PageSetup) -> Result<Control, &'static str> {
        Ok(match self {
            Self::Scene(scene) => Control::Scene(simulated(setup, scene)?),
            Self::Faults(faults) => Control::Faults(simulated(setup, checked(&faults, setup)?)?),
            Self::Pause(on) => Control::Pause(on),
            Self::SeekS(time_s) if time_s >= 0.0 => Control::Seek(time_s),
            Self::Speed(None) => Control::Speed(f64::INFINITY),
            Self::Speed(Some(speed)) if SPEEDS.contains(&speed) => Control::Speed(speed),
            Self::Loop(on) => Control::Loop(on),
            _ => return Err("a number that is out of range"),
        })
    }
}

impl Settings {
    fn requested(self) -> Result<RequestedSettings, &'static str> {
        let Self { settle_us, average_log2, max_frames_per_s, select_us, discarded } = self;
        let asked = RequestedSettings { settle_us, average_log2, max_frames_per_s, select_us, discarded };
        let refusal = "a board averages at most 256 conversions, discards at most 15, and waits at most 10000 us after it selects an electrode";
        if asked.is_valid() { Ok(asked) } else { Err(refusal) }
    }
}

/// `asked`, if the board is simulated.
fn simulated<T>(setup: &PageSetup, asked: T) -> Result<T, &'static str> {
    setup.finger.map(|_| asked).ok_or("only a simulated board can be asked this")
}

fn checked(faults: &[FaultText], setup: &PageSetup) -> Result<Vec<Fault>, &'static str> {
    let electrodes = setup.detector.electrodes.len();
    let known = |FaultText(fault): &FaultText| fault.check(electrodes).map(|()| *fault);
    match faults.len() {
        ..=MAX_FAULTS => faults.iter().map(known).collect::<Result<_, _>>().map_err(|_| "there is no such electrode"),
        _ => Err("too many faults"),
    }
}

/// Contacts of the fingers that are on the detector; `None` if there are fingers and none is.
fn press(places: &[Place], setup: &PageSetup) -> Result<Option<Vec<Contact>>, &'static str> {
    let finger = setup.finger.ok_or("only a simulated board can be pressed from the page")?;
    if places.len() > MAX_FINGERS {
        return Err("too many fingers");
    }
    let [low, high] = setup.detector.outline.bounds();
    let contact = |place: &Place| {
        let within = (low[0]..=high[0]).contains(&place.x_m) && (low[1]..=high[1]).contains(&place.y_m);
        let [x_m, y_m, z_m] = setup.detector.place_m([place.x_m, place.y_m]).filter(|_| within)?;
        Some(Contact { x_m, y_m, z_m, radius_m: finger.radius_m, conductance_s: finger.conductance_s })
    };
    let contacts: Vec<_> = places.iter().filter_map(contact).collect();
    Ok((places.is_empty() || !contacts.is_empty()).then_some(contacts))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sink::page::Finger;
    use proptest::prelude::*;
    use tactomo_physics::detector::Detector;

    fn setup(finger: Option<Finger>) -> PageSetup {
        PageSetup {
            detector: Detector::preset(Detector::DEFAULT).expect("the default is a preset"),
            mesh: Default::default(),
            usual_radius_m: 0.003,
            source: "a test".to_owned(),
            finger,
        }
    }

    fn simulated_setup() -> PageSetup {
        setup(Some(Finger { radius_m: 0.003, conductance_s: 1e-4 }))
    }

    fn asks(text: &str) -> Result<Option<Request>, &'static str> {
        PageMessage::parse(text)?.request(&simulated_setup())
    }

    #[test]
    fn each_message_becomes_its_request() {
        let control = |control| Ok(Some(Request::Control(control)));
        assert_eq!(asks(r#""taken""#), Ok(None));
        assert_eq!(asks(r#""rezero""#), Ok(Some(Request::Rezero)));
        assert_eq!(asks(r#"{"solver":"noser"}"#), Ok(Some(Request::Solver(Method::Noser))));
        assert_eq!(asks(r#"{"record":true}"#), Ok(Some(Request::Record(true))));
        assert_eq!(asks(r#"{"mark":"slipped"}"#), Ok(Some(Request::Mark("slipped".into()))));
        assert!(asks(&format!(r#"{{"mark":"{}"}}"#, "x".repeat(1001))).is_err());
        assert_eq!(asks(r#"{"calibrate":"begin"}"#), Ok(Some(Request::Calibrate(Calibrate::Begin))));
        let finger = |x, y| Contact::flat(x, y, 0.003, 1e-4);
        assert_eq!(
            asks(r#"{"press":[{"x_m":0.01,"y_m":-2e-3},{"x_m":0.5,"y_m":0},{"x_m":0,"y_m":0}]}"#),
            control(Control::Press(vec![finger(0.01, -2e-3), finger(0.0, 0.0)]))
        );
        assert_eq!(asks(r#"{"press":[]}"#), control(Control::Press(Vec::new())));
        assert_eq!(asks(r#"{"press":[{"x_m":0.031,"y_m":0}]}"#), Ok(None), "beside the detector");
        assert_eq!(asks(r#"{"scene":"five-fingers"}"#), control(Control::Scene(SceneName::FiveFingers)));
        assert_eq!(asks(r#"{"faults":["open:3"]}"#), control(Control::Faults(vec![Fault::Open { electrode: 3 }])));
        assert_eq!(asks(r#"{"pause":true}"#), control(Control::Pause(true)));
        assert_eq!(asks(r#"{"seek_s":1.5}"#), control(Control::Seek(1.5)));
        assert_eq!(asks(r#"{"speed":0.25}"#), control(Control::Speed(0.25)));
        assert_eq!(asks(r#"{"speed":null}"#), control(Control::Speed(f64::INFINITY)));
        assert_eq!(asks(r#"{"loop":false}"#), control(Control::Loop(false)));
        let settings =
            RequestedSettings { average_log2: Some(3), select_us: Some(17), discarded: Some(1), ..Default::default() };
        let text = r#"{"settings":{"average_log2":3,"select_us":17,"discarded":1}}"#;
        assert_eq!(asks(text), Ok(Some(Request::Settings(settings))));
    }

    #[test]
    fn other_messages_are_refused() {
        let many = format!(r#"{{"press":[{}]}}"#, [r#"{"x_m":0,"y_m":0}"#; MAX_FINGERS + 1].join(","));
        let faults = format!(r#"{{"faults":[{}]}}"#, [r#""open:3""#; MAX_FAULTS + 1].join(","));
        for text in [
            "",
            "{}",
            "[]",
            "rezero",
            r#""flash""#,
            r#"{"press":{}}"#,
            r#""press""#,
            r#"{"press":{"x_m":0,"y_m":0}}"#,
            r#"{"press":[{"x_m":1e999,"y_m":0}]}"#,
            r#"{"press":[{"x_m":0,"y_m":0,"z_m":0}]}"#,
            r#"{"solver":"guess"}"#,
            r#"{"scene":"party"}"#,
            r#"{"faults":["open"]}"#,
            r#"{"faults":["open:16"]}"#,
            r#"{"seek_s":-1}"#,
            r#"{"seek_s":null}"#,
            r#"{"speed":0}"#,
            r#"{"speed":1000}"#,
            r#"{"speed":"max"}"#,
            r#"{"settings":{"average_log2":9}}"#,
            r#"{"settings":{"select_us":10001}}"#,
            r#"{"settings":{"discarded":16}}"#,
            r#"{"settings":{"settle_us":70000}}"#,
            r#"{"settings":{"baud":1}}"#,
            r#"{"record":1}"#,
            r#"{"calibrate":"press"}"#,
            r#"{"calibrate":true}"#,
            r#"{"record":true,"pause":true}"#,
            &many,
            &faults,
        ] {
            assert!(asks(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_real_board_is_neither_pressed_nor_given_scenes_or_faults() {
        for text in [r#"{"press":[]}"#, r#"{"scene":"ring"}"#, r#"{"faults":[]}"#] {
            assert!(PageMessage::parse(text).expect(text).request(&setup(None)).is_err(), "{text}");
        }
    }

    /// Texts that look like messages.
    fn message_like() -> impl Strategy<Value = String> {
        let leaf = prop_oneof![
            any::<f64>().prop_map(|number| format!("{number:e}")),
            any::<i64>().prop_map(|number| number.to_string()),
            "\"(max|open:[0-9]{1,3}|short:[0-9],[0-9]|ring|auto|[a-z]{0,9})\"",
            Just("true".to_owned()),
            Just("null".to_owned()),
        ];
        let value = leaf.prop_recursive(3, 24, 6, |inner| {
            prop_oneof![
                prop::collection::vec(inner.clone(), 0..14).prop_map(|all| format!("[{}]", all.join(","))),
                (inner.clone(), inner.clone()).prop_map(|(x, y)| format!("{{\"x_m\":{x},\"y_m\":{y}}}")),
                inner.prop_map(|value| format!("{{\"average_log2\":{value}}}")),
            ]
        });
        let name = "(press|solver|scene|faults|settings|record|pause|seek_s|speed|loop|other)";
        (name, value).prop_map(|(name, value)| format!("{{\"{name}\":{value}}}"))
    }

    proptest! {
        #[test]
        fn nothing_that_a_page_sends_breaks_the_parser(text in ".{0,200}") {
            let _ = asks(&text);
        }

        #[test]
        fn whatever_is_taken_is_within_its_bounds(text in message_like()) {
            match asks(&text) {
                Ok(Some(Request::Control(Control::Press(contacts)))) => {
                    prop_assert!(contacts.len() <= MAX_FINGERS);
                    prop_assert!(contacts.iter().all(|contact| contact.x_m.abs() <= 0.03 && contact.y_m.abs() <= 0.03));
                }
                Ok(Some(Request::Control(Control::Speed(speed)))) => prop_assert!(speed > 0.0, "{}", text),
                Ok(Some(Request::Control(Control::Seek(time_s)))) => prop_assert!(time_s >= 0.0 && time_s.is_finite()),
                Ok(Some(Request::Control(Control::Faults(faults)))) => {
                    prop_assert!(faults.iter().all(|fault| fault.check(16).is_ok()));
                }
                Ok(Some(Request::Settings(settings))) => {
                    prop_assert!(settings.is_valid());
                }
                _ => {}
            }
        }
    }
}
