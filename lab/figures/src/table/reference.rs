//! Errors on the reference readings: docs/measured.md, docs/validation.md.

use super::figure;
use crate::figure::Figure;

/// The cases of `tests/reference/slab`, and what documents call them.
pub(super) const CASES: [(&str, &str); 12] = [
    ("square60_A_light", "light"),
    ("square60_A_corner", "corner"),
    ("square60_A_centre", "centre"),
    ("square60_A_hard", "hard"),
    ("square60_A_two", "two"),
    ("square60_A_wide", "wide"),
    ("strip13x60", "strip"),
    ("display140x70", "display"),
    ("fingertip10", "fingertip"),
    ("square60_stack_AB", "stack"),
    ("square60_position_gradient", "position-gradient"),
    ("square60_sensitive_gradient", "sensitive-gradient"),
];

pub(super) fn figures() -> Vec<Figure> {
    let mut all = vec![
        figure(
            "validate-slab",
            "forward.readings",
            "largest difference of a reading, over the largest reading",
            "cases/*/forward_error",
        )
        .largest()
        .per_cent()
        .by(0.01),
        figure(
            "validate-slab",
            "forward.references-own",
            "the same between the references' two meshes",
            "cases/*/reference_error",
        )
        .largest()
        .per_cent()
        .by(0.01),
    ];
    for (case, name) in CASES {
        for (job, model) in [("validate-slab", "slab"), ("validate-shell", "shell")] {
            for solver in ["tikhonov", "tikhonov-paper"] {
                let of = |what: &str, id: &str, field: &str| {
                    let path = format!("cases/case={case}/solvers/solver={solver}/{field}");
                    let says = format!("{what} of {solver} with the {model} on the reference case {case}");
                    figure(job, format!("{solver}.{model}.{name}{id}"), says, path)
                };
                all.push(of("error", "", "position_error_m").mm().by(0.05));
                // Equal peaks between electrodes may count or not, by the last digits.
                all.push(of("number of contacts found", ".found", "count_found").by(1.0));
            }
        }
        let path = |field: &str| format!("cases/case={case}/solvers/solver=auto/{field}");
        let of = |field| {
            figure("validate-noise", format!("auto.{name}.{field}"), format!("{field} of auto on {case}, 1.5 LSB"), "")
        };
        let error = Figure { path: path("position_error_m"), ..of("error") }.mm().by(0.02);
        let found = Figure { path: path("count_found"), ..of("found") };
        all.extend([error, found]);
        if name != "two" {
            let conductance = Figure { path: path("contacts/0/conductance_s"), ..of("conductance") };
            all.push(conductance.unit("S", 1.0).share(0.05));
        }
    }
    all
}
