//! NumPy's file of one array.
//!
//! As in NumPy's documentation of `numpy.lib.format`: the magic `\x93NUMPY`, a version of two bytes, the length of the header (two
//! bytes in version 1, four after it, little-endian), the header, a literal dictionary of Python with `descr`,
//! `fortran_order` and `shape`, and the numbers.

use super::Array;

const MAGIC: &[u8] = b"\x93NUMPY";
/// Numbers begin at a multiple of this.
const ALIGNMENT: usize = 64;
/// Most axes of an array.
const MOST_AXES: usize = 8;

/// Bytes of a character of a text (UTF-32).
const CHARACTER_BYTES: usize = 4;

/// What an array holds.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// Numbers.
    Numbers(Array),
    /// A single text: of an array without dimensions.
    Text(String),
}

/// Whether a file begins as one of these.
pub fn is_npy(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

/// Reads the array.
///
/// # Errors
/// What is wrong with it.
pub fn parse(bytes: &[u8]) -> Result<Array, String> {
    numbers(Header::of(bytes)?)
}

/// Reads the array, which may be a text.
///
/// # Errors
/// What is wrong with it.
pub fn parse_value(bytes: &[u8]) -> Result<Value, String> {
    let header = Header::of(bytes)?;
    match header.kind.as_bytes() {
        [order @ (b'<' | b'>'), b'U', ..] if header.shape.is_empty() => text(&header, *order == b'>').map(Value::Text),
        [_, b'U', ..] => Err("an array of texts is not read, only a single text".to_owned()),
        _ => numbers(header).map(Value::Numbers),
    }
}

/// What a file says of its array, and the array's bytes.
struct Header<'a> {
    kind: &'a str,
    shape: Vec<usize>,
    by_columns: bool,
    data: &'a [u8],
}

impl<'a> Header<'a> {
    fn of(bytes: &'a [u8]) -> Result<Self, String> {
        let (header, data) = split(bytes).ok_or("the header of the array is cut off")?;
        let kind = after(header, "'descr':").and_then(quoted).ok_or("the array has no kind of number")?;
        let shape = after(header, "'shape':").and_then(shape).ok_or("the array has no shape")?;
        let by_columns = after(header, "'fortran_order':").is_some_and(|rest| rest.trim_start().starts_with("True"));
        Ok(Self { kind, shape, by_columns, data })
    }
}

/// A text, which NumPy fills up with zeros.
fn text(header: &Header, big_end_first: bool) -> Result<String, String> {
    let Header { kind, data, .. } = header;
    let characters: Option<usize> = kind.get(2..).and_then(|length| length.parse().ok());
    if characters.and_then(|count| count.checked_mul(CHARACTER_BYTES)) != Some(data.len()) {
        return Err(format!("the text has {} bytes, which is not {}", data.len(), kind.escape_debug()));
    }
    let codes = data.as_chunks::<CHARACTER_BYTES>().0.iter();
    let codes = codes.map(|bytes| if big_end_first { u32::from_be_bytes(*bytes) } else { u32::from_le_bytes(*bytes) });
    let text: Option<String> = codes.map(char::from_u32).collect();
    let text = text.ok_or("the text has what is no character")?;
    Ok(text.trim_end_matches('\0').to_owned())
}

fn numbers(Header { kind, shape, by_columns, data }: Header) -> Result<Array, String> {
    let number = Number::of(kind)?;
    let count = shape.iter().try_fold(1usize, |count, &length| count.checked_mul(length));
    let needed = count.and_then(|count| count.checked_mul(number.bytes));
    if needed != Some(data.len()) {
        return Err(format!("the array has {} bytes, which is not its shape in {kind}", data.len()));
    }
    let values: Vec<f64> = data.chunks_exact(number.bytes).map(|bytes| number.value(bytes)).collect();
    let values = if by_columns { by_rows(&shape, &values) } else { values };
    Ok(Array { shape, values })
}

/// Values whose first axis runs fastest (Fortran's order), with the last one fastest.
fn by_rows(shape: &[usize], values: &[f64]) -> Vec<f64> {
    let mut ordered = Vec::with_capacity(values.len());
    let mut at = vec![0; shape.len()];
    for _ in 0..values.len() {
        let index = at.iter().zip(shape).rev().fold(0, |index, (at, length)| index * length + at);
        ordered.push(values[index]);
        for (at, length) in at.iter_mut().zip(shape).rev() {
            *at += 1;
            if *at < *length {
                break;
            }
            *at = 0;
        }
    }
    ordered
}

/// Header and numbers.
fn split(bytes: &[u8]) -> Option<(&str, &[u8])> {
    let (&version, rest) = bytes.strip_prefix(MAGIC)?.split_first()?;
    let rest = rest.get(1..)?;
    let (length, rest) = if version == 1 {
        let (length, rest) = rest.split_first_chunk::<2>()?;
        (usize::from(u16::from_le_bytes(*length)), rest)
    } else {
        let (length, rest) = rest.split_first_chunk::<4>()?;
        (usize::try_from(u32::from_le_bytes(*length)).ok()?, rest)
    };
    let (header, data) = rest.split_at_checked(length)?;
    Some((str::from_utf8(header).ok()?, data))
}

/// What follows a key.
fn after<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    header.split_once(key).map(|(_, rest)| rest)
}

fn quoted(rest: &str) -> Option<&str> {
    rest.trim_start().strip_prefix('\'')?.split_once('\'').map(|(inside, _)| inside)
}

/// Lengths between brackets: `(3, 256)`, `(3,)`, `()`.
fn shape(rest: &str) -> Option<Vec<usize>> {
    let (inside, _) = rest.trim_start().strip_prefix('(')?.split_once(')')?;
    let lengths = inside.split(',').map(str::trim).filter(|length| !length.is_empty());
    let shape: Vec<usize> = lengths.map(|length| length.parse().ok()).collect::<Option<_>>()?;
    (shape.len() <= MOST_AXES).then_some(shape)
}

/// How a number is kept.
struct Number {
    kind: u8,
    bytes: usize,
    big_end_first: bool,
}

impl Number {
    fn of(kind: &str) -> Result<Self, String> {
        let wrong = || format!("arrays of {} are not read: save them as float64", kind.escape_debug());
        let &[order, kind, size] = kind.as_bytes() else { return Err(wrong()) };
        let bytes = usize::from(size.wrapping_sub(b'0'));
        let known = matches!((kind, bytes), (b'f', 4 | 8) | (b'i' | b'u', 1 | 2 | 4 | 8) | (b'b', 1));
        if !known || !b"<>|=".contains(&order) {
            return Err(wrong());
        }
        Ok(Self { kind, bytes, big_end_first: order == b'>' })
    }

    fn value(&self, bytes: &[u8]) -> f64 {
        // Little end first, whatever it was, in as many bytes as the longest has.
        let mut word = [0; 8];
        word[..bytes.len()].copy_from_slice(bytes);
        if self.big_end_first {
            word[..bytes.len()].reverse();
        }
        let unsigned = u64::from_le_bytes(word);
        match (self.kind, self.bytes) {
            (b'f', 4) => f64::from(f32::from_bits(unsigned as u32)),
            (b'f', _) => f64::from_bits(unsigned),
            (b'u' | b'b', _) => unsigned as f64,
            _ => {
                let unused = 64 - 8 * self.bytes as u32;
                ((unsigned << unused) as i64 >> unused) as f64
            }
        }
    }
}

/// What an array is of, in the kind in which it is kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Values<'a> {
    /// In double precision.
    Numbers(&'a [f64]),
    /// In 64 bits.
    Integers(&'a [i64]),
    /// In a byte each.
    Flags(&'a [bool]),
    /// A text, of an array without dimensions.
    Text(&'a str),
}

impl Values<'_> {
    /// What NumPy calls their kind.
    fn kind(self) -> String {
        match self {
            Self::Numbers(_) => "<f8".to_owned(),
            Self::Integers(_) => "<i8".to_owned(),
            Self::Flags(_) => "|b1".to_owned(),
            Self::Text(text) => format!("<U{}", text.chars().count()),
        }
    }

    fn bytes(self) -> Vec<u8> {
        match self {
            Self::Numbers(values) => values.iter().flat_map(|value| value.to_le_bytes()).collect(),
            Self::Integers(values) => values.iter().flat_map(|value| value.to_le_bytes()).collect(),
            Self::Flags(values) => values.iter().map(|value| u8::from(*value)).collect(),
            Self::Text(text) => text.chars().flat_map(|character| u32::from(character).to_le_bytes()).collect(),
        }
    }
}

/// The file of an array.
pub fn bytes(shape: &[usize], values: Values) -> Vec<u8> {
    let lengths: String = shape.iter().map(|length| format!("{length},")).collect();
    let kind = values.kind();
    let mut header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({lengths}), }}");
    let before = MAGIC.len() + 4;
    let padding = (before + header.len() + 1).next_multiple_of(ALIGNMENT) - before - header.len() - 1;
    header.extend(std::iter::repeat_n(' ', padding));
    header.push('\n');
    let mut bytes = [MAGIC, &[1, 0], &(header.len() as u16).to_le_bytes(), header.as_bytes()].concat();
    bytes.extend(values.bytes());
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As `numpy.save` writes it.
    fn file(header: &str, data: &[u8]) -> Vec<u8> {
        [MAGIC, &[1, 0], &(header.len() as u16).to_le_bytes(), header.as_bytes(), data].concat()
    }

    fn of(kind: &str, data: &[u8]) -> Result<Array, String> {
        parse(&file(&format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': (1,), }}  \n"), data))
    }

    #[test]
    fn what_is_written_is_read() {
        let values = [1.0, -2.5, f64::INFINITY, 1e-300, 0.0, 7.0];
        for shape in [&[6][..], &[2, 3], &[1, 3, 2]] {
            let bytes = bytes(shape, Values::Numbers(&values));
            assert_eq!(parse(&bytes), Ok(Array { shape: shape.to_vec(), values: values.to_vec() }));
            assert_eq!((bytes.len() - 48) % ALIGNMENT, 0, "as NumPy aligns them");
        }
        let integers = bytes(&[2], Values::Integers(&[-1, 1 << 52]));
        assert_eq!(parse(&integers), Ok(Array::flat(vec![-1.0, (1u64 << 52) as f64])));
        assert_eq!(parse(&bytes(&[2], Values::Flags(&[true, false]))), Ok(Array::flat(vec![1.0, 0.0])));
    }

    #[test]
    fn a_text_is_read_as_numpy_keeps_it() {
        let read = |kind: &str, shape: &str, data: &[u8]| {
            parse_value(&file(&format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}"), data))
        };
        let text = |text: &str| Ok(Value::Text(text.to_owned()));
        assert_eq!(parse_value(&bytes(&[], Values::Text("{\"r\": \"5 \u{b5}m\"}"))), text("{\"r\": \"5 \u{b5}m\"}"));
        assert_eq!(read("<U3", "()", b"a\0\0\0b\0\0\0\0\0\0\0"), text("ab"), "filled up with zeros");
        assert_eq!(read(">U1", "()", b"\0\0\0a"), text("a"));
        assert_eq!(read("<f8", "()", &[0; 8]), Ok(Value::Numbers(Array { shape: Vec::new(), values: vec![0.0] })));
        for (kind, shape, data, what) in [
            ("<U2", "()", &b"a\0\0\0"[..], "4 bytes, which is not <U2"),
            ("<U", "()", b"", "not <U"),
            ("<U99999999999999999999", "()", b"", "not <U9"),
            ("<U1", "()", &[0xff; 4], "no character"),
            ("<U1", "(1,)", b"a\0\0\0", "an array of texts"),
            ("|S1", "()", b"a", "arrays of |S1 are not read"),
        ] {
            assert!(read(kind, shape, data).is_err_and(|error| error.contains(what)), "{kind} {shape}");
        }
    }

    #[test]
    fn numbers_of_every_kind_are_read() {
        for (kind, data, value) in [
            ("<f4", &1.5f32.to_le_bytes()[..], 1.5),
            (">f8", &(-2.25f64).to_be_bytes(), -2.25),
            ("|u1", &[200], 200.0),
            ("|i1", &[200], -56.0),
            ("<u2", &[0xff, 0x0f], 4095.0),
            (">i2", &[0xff, 0xfe], -2.0),
            ("<i4", &[0xff; 4], -1.0),
            ("<u8", &[1, 0, 0, 0, 1, 0, 0, 0], 4_294_967_297.0),
            ("<i8", &[0xff; 8], -1.0),
        ] {
            assert_eq!(of(kind, data), Ok(Array::flat(vec![value])), "{kind}");
        }
    }

    #[test]
    fn arrays_that_are_kept_column_by_column_are_read() {
        // numpy.asfortranarray(numpy.arange(n).reshape(shape)) has these numbers one after the other.
        for (shape, kept) in [
            ("(2, 3)", &[0.0_f64, 3.0, 1.0, 4.0, 2.0, 5.0][..]),
            ("(2, 1, 2)", &[0.0, 2.0, 1.0, 3.0]),
            ("(1, 2, 3)", &[0.0, 3.0, 1.0, 4.0, 2.0, 5.0]),
            ("(3,)", &[0.0, 1.0, 2.0]),
            ("(0, 2)", &[]),
        ] {
            let data: Vec<u8> = kept.iter().flat_map(|value| value.to_le_bytes()).collect();
            let header = format!("{{'descr': '<f8', 'fortran_order': True, 'shape': {shape}, }}");
            let read = parse(&file(&header, &data)).unwrap();
            let expected: Vec<f64> = (0..kept.len()).map(|i| i as f64).collect();
            assert_eq!(read.values, expected, "{shape}");
        }
    }

    #[test]
    fn what_is_not_read_is_refused() {
        assert!(of("<c16", &[0; 16]).unwrap_err().contains("arrays of <c16 are not read"));
        assert!(of("<f2", &[0; 2]).is_err());
        assert!(of("<f8", &[0; 9]).unwrap_err().contains("9 bytes"));
        let of_shape = |shape: &str, order: &str| {
            parse(&file(&format!("{{'descr': '<f8', 'fortran_order': {order}, 'shape': {shape}, }}"), &[0; 8]))
        };
        assert!(of_shape("(99999999999, 99999999999)", "False").is_err(), "a shape that no memory holds");
        assert!(of_shape("(-1,)", "False").unwrap_err().contains("no shape"));
        assert_eq!(of_shape("()", "False"), Ok(Array { shape: Vec::new(), values: vec![0.0] }));
        assert!(parse(b"\x93NUMPY\x01\x00\xff\xff{}").unwrap_err().contains("cut off"));
    }
}
