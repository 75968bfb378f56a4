//! The day on which a file is made, and the time.

use std::time::{Duration, SystemTime};

/// Today, in UTC, as a date of ISO 8601.
pub fn today() -> String {
    date(SystemTime::now())
}

/// So long after 1970, in UTC, as date and time of ISO 8601 to the millisecond.
pub fn date_time(since_1970: Duration) -> String {
    let (seconds, millis) = (since_1970.as_secs() % 86_400, since_1970.subsec_millis());
    let [hours, minutes, seconds] = [seconds / 3600, seconds / 60 % 60, seconds % 60];
    let date = date(SystemTime::UNIX_EPOCH + since_1970);
    format!("{date}T{hours:02}:{minutes:02}:{seconds:02}.{millis:03}Z")
}

/// A day of the Gregorian calendar, in UTC (days from civil, after H. Hinnant's algorithm for the proleptic calendar).
fn date(now: SystemTime) -> String {
    let seconds = now.duration_since(SystemTime::UNIX_EPOCH).map_or(0, |since| since.as_secs());
    let days = seconds / 86_400 + 719_468;
    let (era, of_era) = (days / 146_097, days % 146_097);
    let year_of_era = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month = (5 * of_year + 2) / 153;
    let day = of_year - (153 * month + 2) / 5 + 1;
    let (year, month) = (year_of_era + era * 400, if month < 10 { month + 3 } else { month - 9 });
    format!("{:04}-{month:02}-{day:02}", if month <= 2 { year + 1 } else { year })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_are_those_of_the_calendar() {
        let at = |days: u64| date(SystemTime::UNIX_EPOCH + Duration::from_secs(86_400 * days + 5));
        assert_eq!([at(0), at(59), at(11_016), at(20_778)], ["1970-01-01", "1970-03-01", "2000-02-29", "2026-11-21"]);
        assert_eq!(date_time(Duration::from_millis(1_763_733_909_042)), "2025-11-21T14:05:09.042Z");
    }
}
