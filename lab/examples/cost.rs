//! What a forward model costs against its size: a table, and a chart where a file is named.
//!
//! `cargo run --release --package tactomo-lab --example cost -- [chart.svg]`. Each time is the median of several runs on one core.

use std::time::Instant;

use tactomo_physics::detector::{Detector, Electrode, Layer};
use tactomo_physics::forward::jacobian::Jacobian;
use tactomo_physics::forward::shell::Shell;
use tactomo_physics::forward::{ForwardModel, Slab};
use tactomo_physics::scene::Contact;

/// One curve: what is done, against what, and the sizes with their times (s).
struct Series {
    what: &'static str,
    points: Vec<[f64; 2]>,
}

impl Series {
    fn new(what: &'static str, sizes: &[usize], mut task: impl FnMut(usize) -> [f64; 2]) -> Self {
        Self { what, points: sizes.iter().map(|size| task(*size)).collect() }
    }

    /// Exponent of the growth over the last doubling or so.
    fn order(&self) -> f64 {
        let [.., [x0, y0], [x1, y1]] = self.points[..] else { return 0.0 };
        (y1 / y0).ln() / (x1 / x0).ln()
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let all = [
        Series::new(
            "shell: description to Jacobian, nodes",
            &[500, 1000, 2000, 5000, 10_000, 20_000, 50_000],
            |nodes| {
                [
                    nodes as f64,
                    seconds(|| Shell::with_nodes(&square(4, 0.005), nodes).map(|shell| Jacobian::of(&shell))),
                ]
            },
        ),
        Series::new("slab: fields, modes across", &[10_000, 5000, 2500, 1250], |thickness_um| {
            let thickness_m = thickness_um as f64 * 1e-6;
            // Modes of wave number below 11 / thickness, in a quarter disc.
            let modes = std::f64::consts::FRAC_PI_4 * (11.0 * 0.06 / thickness_m / std::f64::consts::PI).powi(2);
            [modes, seconds(|| Slab::new(&square(4, thickness_m)))]
        }),
        Series::new("slab: fields, electrodes", &[2, 3, 4, 5], |side| {
            [(side * side) as f64, seconds(|| Slab::new(&square(side, 0.005)))]
        }),
        Series::new("slab: readings, image nodes", &[100, 225, 400, 900, 1600], |nodes| {
            let slab = slab().on_image(nodes);
            let image_s = vec![1e-5; slab.image_mesh().nodes_m.len()];
            [image_s.len() as f64, seconds(|| slab.image_fields(&image_s))]
        }),
        Series::new("slab: readings, contacts", &[1, 2, 3, 5, 10], |count| {
            let (slab, contacts) = (slab(), contacts(count));
            [count as f64, seconds(|| slab.impedance_ohm(&contacts))]
        }),
    ];
    for series in &all {
        println!("{}: grows with power {:.1}", series.what, series.order());
        series.points.iter().for_each(|[size, time]| println!("{size:>10.0} {:>12.3} ms", time * 1e3));
    }
    if let Some(path) = std::env::args().nth(1) {
        std::fs::write(path, chart(&all))?;
    }
    Ok(())
}

/// Median time of a task (s), after one run that is not counted.
fn seconds<T>(task: impl Fn() -> T) -> f64 {
    drop(task());
    let mut times: Vec<_> = (0..9)
        .map(|_| {
            let start = Instant::now();
            drop(std::hint::black_box(task()));
            start.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// `square-60` with `side x side` electrodes, of a thickness.
fn square(side: usize, thickness_m: f64) -> Detector {
    let mut detector =
        Detector::preset(Detector::DEFAULT).unwrap_or_else(|| unreachable!("the default is a preset")).taken_as_exact();
    detector.layers = vec![Layer::uniform(thickness_m, 0.2)];
    let place = |i: usize| 0.06 * ((i as f64 + 0.5) / side as f64 - 0.5);
    detector.electrodes = (0..side * side).map(|e| Electrode::flat(place(e % side), place(e / side), 0.002)).collect();
    detector
}

fn slab() -> Slab {
    Slab::new(&square(4, 0.005)).unwrap_or_else(|error| unreachable!("{error}"))
}

/// Contacts of 2 mm radius along a diagonal.
fn contacts(count: usize) -> Vec<Contact> {
    let place = |i: usize| 0.05 * ((i as f64 + 0.5) / count as f64 - 0.5);
    (0..count).map(|i| Contact::flat(place(i), place(i), 0.002, 1e-3)).collect()
}

/// Logarithmic in both directions: size to the right, time upwards.
fn chart(all: &[Series]) -> String {
    let x = |size: f64| 60.0 + 118.0 * size.log10();
    let y = |time: f64| 40.0 - 72.0 * time.log10();
    let mut svg = String::from(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 960 460\" font-family=\"sans-serif\" font-size=\"13\">\n\
         <rect width=\"960\" height=\"460\" fill=\"white\"/>\n",
    );
    for (decade, label) in [(-5, "10 us"), (-4, "100 us"), (-3, "1 ms"), (-2, "10 ms"), (-1, "100 ms"), (0, "1 s")] {
        let at = y(10f64.powi(decade));
        svg += &format!(
            "<path d=\"M60 {at}H670\" stroke=\"#ddd\"/><text x=\"54\" y=\"{}\" text-anchor=\"end\">{label}</text>\n",
            at + 4.0
        );
    }
    for (decade, label) in ["1", "10", "100", "1000", "10 000", "100 000"].iter().enumerate() {
        let at = x(10f64.powi(decade as i32));
        svg += &format!(
            "<path d=\"M{at} 40V410\" stroke=\"#eee\"/><text x=\"{at}\" y=\"428\" text-anchor=\"middle\">{label}</text>\n"
        );
    }
    svg += "<text x=\"365\" y=\"450\" text-anchor=\"middle\">size: nodes, modes, electrodes or contacts</text>\n";
    for (i, (series, colour)) in all.iter().zip(["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56420e"]).enumerate() {
        let line: Vec<_> =
            series.points.iter().map(|[size, time]| format!("{:.1},{:.1}", x(*size), y(*time))).collect();
        svg += &format!(
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"/>\n",
            line.join(" ")
        );
        for [size, time] in &series.points {
            svg += &format!("<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"3.5\" fill=\"{colour}\"/>\n", x(*size), y(*time));
        }
        let at = 60.0 + 36.0 * i as f64;
        let order = series.order();
        svg += &format!(
            "<text x=\"690\" y=\"{at}\" fill=\"{colour}\">{}</text><text x=\"690\" y=\"{}\" fill=\"{colour}\" font-size=\"11\">power {order:.1} at the end</text>\n",
            series.what,
            at + 14.0
        );
    }
    svg + "</svg>\n"
}
