//! The forward models against the reference readings: docs/validation.md.

use super::figure;
use super::reference::CASES;
use crate::figure::Figure;

pub(super) fn figures() -> Vec<Figure> {
    let largest = "largest difference of a reading, over the largest reading";
    let mut all = Vec::new();
    for (case, name) in CASES {
        for (job, model) in [("validate-slab", "slab"), ("validate-shell", "shell")] {
            let path = format!("cases/case={case}/forward_error");
            let says = format!("{largest}: the {model} on the reference case {case}");
            all.push(figure(job, format!("forward.{model}.{name}"), says, path).per_cent().by(0.01));
        }
        let path = format!("cases/case={case}/reference_error");
        let says = format!("{largest}: the reference's own two meshes of {case}");
        all.push(figure("validate-slab", format!("forward.reference.{name}"), says, path).per_cent().by(0.01));
    }
    all
}
