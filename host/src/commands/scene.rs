//! Arguments that say what touches a simulated detector, and what is wrong with it.

use std::path::Path;

use anyhow::{Context, ensure};
use clap::builder::TypedValueParser;
use tactomo::detector::Detector;
use tactomo::hertz::{self, Hertz, RATIO, Skin, Surface, YOUNG_PA};
use tactomo::scene::{Fingertip, Hand, Scene, SceneName, Shape, Touch};
use tactomo::simulate::Fault;
use tactomo::table::file::Format;

use super::as_built::AsBuiltArgs;
use tactomo_cli::options;
use tactomo_cli::output::message;

/// Default seed.
const SEED: u64 = 1;
/// A list of touches, some hundred bytes each.
const TOUCHES: Format = Format::new("a list of touches", 16 << 20);

/// A scene, its hand and faults.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Simulated touch")]
pub struct SceneArgs {
    /// What touches: rest, wandering, single, several, wide, ring, line, five-fingers, rolling-ball, moving, changing-force; and the paper's
    /// demonstrations, each on its own detector unless --detector is given: gripper, display, pointer, texture, hand
    #[arg(long, value_name = "NAME")]
    pub scene: Option<SceneName>,
    /// Force of the scene's firmest press (N) [default: conductances relative to the detector's]
    #[arg(long, value_name = "NEWTONS", value_parser = options::force())]
    force: Option<f64>,
    /// Radius of fingertips and bars in the scene (mm) [default: 8, or a seventh of a smaller detector's side]
    #[arg(long, value_name = "MM", value_parser = options::tip(), requires = "force")]
    tip: Option<f64>,
    /// Young's modulus of the detector, for forces, with the measured surface of such a foam (MPa) [default: that of its foams or of its file]
    #[arg(long, value_name = "MPA", value_parser = elasticity())]
    elasticity: Option<f64>,
    /// Poisson's ratio of the detector, for forces [default: that of its file, or 0.3]
    #[arg(long, value_name = "RATIO", value_parser = poisson())]
    poisson: Option<f64>,
    /// What the surface conducts under pressure, for forces: measured, a film as the detector's file has it or as in the paper's table II, or ideal, all that touches
    /// alike down to 0.5 mm or to the depth in ideal:MM [default: the file's law, or measured; demonstrations without --force press an ideal one, as the paper gives
    /// none of their forces]
    #[arg(long, value_name = "LAW", value_parser = law)]
    surface: Option<Law>,
    /// A fault: open:3, short:2,7, short:2,7:50 (ohm), swap:1,5, gain:4:0.8, invert:4, contact-spread:0.2, conductivity:2, uneven:0.2,
    /// clip:0.14,1.8 (V); of the driving layer: driving-sheet:100 (ohm/sq), connected at one corner, driving-sheet:100:2 at two, leak:0.01 (sheet
    /// conductances in all); of the foam in time: creep:0.2:3 (share, time constant in s), hysteresis:0.1 (share), drift:0.2:86400
    /// (share of the conductivity in so many s), drift:0.2:86400:0.05 (with a daily wave); give it again for more
    #[arg(long, value_name = "FAULT")]
    pub fault: Vec<Fault>,
    #[command(flatten)]
    pub as_built: AsBuiltArgs,
    /// Seed of places, noise and faults [default: 1]
    #[arg(long)]
    seed: Option<u64>,
}

impl SceneArgs {
    /// Names of the arguments.
    pub const NAMES: [&str; 9] =
        ["scene", "force", "tip", "elasticity", "poisson", "surface", "fault", AsBuiltArgs::NAME, "seed"];

    /// The seed.
    pub fn seed(&self) -> u64 {
        self.seed.unwrap_or(SEED)
    }

    /// The same, of another seed by so much: another way to wander, and other noise.
    pub fn later(self, seeds: u64) -> Self {
        Self { seed: Some(self.seed().wrapping_add(seeds)), ..self }
    }

    /// Name of the detector where none is chosen: the one that the scene was made for, or the default.
    pub fn preset(&self) -> &'static str {
        self.scene.and_then(SceneName::detector).unwrap_or(Detector::DEFAULT)
    }

    /// The scene, or `otherwise`, on a detector.
    pub fn scene(&self, otherwise: SceneName, detector: &Detector) -> anyhow::Result<Scene> {
        let hand = self.hand(detector)?;
        let name = self.scene.unwrap_or(otherwise);
        ensure!(
            detector.surface.is_none() || name.is_of_discs(),
            "only discs can touch a curved detector: choose another scene"
        );
        ensure!(
            self.tip.is_none() || name.detector().is_none(),
            "the scene {name} presses with tips of its own: leave out --tip"
        );
        Ok(Scene::new(name, detector, hand, self.seed()))
    }

    fn hand(&self, detector: &Detector) -> anyhow::Result<Hand> {
        let Some(force_n) = self.force else {
            let hand = Hand::relative(detector);
            let is_known = self.elasticity.is_some() || detector.skin.is_some() || self.surface.is_some();
            return Ok(if is_known {
                hand.on(self.hertz_on(Some(Law::Ideal(Surface::IDEAL)), detector)?)
            } else {
                hand
            });
        };
        let radius_m = self.tip.map_or_else(|| Fingertip::fitting_m(detector), |tip_mm| tip_mm * 1e-3);
        let hand = Hand::in_newtons(detector, Fingertip { hertz: self.hertz(detector)?, force_n, radius_m });
        if let Some(beyond) = hand.beyond(1.0, 1.0) {
            message!("warning: {force_n} N is beyond Hertz's theory: {beyond}");
        }
        Ok(hand)
    }

    /// Mechanics of a detector, by its own skin or by what is said of it.
    pub fn hertz(&self, detector: &Detector) -> anyhow::Result<Hertz> {
        self.hertz_on(None, detector)
    }

    /// The same, on such a surface unless another one is asked for.
    fn hertz_on(&self, otherwise: Option<Law>, detector: &Detector) -> anyhow::Result<Hertz> {
        let skin = self.elasticity.map(|mpa| Skin::of(mpa * 1e6)).or(detector.skin);
        let skin = skin.with_context(|| {
            format!(
                "forces need to know how soft {} is: give --elasticity or --material, or write young_pa in a table [skin] of its file",
                detector.name
            )
        })?;
        let skin = Skin { poisson: self.poisson.unwrap_or(skin.poisson), ..skin };
        let skin = match (self.surface.or(otherwise), skin.surface) {
            (None, _) | (Some(Law::Measured), Surface::Film { .. }) => skin,
            (Some(Law::Measured), Surface::Ideal { .. }) => skin.with(Surface::measured(skin.young_pa)),
            (Some(Law::Ideal(surface)), _) => skin.with(surface),
        };
        Ok(Hertz::new(detector, skin)?)
    }
}

/// The law of a surface that is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// A film: the detector's own, or that of the paper's foams.
    Measured,
    /// An ideal one.
    Ideal(Surface),
}

/// A law from `measured`, `ideal` or `ideal:MM`.
pub fn law(text: &str) -> Result<Law, String> {
    match text.split_once(':') {
        None if text == "measured" => Ok(Law::Measured),
        None if text == "ideal" => Ok(Law::Ideal(Surface::IDEAL)),
        Some(("ideal", mm)) => {
            let depth = options::number_in(mm, "a depth (mm)", &(1e-6..=1e3));
            depth.map(|mm| Law::Ideal(Surface::Ideal { depth_m: mm * 1e-3 }))
        }
        _ => Err("measured, ideal, or ideal:MM with a depth in mm is needed".to_owned()),
    }
}

/// A ball pressed on a detector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Press {
    place_m: [f64; 3],
    radius_m: f64,
    force_n: f64,
}

impl Press {
    /// The contact that it makes.
    pub fn touch(&self, hertz: &Hertz) -> Touch {
        let imprint = hertz.ball(self.radius_m, self.force_n);
        if let Some(beyond) = imprint.beyond {
            message!("warning: {} N is beyond Hertz's theory: {beyond}", self.force_n);
        }
        let shape = Shape::Disc { radius_m: imprint.half_width_m };
        let [x_m, y_m, z_m] = self.place_m;
        Touch { z_m, ..Touch::flat([x_m, y_m], shape, imprint.conductance_s) }
    }
}

/// A press from `x_mm,y_mm,tip_radius_mm,force_n`, with `z_mm` after `y_mm` on a curved detector.
pub fn press(text: &str) -> Result<Press, String> {
    let (place_m, [radius_mm, force_n]) = tactomo_cli::choice::place_and(text, "tip_radius_mm,force_n")?;
    let press = Press { place_m, radius_m: radius_mm * 1e-3, force_n };
    hertz::check_press(press.radius_m, force_n).map_err(|error| error.to_string())?;
    Ok(press)
}

/// Touches from a JSON file.
pub fn read_touches(path: &Path) -> anyhow::Result<Vec<Touch>> {
    let text = TOUCHES.read_text(path).with_context(|| format!("cannot read the touches {}", path.display()))?;
    let touches: Vec<Touch> =
        serde_json::from_str(&text).with_context(|| format!("{} is no list of touches", path.display()))?;
    for (index, touch) in touches.iter().enumerate() {
        touch.check().with_context(|| format!("{}: touch {index}", path.display()))?;
    }
    Ok(touches)
}

/// Parses Poisson's ratio.
pub fn poisson() -> impl TypedValueParser<Value = f64> {
    options::number("a ratio", RATIO)
}

/// Parses Young's modulus (MPa).
pub fn elasticity() -> impl TypedValueParser<Value = f64> {
    options::number("an elasticity (MPa)", 1e-6 * YOUNG_PA.start()..=1e-6 * YOUNG_PA.end())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presses_are_given_in_millimetres_and_newtons() {
        let press = press("3,-4,2.5,1.5").unwrap_or_else(|error| panic!("{error}"));
        assert!((press.radius_m - 0.0025).abs() < 1e-15 && press.force_n == 1.5, "{press:?}");
        assert!((press.place_m[1] + 0.004).abs() < 1e-15, "{press:?}");
    }

    #[test]
    fn laws_of_surfaces_are_measured_or_ideal_to_a_depth() {
        assert_eq!((law("measured"), law("ideal")), (Ok(Law::Measured), Ok(Law::Ideal(Surface::IDEAL))));
        assert_eq!(law("ideal:0.2"), Ok(Law::Ideal(Surface::Ideal { depth_m: 0.2e-3 })));
        for wrong in ["hertz", "ideal:", "ideal:-1", "measured:1"] {
            assert!(law(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn wrong_presses_say_what_is_allowed() {
        for (text, told) in [
            ("1,2,3", "tip_radius_mm,force_n"),
            ("1,2,0,1", "a tip with a radius from 1e-5 m to 1.0 m"),
            ("1,2,3,inf", "a force from 1e-6 N to 10000.0 N"),
        ] {
            assert!(press(text).is_err_and(|error| error.contains(told)), "{text}");
        }
    }
}
