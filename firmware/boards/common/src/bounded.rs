//! Waits for a converter, with a bound.

use tactomo_firmware::TimedOut;

/// Looks until there is something to see, so many times at most.
///
/// # Errors
/// [`TimedOut`] if nothing was there.
pub fn within<T>(looks: u32, mut look: impl FnMut() -> Option<T>) -> Result<T, TimedOut> {
    (0..looks).find_map(|_| look()).ok_or(TimedOut)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_comes_in_time_is_taken_and_a_wait_ends() {
        for (comes_after, expected) in [(1, Ok(7)), (600, Ok(7)), (601, Err(TimedOut)), (u32::MAX, Err(TimedOut))] {
            let mut looks = 0;
            let result = within(600, || {
                looks += 1;
                (looks >= comes_after).then_some(7)
            });
            assert_eq!((result, looks), (expected, comes_after.min(600)));
        }
    }
}
