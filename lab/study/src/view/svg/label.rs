//! Places for labels beside marks, so that none hides another.

/// A box: left, top, right, bottom (px).
pub(super) type Area = [f64; 4];

/// Width of a character and height of a line at the size of labels (px).
const CHARACTER: f64 = 7.0;
const LINE: f64 = 13.0;
/// Room that a mark takes, from its middle (px), and a small one.
const MARK: f64 = 5.0;
const SMALL_MARK: f64 = 3.0;
/// Steps of 8 px from a mark that are near, and that are tried at all.
const NEAR_STEPS: u32 = 3;
const FAR_STEPS: u32 = 24;

/// Where a label goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    /// Left end of its baseline.
    pub left: f64,
    /// Its baseline.
    pub baseline: f64,
    /// Whether it is so far from its mark that a line has to lead there.
    pub is_far: bool,
}

/// Finds places one after the other, within a frame.
pub(super) struct Labels {
    frame: Area,
    /// Where no label may be.
    taken: Vec<Area>,
    /// Where none should be.
    small: Vec<Area>,
}

impl Labels {
    /// Labels within `frame`, clear of `marks`, and of `small` ones where there is room.
    pub fn new(
        frame: Area,
        marks: impl IntoIterator<Item = [f64; 2]>,
        small: impl IntoIterator<Item = [f64; 2]>,
    ) -> Self {
        let around = |half: f64| move |[x, y]: [f64; 2]| [x - half, y - half, x + half, y + half];
        let taken = marks.into_iter().map(around(MARK)).collect();
        Self { frame, taken, small: small.into_iter().map(around(SMALL_MARK)).collect() }
    }

    /// Keeps labels clear of a text that is there already: left and right end and baseline (px).
    pub fn keep_clear(&mut self, [left, right]: [f64; 2], baseline: f64) {
        self.taken.push([left, baseline - LINE, right, baseline + 4.0]);
    }

    /// Keeps labels clear of an area where there is room elsewhere.
    pub fn avoid(&mut self, area: Area) {
        self.small.push(area);
    }

    /// Width of a text (px).
    pub fn width(text: &str) -> f64 {
        CHARACTER * text.chars().count() as f64
    }

    /// A place for `text` near a mark: beside it, above or below, clear of all if that is near; else over small marks; else further away.
    pub fn place(&mut self, [x, y]: [f64; 2], text: &str) -> Place {
        let width = Self::width(text);
        let at = |dx: f64, dy: f64| [x + dx, y + dy - LINE / 2.0, x + dx + width, y + dy + LINE / 2.0];
        let steps = |from: u32, to: u32| {
            (from..to).map(|step| 8.0 * f64::from(step)).flat_map(|away| {
                [
                    at(8.0, away),
                    at(8.0, -away),
                    at(-8.0 - width, away),
                    at(-8.0 - width, -away),
                    at(-width / 2.0, 13.0 + away),
                    at(-width / 2.0, -13.0 - away),
                ]
            })
        };
        let found = steps(0, NEAR_STEPS)
            .find(|area| self.is_free(*area) && !overlaps(*area, &self.small))
            .or_else(|| steps(0, 2 * NEAR_STEPS).find(|area| self.is_free(*area)))
            .or_else(|| steps(2 * NEAR_STEPS, FAR_STEPS).find(|area| self.is_free(*area)));
        // Where all is taken, a label over others is better than none.
        let area = found.or_else(|| steps(0, FAR_STEPS).find(|area| self.is_within(*area))).unwrap_or(at(8.0, 0.0));
        self.taken.push(area);
        let middle = (area[1] + area[3]) / 2.0;
        Place { left: area[0], baseline: middle + 4.0, is_far: (middle - y).abs() > 15.0 }
    }

    fn is_within(&self, area: Area) -> bool {
        let [left, top, right, bottom] = self.frame;
        area[0] >= left && area[1] >= top && area[2] <= right && area[3] <= bottom
    }

    fn is_free(&self, area: Area) -> bool {
        self.is_within(area) && !overlaps(area, &self.taken)
    }
}

fn overlaps(area: Area, others: &[Area]) -> bool {
    let apart = |other: &Area| area[2] <= other[0] || other[2] <= area[0] || area[3] <= other[1] || other[3] <= area[1];
    !others.iter().all(apart)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: Area = [0.0, 0.0, 300.0, 200.0];

    #[test]
    fn a_label_alone_is_to_the_right_and_at_the_edge_to_the_left() {
        let mut labels = Labels::new(FRAME, [[100.0, 100.0], [290.0, 50.0]], []);
        let place = labels.place([100.0, 100.0], "solver");
        assert!(place.left > 100.0 && !place.is_far);
        let place = labels.place([290.0, 50.0], "solver");
        assert!(place.left + 6.0 * CHARACTER < 290.0);
    }

    #[test]
    fn small_marks_are_covered_rather_than_left_far_behind() {
        let near = |i: u32| [100.0 + 9.0 * f64::from(i % 12 + 1) - 60.0, 60.0 + 8.0 * f64::from(i / 12)];
        let place = Labels::new(FRAME, [[100.0, 100.0]], (0..120).map(near)).place([100.0, 100.0], "solver");
        assert!(!place.is_far, "{place:?}");
    }

    #[test]
    fn labels_of_marks_on_one_spot_do_not_hide_each_other() {
        let mut labels = Labels::new(FRAME, [[100.0, 100.0]; 8], []);
        for _ in 0..8 {
            labels.place([100.0, 100.0], "tikhonov");
        }
        let boxes = &labels.taken[8..];
        for (i, a) in boxes.iter().enumerate() {
            for b in &boxes[..i] {
                assert!(a[2] <= b[0] || b[2] <= a[0] || a[3] <= b[1] || b[3] <= a[1], "{a:?} {b:?}");
            }
        }
    }
}
