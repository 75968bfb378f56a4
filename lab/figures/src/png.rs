//! PNG as a browser writes it, and animated PNG with a palette (W3C, "Portable Network Graphics", third edition).
//!
//! Of both only what films need: a package for it would bring six others.

use std::io::{Read, Write};

use anyhow::{Context, Result, bail, ensure};
use crc::{CRC_32_ISO_HDLC, Crc};
use flate2::Compression;
use flate2::read::ZlibDecoder;
use flate2::write::ZlibEncoder;

const SIGNATURE: [u8; 8] = *b"\x89PNG\r\n\x1a\n";
const CHECKSUM: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
/// Colour types.
const RGB: u8 = 2;
const PALETTE: u8 = 3;
const RGBA: u8 = 6;

/// A colour: red, green, blue.
pub type Colour = [u8; 3];

/// A picture in full colour, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Width and height.
    pub size: [usize; 2],
    /// Pixels.
    pub pixels: Vec<Colour>,
}

/// What changes on the screen at a moment: a rectangle of numbers of colours.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// How long it stays (ms).
    pub stays_ms: u16,
    /// Its left upper corner.
    pub at: [usize; 2],
    /// Width and height.
    pub size: [usize; 2],
    /// Pixels, row by row.
    pub pixels: Vec<u8>,
}

/// Reads a PNG of 8 bits a channel, in colour and not interlaced.
///
/// # Errors
/// If it is damaged, or another kind of PNG.
pub fn read(png: &[u8]) -> Result<Picture> {
    let mut rest = png.strip_prefix(&SIGNATURE).context("no PNG")?;
    let (mut head, mut deflated) = (None, Vec::new());
    while let Some((&length, after)) = rest.split_first_chunk() {
        let length = u32::from_be_bytes(length) as usize;
        let (kind, after) = after.split_first_chunk::<4>().context("a PNG that ends in a chunk")?;
        let (data, after) = after.split_at_checked(length).context("a PNG that ends in a chunk")?;
        match kind {
            b"IHDR" => head = data.first_chunk::<13>(),
            b"IDAT" => deflated.extend_from_slice(data),
            _ => {}
        }
        rest = after.get(4..).context("a PNG that ends in a chunk")?;
    }
    let &[w0, w1, w2, w3, h0, h1, h2, h3, depth, colours, _, _, interlaced] = head.context("a PNG without a head")?;
    let channels = match (depth, colours, interlaced) {
        (8, RGB, 0) => 3,
        (8, RGBA, 0) => 4,
        kind => {
            bail!("a PNG of depth, colours and interlacing {kind:?}: 8 bits of RGB or RGBA are read, not interlaced")
        }
    };
    let [width, height] = [[w0, w1, w2, w3], [h0, h1, h2, h3]].map(|size| u32::from_be_bytes(size) as usize);
    let mut lines = Vec::new();
    ZlibDecoder::new(deflated.as_slice()).read_to_end(&mut lines)?;
    ensure!(lines.len() == height * (1 + width * channels), "a PNG with more or fewer pixels than its head says");
    let pixels = unfiltered(&lines, width * channels, channels)?;
    let pixels = pixels.chunks_exact(channels).map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
    Ok(Picture { size: [width, height], pixels })
}

/// Undoes the filters, of which each line begins with its own.
fn unfiltered(lines: &[u8], length: usize, channels: usize) -> Result<Vec<u8>> {
    let mut pixels: Vec<u8> = Vec::with_capacity(lines.len());
    for (row, line) in lines.chunks_exact(1 + length).enumerate() {
        let (&filter, line) = line.split_first().context("an empty line")?;
        let begin = row * length;
        for (i, &value) in line.iter().enumerate() {
            let at = |is_there: bool, back: usize| if is_there { pixels[begin + i - back] } else { 0 };
            let left = at(i >= channels, channels);
            let above = at(row > 0, length);
            let corner = at(i >= channels && row > 0, length + channels);
            let predicted = match filter {
                0 => 0,
                1 => left,
                2 => above,
                3 => u8::midpoint(left, above),
                4 => paeth(left, above, corner),
                _ => bail!("a PNG with the filter {filter}, which there is not"),
            };
            pixels.push(value.wrapping_add(predicted));
        }
    }
    Ok(pixels)
}

/// The neighbour that is nearest to `left + above - corner`.
fn paeth(left: u8, above: u8, corner: u8) -> u8 {
    let estimate = i16::from(left) + i16::from(above) - i16::from(corner);
    let off = |value: u8| (estimate - i16::from(value)).abs();
    // The first of equals, in this order.
    [left, above, corner].into_iter().min_by_key(|value| off(*value)).unwrap_or_default()
}

/// Writes an animated PNG that plays for ever. The first frame is the whole picture; in others the colour `transparent` leaves what is there.
///
/// # Errors
/// If there is no frame, or a number does not fit into its field.
pub fn write_film(size: [usize; 2], colours: &[Colour], transparent: u8, frames: &[Frame]) -> Result<Vec<u8>> {
    ensure!(frames.first().is_some_and(|first| first.size == size), "a film begins with a whole picture");
    let mut film = SIGNATURE.to_vec();
    let [width, height] = [number(size[0])?, number(size[1])?];
    chunk(&mut film, *b"IHDR", &[&width[..], &height, &[8, PALETTE, 0, 0, 0]].concat())?;
    chunk(&mut film, *b"acTL", &[number(frames.len())?, [0; 4]].concat())?;
    chunk(&mut film, *b"PLTE", colours.as_flattened())?;
    let mut opacities = vec![u8::MAX; usize::from(transparent)];
    opacities.push(0);
    chunk(&mut film, *b"tRNS", &opacities)?;
    let mut order = 0..;
    let mut next = || number(order.next().unwrap_or_default());
    for (index, frame) in frames.iter().enumerate() {
        let mut control = next()?.to_vec();
        for value in frame.size.into_iter().chain(frame.at) {
            control.extend(number(value)?);
        }
        control.extend(frame.stays_ms.to_be_bytes());
        control.extend(1000u16.to_be_bytes());
        // It stays, and lies over what was there.
        control.extend([0, 1]);
        chunk(&mut film, *b"fcTL", &control)?;
        let data = deflated(frame)?;
        match index {
            0 => chunk(&mut film, *b"IDAT", &data)?,
            _ => chunk(&mut film, *b"fdAT", &[&next()?[..], &data].concat())?,
        }
    }
    chunk(&mut film, *b"IEND", &[])?;
    Ok(film)
}

fn number(value: usize) -> Result<[u8; 4]> {
    Ok(u32::try_from(value)?.to_be_bytes())
}

fn chunk(film: &mut Vec<u8>, kind: [u8; 4], data: &[u8]) -> Result<()> {
    film.extend(number(data.len())?);
    let begin = film.len();
    film.extend(kind);
    film.extend(data);
    let checksum = CHECKSUM.checksum(&film[begin..]);
    film.extend(checksum.to_be_bytes());
    Ok(())
}

/// Lines without a filter: numbers of colours are not near each other because the colours are.
fn deflated(frame: &Frame) -> Result<Vec<u8>> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
    for line in frame.pixels.chunks_exact(frame.size[0]) {
        encoder.write_all(&[0])?;
        encoder.write_all(line)?;
    }
    Ok(encoder.finish()?)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A PNG of lines with their filters.
    pub(crate) fn png(depth: u8, colours: u8, size: [u32; 2], lines: &[u8]) -> Vec<u8> {
        let mut png = SIGNATURE.to_vec();
        let head = [&size[0].to_be_bytes()[..], &size[1].to_be_bytes(), &[depth, colours, 0, 0, 0]].concat();
        chunk(&mut png, *b"IHDR", &head).unwrap();
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
        encoder.write_all(lines).unwrap();
        let data = encoder.finish().unwrap();
        let (first, second) = data.split_at(data.len() / 2);
        chunk(&mut png, *b"IDAT", first).unwrap();
        chunk(&mut png, *b"IDAT", second).unwrap();
        chunk(&mut png, *b"IEND", &[]).unwrap();
        png
    }

    #[test]
    fn every_filter_is_undone() {
        // Two pixels a line; the same picture under each filter, worked out by hand.
        let lines = [
            [0, 10, 20, 30, 40, 50, 60],
            [1, 11, 22, 33, 30, 30, 30],
            [2, 1, 1, 1, 1, 1, 1],
            [3, 6, 12, 18, 20, 20, 20],
            [4, 1, 1, 1, 1, 1, 1],
        ];
        let picture = read(&png(8, RGB, [2, 5], lines.as_flattened())).unwrap();
        let expected = [
            [[10, 20, 30], [40, 50, 60]],
            [[11, 22, 33], [41, 52, 63]],
            [[12, 23, 34], [42, 53, 64]],
            [[12, 23, 35], [47, 58, 69]],
            [[13, 24, 36], [48, 59, 70]],
        ];
        assert_eq!(picture, Picture { size: [2, 5], pixels: expected.as_flattened().to_vec() });
        let picture = read(&png(8, RGBA, [2, 1], &[1, 1, 2, 3, 255, 1, 1, 1, 0])).unwrap();
        assert_eq!(picture.pixels, [[1, 2, 3], [2, 3, 4]]);
    }

    #[test]
    fn other_and_damaged_pictures_are_refused() {
        let whole = png(8, RGB, [1, 1], &[0, 1, 2, 3]);
        assert!(read(&whole).is_ok());
        for (wrong, why) in [
            (png(16, RGB, [1, 1], &[0, 1, 2, 3]), "8 bits"),
            (png(8, RGB, [2, 1], &[0, 1, 2, 3]), "more or fewer pixels"),
            (png(8, RGB, [1, 1], &[7, 1, 2, 3]), "the filter 7"),
            (whole[..whole.len() - 6].to_vec(), "ends in a chunk"),
            (whole[1..].to_vec(), "no PNG"),
        ] {
            let error = read(&wrong).unwrap_err().to_string();
            assert!(error.contains(why), "{error}");
        }
    }

    #[test]
    fn a_film_has_its_chunks_in_order_and_whole() {
        let first = Frame { stays_ms: 100, at: [0, 0], size: [2, 1], pixels: vec![0, 1] };
        let second = Frame { stays_ms: 250, at: [1, 0], size: [1, 1], pixels: vec![0] };
        let film = write_film([2, 1], &[[1, 2, 3], [4, 5, 6], [0, 0, 0]], 2, &[first, second.clone()]).unwrap();
        let mut rest = &film[8..];
        let mut chunks = Vec::new();
        while let Some((&length, after)) = rest.split_first_chunk::<4>() {
            let length = u32::from_be_bytes(length) as usize;
            let checksum = u32::from_be_bytes(after[4 + length..][..4].try_into().unwrap());
            assert_eq!(CHECKSUM.checksum(&after[..4 + length]), checksum);
            chunks.push((String::from_utf8(after[..4].to_vec()).unwrap(), after[4..][..length].to_vec()));
            rest = &after[8 + length..];
        }
        let names: Vec<_> = chunks.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["IHDR", "acTL", "PLTE", "tRNS", "fcTL", "IDAT", "fcTL", "fdAT", "IEND"]);
        let number = |chunk: usize, at: usize| u32::from_be_bytes(chunks[chunk].1[at..][..4].try_into().unwrap());
        assert_eq!((number(1, 0), number(4, 0), number(6, 0), number(7, 0)), (2, 0, 1, 2), "frames, and their order");
        assert_eq!([4, 8, 12, 16].map(|at| number(6, at)), [1, 1, 1, 0], "where the second lies");
        assert_eq!(chunks[6].1[20..], [0, 250, 3, 232, 0, 1], "250 ms of 1000, over what was there");
        assert_eq!(chunks[3].1, [255, 255, 0]);
        let mut line = Vec::new();
        ZlibDecoder::new(&chunks[7].1[4..]).read_to_end(&mut line).unwrap();
        assert_eq!(line, [0, 0]);
        assert!(write_film([2, 1], &[[0; 3]; 3], 2, &[second]).is_err(), "it begins with a part");
    }
}
