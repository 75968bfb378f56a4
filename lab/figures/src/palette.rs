//! The colours of a film: as few as a palette has, by median cut (Heckbert, "Color image quantization for frame buffer display", 1982).

use std::collections::HashMap;

use crate::png::{Colour, Picture};

/// Bits of a channel that are told apart where colours are counted.
const BITS: u32 = 6;

/// A few colours, and which of them is nearest to any other.
#[derive(Debug)]
pub struct Palette {
    /// The colours.
    pub colours: Vec<Colour>,
    nearest: HashMap<Colour, u8>,
}

impl Palette {
    /// At most `count` colours, at most 256, that stand for those of the pictures.
    pub fn of(pictures: &[Picture], count: usize) -> Self {
        let mut counts: HashMap<Colour, ([u64; 3], u64)> = HashMap::new();
        for pixel in pictures.iter().flat_map(|picture| &picture.pixels) {
            let (sums, count) = counts.entry(pixel.map(|value| value >> (8 - BITS))).or_default();
            for (sum, value) in sums.iter_mut().zip(pixel) {
                *sum += u64::from(*value);
            }
            *count += 1;
        }
        let mean = |(sums, count): ([u64; 3], u64)| Cell { colour: sums.map(|sum| (sum / count) as u8), count };
        let mut cells: Vec<Cell> = counts.into_values().map(mean).collect();
        // In one order, whatever the map's.
        cells.sort_unstable_by_key(|cell| cell.colour);
        let mut boxes = vec![Cut::of(cells)];
        while boxes.len() < count.min(256) {
            let Some(widest) = (0..boxes.len()).filter(|i| boxes[*i].spread > 0).max_by_key(|i| boxes[*i].spread)
            else {
                break;
            };
            let (lower, upper) = boxes.swap_remove(widest).halves();
            boxes.extend([Cut::of(lower), Cut::of(upper)]);
        }
        let colours = boxes.iter().filter(|cut| !cut.cells.is_empty()).map(Cut::mean).collect();
        Self { colours, nearest: HashMap::new() }
    }

    /// The number of the colour that is nearest.
    pub fn nearest(&mut self, colour: Colour) -> u8 {
        let colours = &self.colours;
        let search = || (0..colours.len()).min_by_key(|i| distance(colours[*i], colour)).unwrap_or_default() as u8;
        *self.nearest.entry(colour).or_insert_with(search)
    }
}

fn distance(a: Colour, b: Colour) -> u32 {
    a.iter().zip(b).map(|(a, b)| u32::from(a.abs_diff(b)).pow(2)).sum()
}

/// A colour, and how many pixels have it.
#[derive(Clone, Copy, Debug)]
struct Cell {
    colour: Colour,
    count: u64,
}

/// A box of colours.
#[derive(Debug)]
struct Cut {
    cells: Vec<Cell>,
    /// The channel along which they differ most.
    channel: usize,
    /// How much it matters to cut it in two.
    spread: u64,
}

impl Cut {
    fn of(cells: Vec<Cell>) -> Self {
        let range = |channel: usize| {
            let values = || cells.iter().map(|cell| cell.colour[channel]);
            u64::from(values().max().unwrap_or_default() - values().min().unwrap_or_default())
        };
        let channel = (0..3).max_by_key(|channel| range(*channel)).unwrap_or_default();
        // Rare colours count too, or a small badge among many pixels of paper would lose its own.
        let count: u64 = cells.iter().map(|cell| cell.count).sum();
        let spread = range(channel).pow(2) * count.isqrt().isqrt();
        Self { cells, channel, spread }
    }

    /// Both halves of the box. Half the colours each, as Heckbert has it, would give the many greys of small letters most of the palette.
    fn halves(self) -> (Vec<Cell>, Vec<Cell>) {
        let values = || self.cells.iter().map(|cell| cell.colour[self.channel]);
        let middle = u8::midpoint(values().min().unwrap_or_default(), values().max().unwrap_or_default());
        self.cells.into_iter().partition(|cell| cell.colour[self.channel] <= middle)
    }

    fn mean(&self) -> Colour {
        let count: u64 = self.cells.iter().map(|cell| cell.count).sum();
        [0, 1, 2].map(|channel| {
            let sum: u64 = self.cells.iter().map(|cell| cell.count * u64::from(cell.colour[channel])).sum();
            ((sum + count / 2) / count.max(1)) as u8
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(pixels: Vec<Colour>) -> Picture {
        Picture { size: [pixels.len(), 1], pixels }
    }

    #[test]
    fn few_colours_are_kept_as_they_are_even_rare_ones() {
        let pixels = [vec![[255; 3]; 10_000], vec![[0; 3]; 500], vec![[200, 0, 40]; 1]].concat();
        let mut palette = Palette::of(&[picture(pixels)], 16);
        assert_eq!(palette.colours.len(), 3);
        for colour in [[255; 3], [0; 3], [200, 0, 40]] {
            let nearest = palette.nearest(colour);
            assert_eq!(palette.colours[usize::from(nearest)], colour);
        }
    }

    #[test]
    fn a_gradient_is_spread_over_the_colours_that_there_are() {
        let gradient: Vec<Colour> = (0..=255).map(|grey| [grey; 3]).collect();
        let mut palette = Palette::of(&[picture(gradient.clone())], 16);
        assert_eq!(palette.colours.len(), 16);
        let off = gradient.iter().map(|colour| {
            let nearest = palette.nearest(*colour);
            palette.colours[usize::from(nearest)][0].abs_diff(colour[0])
        });
        assert!(off.max().unwrap() <= 10);
    }
}
