//! Solvers on random scenes and detectors as built, and their times: docs/solvers.md, docs/measured.md, README.

use super::figure;
use crate::figure::Figure;

/// Classes of `bank`, and what ids call them.
const CLASSES: [(&str, &str, bool); 15] = [
    ("1 contact", "1", true),
    ("2 contacts", "2", true),
    ("3 contacts", "3", true),
    ("4 contacts", "4", true),
    ("5 contacts", "5", true),
    ("all", "all", true),
    ("contrast above 100", "contrast", true),
    ("in corners", "corners", false),
    ("at walls", "walls", false),
    ("radius below 2 mm", "narrow", false),
    ("radius 2 to 3.5 mm", "middling", false),
    ("radius above 3.5 mm", "wide", false),
    ("below 0.1 sheets", "light", false),
    ("0.1 to 1 sheets", "firm", false),
    ("above 1 sheet", "hard", false),
];

pub(super) fn figures() -> Vec<Figure> {
    [random(), random_built(), core(), built(), speed(), rows(), unknowns(), surface()].concat()
}

/// `auto` on random contacts.
fn random() -> Vec<Figure> {
    let says = "random contacts: of answers that are 95 % sure of their count or more, those with as many as are there";
    let sure =
        figure("contacts", "contacts.sure.right".to_owned(), says.to_owned(), "claims/least=0.95/right".to_owned());
    let mut all = vec![sure.per_cent().by(3.0)];
    for (class, name, has_scenes) in CLASSES {
        let of = |field: &str, says: &str, path: &str| {
            let (id, says) = (format!("contacts.{name}.{field}"), format!("random contacts, {class}: {says}"));
            figure("contacts", id, says, format!("rows/class={class}/{path}"))
        };
        if has_scenes {
            all.push(of("count", "as many found as are there", "scenes/count_right").per_cent().by(3.0));
            all.push(of("right", "all visible ones found and none invented", "scenes/all_found").per_cent().by(3.0));
        }
        all.extend([
            of("found", "visible ones found", "contacts/found").per_cent().by(3.0),
            of("error", "error, median", "contacts/error_m/median").mm().share(0.1),
            of("error-p90", "error, 90 % below", "contacts/error_m/high").mm().share(0.3),
            of("over-bound", "error over the bound, 90 % below", "contacts/over_bound/high").share(0.2),
            of("within-1", "coordinates within one standard error", "contacts/place_within/0").per_cent().by(4.0),
            of("within-2", "coordinates within two standard errors", "contacts/place_within/1").per_cent().by(4.0),
            of("conductance-1", "conductances within one standard error", "contacts/conductance_within/0")
                .per_cent()
                .by(4.0),
            of("conductance-2", "conductances within two standard errors", "contacts/conductance_within/1")
                .per_cent()
                .by(4.0),
        ]);
    }
    all
}

/// `auto` on random contacts of a detector as built, described and after some presses of use.
fn random_built() -> Vec<Figure> {
    let mut all = Vec::new();
    for (job, says_of) in [
        ("contacts-built", "as described"),
        ("contacts-built-5", "after 5 presses"),
        ("contacts-built-20", "after 20 presses"),
    ] {
        let of = |field: &str, says: &str, path: &str| {
            let says = format!("random contacts on a detector as built, {says_of}: {says}");
            figure(job, format!("{job}.{field}"), says, path.to_owned())
        };
        let row = |path: &str| format!("rows/class=all/{path}");
        all.extend([
            of("right", "all visible ones found and none invented", &row("scenes/all_found")).per_cent().by(5.0),
            of("found", "visible ones found", &row("contacts/found")).per_cent().by(4.0),
            of("error", "error, median", &row("contacts/error_m/median")).mm().share(0.15),
            of("error-p90", "error, 90 % below", &row("contacts/error_m/high")).mm().share(0.3),
            of("within-1", "coordinates within one standard error", &row("contacts/place_within/0")).per_cent().by(5.0),
            of("within-2", "coordinates within two standard errors", &row("contacts/place_within/1"))
                .per_cent()
                .by(5.0),
            of("sure", "of answers 95 % sure or more of their count, the right ones", "claims/least=0.95/right")
                .per_cent()
                .by(5.0),
        ]);
    }
    all
}

/// `core` on random contacts, and `auto` on the same.
fn core() -> Vec<Figure> {
    let mut all = Vec::new();
    for (job, solver) in [("contacts-core", "core"), ("contacts-core-auto", "auto")] {
        for count in 1..=5 {
            let class = if count == 1 { "1 contact".to_owned() } else { format!("{count} contacts") };
            let of = |field: &str, says: &str, path: &str| {
                let (id, says) = (format!("{job}.{count}.{field}"), format!("{solver}, {class} on square-60: {says}"));
                figure(job, id, says, format!("rows/class={class}/{path}"))
            };
            all.extend([
                of("right", "all visible ones found and none invented", "scenes/all_found").per_cent().by(5.0),
                of("misfit", "said not to be explained", "scenes/misfit").per_cent().by(5.0),
                of("error", "error, median", "contacts/error_m/median").mm().share(0.15),
                of("error-p90", "error, 90 % below", "contacts/error_m/high").mm().share(0.3),
                of("within-1", "coordinates within one standard error", "contacts/place_within/0").per_cent().by(5.0),
                of("within-2", "coordinates within two standard errors", "contacts/place_within/1").per_cent().by(5.0),
                of("conductance-1", "conductances within one standard error", "contacts/conductance_within/0")
                    .per_cent()
                    .by(5.0),
                of("conductance-2", "conductances within two standard errors", "contacts/conductance_within/1")
                    .per_cent()
                    .by(5.0),
            ]);
        }
    }
    all
}

/// Single presses and pairs on the reference detector as built.
fn built() -> Vec<Figure> {
    let mut all = Vec::new();
    for solver in ["auto", "network", "tikhonov"] {
        for (contacts, name) in [(1, "single"), (2, "pairs")] {
            let of = |field: &str, says: &str, path: &str| {
                let says = format!("{says}, {name} presses on built101, {solver} by the description");
                let path = format!("rows/detector=built101&solver={solver}&contacts={contacts}/{path}");
                figure("built", format!("built.{solver}.{name}.{field}"), says, path)
            };
            all.push(of("error", "mean error", "error_m").mm().share(0.05));
            all.push(of("p95", "error, 95 % below", "p95_m").mm().share(0.1));
            all.push(of("count", "count right", "count_right").per_cent().by(3.0));
        }
    }
    all
}

/// Singular values above the noise.
fn unknowns() -> Vec<Figure> {
    let of = |id: &str, says: &str, path: &str| {
        let says = format!("singular values of square-60 that a light press lifts above the noise {says}");
        figure("picard", format!("picard.square.{id}"), says, format!("detectors/detector=square-60/{path}"))
    };
    vec![
        of("alone", "of a frame, nothing else pressed", "alone/above_noise").by(0.0),
        of("averaged", "of the mean of 100 frames, beside a firm one", "beside_firm/above_averaged").by(1.0),
    ]
}

/// One press place by place.
fn surface() -> Vec<Figure> {
    let mut all = Vec::new();
    for solver in
        ["auto", "nonlinear", "bsbl", "tv", "nonnegative", "laplace", "noser", "tikhonov", "tsvd", "tikhonov-paper"]
    {
        let of = |id: &str, says: &str, field: &str| {
            let says = format!("one firm press at each place of square-60, {solver}: {says}, median");
            figure("surface", format!("surface.{solver}.{id}"), says, format!("solvers/solver={solver}/{field}/median"))
        };
        all.extend([
            of("error", "error", "error_m").mm().share(0.1),
            of("amplitude", "amplitude response", "amplitude_response").share(0.05),
            of("position", "position error", "position_error_m").mm().by(0.05),
            of("resolution", "resolution", "resolution").share(0.05),
            of("deformation", "shape deformation", "shape_deformation").by(0.02),
            of("ringing", "ringing", "ringing").by(0.02),
        ]);
    }
    all
}

/// Solvers of `tradeoff`, with their defaults.
const SOLVERS: [&str; 14] = [
    "auto",
    "contacts",
    "core",
    "network",
    "nonlinear",
    "bsbl",
    "tv",
    "nonnegative",
    "laplace",
    "noser",
    "tsvd",
    "tikhonov",
    "tikhonov-paper",
    "kernel",
];

/// Time against error of defaults on `square-60`, and how close images are to the truth.
fn speed() -> Vec<Figure> {
    let mut all =
        vec![figure("tradeoff", "tradeoff.seconds", "time of `tradeoff --quick`", "seconds").unit("s", 1.0).share(0.5)];
    for solver in SOLVERS {
        for scene in ["five-fingers", "wide", "ring", "line"] {
            let id = format!("tradeoff.{solver}.{scene}.correlation");
            let says = format!("correlation of the image of {solver} with the truth, scene `{scene}`, square-60");
            let path =
                format!("detectors/0/solvers/solver={solver}&parameter=null/scenes/scene={scene}/summary/correlation");
            all.push(figure("tradeoff", id, says, path).by(0.1));
        }
        for name in ["one", "several", "shapes"] {
            let of = |field: &str, says: &str, path: &str| {
                let says = format!("{says} of {solver}, scenes of the group `{name}`, square-60");
                let path =
                    format!("detectors/0/solvers/solver={solver}&parameter=null/groups/group={name}/summary/{path}");
                figure("tradeoff", format!("tradeoff.{solver}.{name}.{field}"), says, path)
            };
            all.push(of("time", "time a frame, median", "time_us/median").unit("us", 1.0).share(0.5));
            all.push(of("error", "error, median", "error_spread_m/median").mm().share(0.2));
        }
    }
    all
}

/// Whole frames against rows.
fn rows() -> Vec<Figure> {
    let mut all = Vec::new();
    for (choice, rows, name) in [("whole", 16, "whole"), ("adaptive", 1, "one-row"), ("adaptive", 2, "two-rows")] {
        for contacts in 1..=3 {
            for (speed, motion) in [("0.0", "stands"), ("0.05", "slow"), ("0.5", "fast")] {
                let path = format!("points/choice={choice}&rows={rows}&contacts={contacts}&speed_m_per_s={speed}");
                let of = |field: &str, says: &str| {
                    let id = format!("rows.{name}.{contacts}.{motion}.{field}");
                    figure(
                        "scan",
                        id,
                        format!("{says}, {contacts} contacts at {speed} m/s, {name}"),
                        format!("{path}/{field}_m"),
                    )
                };
                all.push(of("arrived", "error on arrival").mm().share(0.3));
                all.push(of("middle", "error in the middle of the rows").mm().share(0.3));
            }
        }
    }
    all
}
