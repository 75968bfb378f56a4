//! Scenes by name.

use std::fmt;
use std::str::FromStr;

/// Names of the scenes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SceneName {
    /// Nothing touches.
    Rest,
    /// One contact that comes everywhere, pressing and lifting.
    Wandering,
    /// One steady contact.
    Single,
    /// Three steady contacts of different firmness.
    Several,
    /// One wide contact.
    Wide,
    /// The rim of a cup.
    Ring,
    /// A bar.
    Line,
    /// Five fingers, each pressing in turn a little more.
    FiveFingers,
    /// A ball that rolls under its own weight.
    RollingBall,
    /// One contact on a round, always as firm.
    Moving,
    /// One contact at one place, from nothing to firm and back.
    ChangingForce,
    /// A soft gripper's finger closes on a rod, holds it, feels it slip, and lets go.
    Gripper,
    /// A finger strokes, two pinch, one taps.
    Display,
    /// A ball rolls under a palm and is pressed, as a pointer that clicks.
    Pointer,
    /// Rows of bumps pass under a fingertip.
    Texture,
    /// A hand is laid down, fingers and palm.
    Hand,
}

/// A name that no scene has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is no scene `{0}`; there are {names}", names = SceneName::ALL.map(|name| name.to_string()).join(", "))]
pub struct UnknownScene(String);

impl SceneName {
    /// All of them.
    pub const ALL: [Self; 16] = [
        Self::Rest,
        Self::Wandering,
        Self::Single,
        Self::Several,
        Self::Wide,
        Self::Ring,
        Self::Line,
        Self::FiveFingers,
        Self::RollingBall,
        Self::Moving,
        Self::ChangingForce,
        Self::Gripper,
        Self::Display,
        Self::Pointer,
        Self::Texture,
        Self::Hand,
    ];

    /// Name of the preset that it was made for, if it is one of the paper's demonstrations.
    pub fn detector(self) -> Option<&'static str> {
        match self {
            Self::Gripper => Some("strip-13x60"),
            Self::Display => Some("display-140x70"),
            Self::Pointer => Some("pad-257x182"),
            Self::Texture => Some("fingertip-10"),
            Self::Hand => Some("square-150"),
            _ => None,
        }
    }

    /// Whether it is of discs alone, which are all that can touch a curved detector.
    pub fn is_of_discs(self) -> bool {
        !matches!(self, Self::Ring | Self::Line | Self::Gripper)
    }
}

impl fmt::Display for SceneName {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Rest => "rest",
            Self::Wandering => "wandering",
            Self::Single => "single",
            Self::Several => "several",
            Self::Wide => "wide",
            Self::Ring => "ring",
            Self::Line => "line",
            Self::FiveFingers => "five-fingers",
            Self::RollingBall => "rolling-ball",
            Self::Moving => "moving",
            Self::ChangingForce => "changing-force",
            Self::Gripper => "gripper",
            Self::Display => "display",
            Self::Pointer => "pointer",
            Self::Texture => "texture",
            Self::Hand => "hand",
        })
    }
}

impl FromStr for SceneName {
    type Err = UnknownScene;

    fn from_str(text: &str) -> Result<Self, UnknownScene> {
        Self::ALL.into_iter().find(|name| name.to_string() == text).ok_or_else(|| UnknownScene(text.to_owned()))
    }
}
