//! What a person asks to be scanned.

use std::fmt;
use std::str::FromStr;

use tactomo_protocol::MAX_PLAN_ROWS;

/// What to scan.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum ScanChoice {
    /// All electrodes under every ground.
    #[default]
    Whole,
    /// All electrodes under four grounds, as in the paper's second demonstration.
    Four,
    /// What tells most at the moment.
    Adaptive,
    /// All electrodes under these grounds, in this order.
    Grounds(Vec<u8>),
}

impl FromStr for ScanChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "whole" => return Ok(Self::Whole),
            "four" => return Ok(Self::Four),
            "adaptive" => return Ok(Self::Adaptive),
            _ => {}
        }
        let wrong = || {
            format!(
                "`{text}` is no scan: choose whole, four, adaptive, or a list of electrodes to ground such as 0,5,10,15"
            )
        };
        let grounds: Vec<u8> =
            text.split(',').map(|ground| ground.trim().parse().map_err(|_| wrong())).collect::<Result<_, _>>()?;
        match grounds.len() {
            1..=MAX_PLAN_ROWS => Ok(Self::Grounds(grounds)),
            count => Err(format!("{count} grounds: a plan has {MAX_PLAN_ROWS} at most")),
        }
    }
}

impl fmt::Display for ScanChoice {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Whole => formatter.write_str("whole"),
            Self::Four => formatter.write_str("four"),
            Self::Adaptive => formatter.write_str("adaptive"),
            Self::Grounds(grounds) => {
                let grounds: Vec<String> = grounds.iter().map(u8::to_string).collect();
                formatter.write_str(&grounds.join(","))
            }
        }
    }
}

impl ScanChoice {
    /// Checks that a detector has the electrodes.
    ///
    /// # Errors
    /// Which one it does not have.
    pub fn check(&self, electrodes: usize) -> Result<(), String> {
        let Self::Grounds(grounds) = self else { return Ok(()) };
        match grounds.iter().find(|ground| usize::from(**ground) >= electrodes) {
            Some(ground) => {
                Err(format!("there is no electrode {ground} to ground: the detector has 0 to {}", electrodes - 1))
            }
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_are_read_and_told_and_wrong_ones_explained() {
        for text in ["whole", "four", "adaptive", "3", "0,5,10,15"] {
            assert_eq!(text.parse::<ScanChoice>().unwrap().to_string(), text);
        }
        assert!("some".parse::<ScanChoice>().unwrap_err().contains("whole, four, adaptive"));
        assert!("1,,2".parse::<ScanChoice>().is_err());
        let wrong = ScanChoice::Grounds(vec![3, 16]).check(16).unwrap_err();
        assert!(wrong.contains("electrode 16") && wrong.contains("0 to 15"), "{wrong}");
    }
}
