//! What a kernel has learned, in a sentence.

use super::Kernel;

impl Kernel {
    /// What it has learned and how well, with a warning where that is nothing.
    pub fn sentence(&self) -> String {
        let strength = self.strength().zip(self.left_out_strength()).map_or_else(String::new, |(strength, share)| {
            format!(", {} within {:.0} %", strength.name(), share * 100.0)
        });
        let middle = self.middle_m().map_or_else(String::new, |middle_m| {
            format!(", where guessing the middle of all presses misses by {:.2} mm", middle_m * 1e3)
        });
        let warning = match self.is_no_better_than_middle() {
            true => {
                "\nwarning: that is no better than guessing the middle: nothing was learned of places. See that each place belongs to its row, that \
                 readings are less those at rest, and that the channels are the sensor's"
            }
            false => "",
        };
        let rows =
            if self.rows() > self.presses() { format!(" ({} rows of readings)", self.rows()) } else { String::new() };
        format!(
            "learned from {} presses{rows} on {} channels, in {} dimensions of {}; a press that is left out is found within {:.2} mm{strength} (root mean \
             square){middle}{warning}",
            self.presses(),
            self.channels(),
            self.components(),
            self.description().words(),
            self.left_out_m() * 1e3
        )
    }
}
