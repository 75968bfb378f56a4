//! Lengths of texts and lists.
//!
//! Postcard takes as many bytes of a length as fill the machine's own word: ten on most hosts, five on a board. Here they are numbers of 32 bits
//! on both, so that a host and a board take the same packets.

use core::fmt;
use core::marker::PhantomData;

use heapless::{String, Vec};
use serde::de::{Deserialize, Deserializer, Error, SeqAccess, Visitor};

/// Reads a list: a length of 32 bits, then so many elements.
///
/// # Errors
/// If the list is cut, or has more than `N` elements.
pub(crate) fn list<'de, D, T, const N: usize>(deserializer: D) -> Result<Vec<T, N>, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de>,
{
    // In postcard a tuple is its elements, and nothing tells their number.
    deserializer.deserialize_tuple(1 + N, List(PhantomData))
}

/// Reads a text: a length of 32 bits, then so many bytes of UTF-8.
///
/// # Errors
/// If the text is cut, longer than `N` bytes, or not UTF-8.
pub(crate) fn text<'de, D: Deserializer<'de>, const N: usize>(deserializer: D) -> Result<String<N>, D::Error> {
    String::from_utf8(list(deserializer)?).map_err(|_| D::Error::custom("not UTF-8"))
}

struct List<T, const N: usize>(PhantomData<T>);

impl<'de, T: Deserialize<'de>, const N: usize> Visitor<'de> for List<T, N> {
    type Value = Vec<T, N>;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "a list of {N} at most")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut elements: A) -> Result<Self::Value, A::Error> {
        let cut = || A::Error::custom("a list that is cut");
        let length: u32 = elements.next_element()?.ok_or_else(cut)?;
        let mut list = Vec::new();
        for _ in 0..length {
            let element = elements.next_element()?.ok_or_else(cut)?;
            list.push(element).map_err(|_| A::Error::custom("too long a list"))?;
        }
        Ok(list)
    }
}
