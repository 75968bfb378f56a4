//! Triangle meshes as files: Wavefront OBJ, and STL in text and in binary.
//!
//! Files are not to be trusted: nothing is reserved by what a file says of itself, and every error says where it is.

use crate::space::Place;

/// Corners and triangles as a file has them, in its own unit.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Raw {
    pub places: Vec<Place>,
    pub triangles: Vec<[usize; 3]>,
}

/// What a file is wrong about, and where.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FormatError {
    /// A line of a text file, from 1.
    #[error("line {line}: {what}")]
    Line {
        /// Its number, from 1.
        line: usize,
        /// What is wrong and what is allowed.
        what: String,
    },
    /// A place in a binary file.
    #[error("byte {offset}: {what}")]
    Byte {
        /// From 0.
        offset: usize,
        /// What is wrong and what is allowed.
        what: String,
    },
    /// A name with another ending.
    #[error("has to be a file that ends in .obj or .stl")]
    Ending,
}

const HEADER: usize = 84;
const RECORD: usize = 50;

/// Reads a file's bytes; the name's ending says what it is.
pub(super) fn parse(bytes: &[u8], name: &str) -> Result<Raw, FormatError> {
    let ending = name.rsplit('.').next().unwrap_or_default().to_ascii_lowercase();
    match ending.as_str() {
        "obj" => parse_obj(&String::from_utf8_lossy(bytes)),
        // Binary files may begin with `solid` too; only their length gives them away.
        "stl" if binary_count(bytes).is_some_and(|count| bytes.len() == HEADER + RECORD * count) => {
            parse_binary_stl(bytes)
        }
        "stl" if bytes.trim_ascii_start().starts_with(b"solid") && !bytes.contains(&0) => {
            parse_text_stl(&String::from_utf8_lossy(bytes))
        }
        "stl" => Err(FormatError::Byte { offset: 80.min(bytes.len()), what: binary_length(bytes) }),
        _ => Err(FormatError::Ending),
    }
}

/// What a binary STL says of the number of its triangles.
fn binary_count(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(80..HEADER)?.try_into().ok().map(u32::from_le_bytes)?;
    usize::try_from(count).ok().filter(|count| *count <= usize::MAX / RECORD - HEADER)
}

fn binary_length(bytes: &[u8]) -> String {
    let length = bytes.len();
    match binary_count(bytes) {
        Some(count) => format!(
            "a binary STL of {count} triangles has {} bytes, but the file has {length}: save it again",
            HEADER + RECORD * count
        ),
        None => format!("the file has {length} bytes, fewer than the head of an STL: save it again"),
    }
}

fn parse_binary_stl(bytes: &[u8]) -> Result<Raw, FormatError> {
    let mut raw = Raw::default();
    for (index, record) in bytes[HEADER..].chunks_exact(RECORD).enumerate() {
        // The normal comes first, and is what the corners say.
        let mut numbers =
            record[12..48].chunks_exact(4).map(|b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])));
        let corners = [(); 3].map(|()| [(); 3].map(|()| numbers.next().unwrap_or(f64::NAN)));
        if corners.iter().flatten().any(|number| !number.is_finite()) {
            let what = format!("triangle {index} has a coordinate that is not a finite number");
            return Err(FormatError::Byte { offset: HEADER + RECORD * index, what });
        }
        raw.push(corners);
    }
    Ok(raw)
}

fn parse_text_stl(text: &str) -> Result<Raw, FormatError> {
    let mut raw = Raw::default();
    let mut corners = Vec::new();
    let mut last = 0;
    for (line, words) in lines(text) {
        last = line;
        let wrong = |what: String| Err(FormatError::Line { line, what });
        match words.first().copied() {
            Some("vertex") => corners.push(numbers(&words[1..], line)?),
            Some("endfacet") => match corners[..] {
                [a, b, c] => {
                    raw.push([a, b, c]);
                    corners.clear();
                }
                _ => return wrong(format!("a facet ends that has {} vertices, but has to have 3", corners.len())),
            },
            Some("facet") if !corners.is_empty() => {
                return wrong("a facet begins before the last has ended".to_owned());
            }
            None | Some("solid" | "facet" | "outer" | "endloop" | "endsolid") => {}
            // Some programs put the name of the solid on a line of its own.
            Some(_) if raw.triangles.is_empty() => {}
            Some(other) => return wrong(format!("`{}` is not of an STL", shortened(other))),
        }
    }
    if corners.is_empty() {
        return Ok(raw);
    }
    Err(FormatError::Line { line: last, what: "the file ends within a facet: save it again".to_owned() })
}

fn parse_obj(text: &str) -> Result<Raw, FormatError> {
    let mut raw = Raw::default();
    let mut lines_of_triangles = Vec::new();
    for (line, words) in lines(text) {
        match words.first().copied() {
            Some("v") => raw.places.push(numbers(&words[1..], line)?),
            Some("f") => {
                let corners = words[1..].iter().map(|word| reference(word, raw.places.len(), line));
                let corners = corners.collect::<Result<Vec<_>, _>>()?;
                if corners.len() < 3 {
                    let what = format!("a face has {} corners, but has to have 3 or more", corners.len());
                    return Err(FormatError::Line { line, what });
                }
                // A polygon as a fan.
                for pair in corners[1..].windows(2) {
                    raw.triangles.push([corners[0], pair[0], pair[1]]);
                    lines_of_triangles.push(line);
                }
            }
            // Normals, textures, groups and materials say nothing of the shape.
            _ => {}
        }
    }
    let count = raw.places.len();
    match raw.triangles.iter().position(|triangle| triangle.iter().any(|corner| *corner >= count)) {
        Some(index) => {
            let what = format!("a face names a vertex that is not among the {count} of the file");
            Err(FormatError::Line { line: lines_of_triangles[index], what })
        }
        None => Ok(raw),
    }
}

/// Number of the vertex that a corner of an OBJ's face names, as `7`, `7/1/2`, or `-1` for the last one so far.
fn reference(word: &str, so_far: usize, line: usize) -> Result<usize, FormatError> {
    let number = word.split('/').next().and_then(|number| number.parse::<i64>().ok());
    let index = match number {
        Some(number @ 1..) => usize::try_from(number - 1).ok(),
        Some(number @ ..=-1) => usize::try_from(number.unsigned_abs()).ok().and_then(|back| so_far.checked_sub(back)),
        _ => None,
    };
    let what = || format!("`{}` names no vertex; vertices are counted from 1, or back from -1", shortened(word));
    index.ok_or_else(|| FormatError::Line { line, what: what() })
}

impl Raw {
    fn push(&mut self, corners: [Place; 3]) {
        let first = self.places.len();
        self.places.extend(corners);
        self.triangles.push([first, first + 1, first + 2]);
    }
}

/// Lines with their number, from 1, as words without comments.
fn lines(text: &str) -> impl Iterator<Item = (usize, Vec<&str>)> {
    let words = |line: &'_ str| -> std::ops::Range<usize> { 0..line.find('#').unwrap_or(line.len()) };
    (1..).zip(text.lines().map(move |line| line[words(line)].split_whitespace().collect()))
}

/// Three finite numbers; more, such as a weight or colours, are passed over.
fn numbers(words: &[&str], line: usize) -> Result<Place, FormatError> {
    let number = |index: usize| {
        let word = words.get(index).copied().unwrap_or_default();
        let what = || format!("`{}` is not a finite number; a vertex has three", shortened(word));
        let number = word.parse::<f64>().ok().filter(|number| number.is_finite());
        number.ok_or_else(|| FormatError::Line { line, what: what() })
    };
    Ok([number(0)?, number(1)?, number(2)?])
}

fn shortened(word: &str) -> String {
    word.chars().take(24).collect()
}
