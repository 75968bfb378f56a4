//! What a rub is worth: docs/calibrate.md.

use super::figure;
use crate::figure::Figure;

pub(super) fn figures() -> Vec<Figure> {
    let mut all = Vec::new();
    for (job, detectors) in [
        ("drawn", "4 drawn detectors"),
        ("drawn-rubbed", "4 drawn detectors after a rub"),
        ("built-rubbed", "built101 after a rub"),
    ] {
        for (contacts, name) in [(1, "single"), (2, "pairs")] {
            let of = |field: &str, says: &str, path: &str| {
                let says = format!("{says}, {name} presses on {detectors}, auto");
                let path = format!("rows/detector=null&contacts={contacts}/{path}");
                figure(job, format!("{job}.{name}.{field}"), says, path)
            };
            all.push(of("scenes", "presses", "scenes"));
            all.push(of("error", "mean error", "error_m").mm().share(0.1));
            all.push(of("p95", "error, 95 % below", "p95_m").mm().share(0.2));
            all.push(of("count", "count right", "count_right").per_cent().by(5.0));
            all.push(of("within-1", "coordinates within one standard error", "within/0").per_cent().by(8.0));
            all.push(of("within-2", "coordinates within two standard errors", "within/1").per_cent().by(5.0));
        }
    }
    all
}
