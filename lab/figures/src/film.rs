//! Films: pictures of a page as time goes by, as animated PNG, which documents show where they stand.

use std::time::Duration;

use anyhow::{Context, Result, ensure};

use crate::palette::Palette;
use crate::png::{self, Frame};

/// More colours than these leave none for "as it was", of 256.
const COLOURS: usize = 255;

/// The page at a moment.
#[derive(Debug)]
pub struct Shot {
    /// Time since the film began.
    pub at: Duration,
    /// The page, as PNG.
    pub png: Vec<u8>,
}

/// The film of these shots, the last of which stays until `ends`. Each stays on for as long as it did, so that the film goes as fast as what it shows.
///
/// # Errors
/// If there is no shot, one cannot be read, or they differ in size.
pub fn film(shots: &[Shot], ends: Duration) -> Result<Vec<u8>> {
    let pictures = shots.iter().map(|shot| png::read(&shot.png)).collect::<Result<Vec<_>>>()?;
    let size = pictures.first().context("a film without a picture")?.size;
    ensure!(pictures.iter().all(|picture| picture.size == size), "the page has changed its size");
    let mut palette = Palette::of(&pictures, COLOURS);
    let as_it_was = palette.colours.len() as u8;
    let mut frames: Vec<Frame> = Vec::new();
    let mut screen = Vec::new();
    let ends_ms = shots.iter().map(|shot| shot.at).skip(1).chain([ends]).map(|at| at.as_millis());
    for ((picture, shot), end_ms) in pictures.iter().zip(shots).zip(ends_ms) {
        let pixels: Vec<u8> = picture.pixels.iter().map(|colour| palette.nearest(*colour)).collect();
        let stays_ms = u16::try_from(end_ms.saturating_sub(shot.at.as_millis()))?;
        match (change(size, &screen, &pixels, as_it_was), frames.last_mut()) {
            (None, Some(last)) => last.stays_ms = last.stays_ms.checked_add(stays_ms).context("a film of nothing")?,
            (change, _) => frames.push(Frame { stays_ms, ..change.context("a film without a pixel")? }),
        }
        screen = pixels;
    }
    let mut colours = palette.colours;
    colours.push([0; 3]);
    png::write_film(size, &colours, as_it_was, &frames)
}

/// The rectangle in which the pixels are others than on the screen, if any are; all of them if the screen is empty.
fn change([width, height]: [usize; 2], screen: &[u8], pixels: &[u8], as_it_was: u8) -> Option<Frame> {
    let is_changed = |x: usize, y: usize| screen.get(y * width + x) != pixels.get(y * width + x);
    let is_row_changed = |y: &usize| (0..width).any(|x| is_changed(x, *y));
    let is_column_changed = |x: &usize| (0..height).any(|y| is_changed(*x, y));
    let (top, bottom) = ((0..height).find(is_row_changed)?, (0..height).rfind(is_row_changed)?);
    let (left, right) = ((0..width).find(is_column_changed)?, (0..width).rfind(is_column_changed)?);
    let of_row =
        |y: usize| (left..=right).map(move |x| if is_changed(x, y) { pixels[y * width + x] } else { as_it_was });
    Some(Frame {
        stays_ms: 0,
        at: [left, top],
        size: [right - left + 1, bottom - top + 1],
        pixels: (top..=bottom).flat_map(of_row).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_has_what_has_changed_and_leaves_the_rest() {
        let before = [1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1];
        let after = [1, 1, 1, 1, 1, 2, 1, 1, 1, 1, 3, 1];
        let frame = change([4, 3], &before, &after, 9).unwrap();
        assert_eq!(frame, Frame { stays_ms: 0, at: [1, 1], size: [2, 2], pixels: vec![2, 9, 9, 3] });
        assert_eq!(change([4, 3], &after, &after, 9), None);
        let whole = change([4, 3], &[], &after, 9).unwrap();
        assert_eq!((whole.at, whole.size, whole.pixels), ([0, 0], [4, 3], after.to_vec()));
    }

    /// A pixel at a time.
    fn shot(at_ms: u64, colour: [u8; 3]) -> Shot {
        Shot { at: Duration::from_millis(at_ms), png: png::tests::png(8, 2, [1, 1], &[&[0][..], &colour].concat()) }
    }

    #[test]
    fn each_shot_stays_as_long_as_it_did() {
        let shots = [shot(0, [0; 3]), shot(90, [9; 3]), shot(250, [9; 3]), shot(300, [99; 3])];
        let film = film(&shots, Duration::from_millis(420)).unwrap();
        let controls = film.windows(4).enumerate().filter(|(_, name)| name == b"fcTL").map(|(at, _)| &film[at + 4..]);
        let stays: Vec<u16> = controls.map(|control| u16::from_be_bytes([control[20], control[21]])).collect();
        assert_eq!(stays, [90, 210, 120], "the third is as the second");
    }

    #[test]
    fn there_is_no_film_of_nothing_or_of_a_page_that_changes_its_size() {
        assert!(film(&[], Duration::ZERO).is_err());
        let two = Shot { at: Duration::ZERO, png: png::tests::png(8, 2, [2, 1], &[0; 7]) };
        let error = film(&[shot(0, [0; 3]), two], Duration::ZERO).unwrap_err();
        assert!(error.to_string().contains("changed its size"), "{error}");
    }
}
