//! What was asked for and cannot be.

/// Why something that was asked for cannot be, each until the same is asked for and granted.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Refusals {
    /// Recording: it did not begin, or has ended by itself.
    pub recording: Option<String>,
    /// The settings of the board's scan.
    pub settings: Option<String>,
    /// What was asked of the simulated board, or of the recording that is played.
    pub control: Option<String>,
}

impl Refusals {
    /// The one to show: what may lose data comes first.
    pub fn first(&self) -> Option<&str> {
        [&self.recording, &self.settings, &self.control].into_iter().find_map(|refused| refused.as_deref())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_that_has_ended_is_told_before_anything_else() {
        let control = Refusals { control: Some("no such scene".to_owned()), ..Refusals::default() };
        let both = Refusals { recording: Some("the disk is full".to_owned()), ..control.clone() };
        assert_eq!([both.first(), control.first()], [Some("the disk is full"), Some("no such scene")]);
        assert_eq!(Refusals::default().first(), None);
    }
}
