use std::time::Instant;
use tactomo::detector::{Adc, Detector};
use tactomo::forward::{ForwardModel, Resolution, Slab, readings_v};
use tactomo::scene::Contact;
use tactomo::simulate::{Noise, measured};
use tactomo::solve::{Method, Problem};
#[allow(clippy::all)]
fn main() {
    let only = std::env::var("ONLY").unwrap_or_default();
    let method: Method = std::env::args().nth(1).unwrap_or("contacts".into()).parse().unwrap();
    let detector = Detector::preset("square-60").unwrap();
    let fine = Slab::with_resolution(&detector, Resolution::FINE).unwrap();
    let problem = Problem::new(Box::new(Slab::new(&detector).unwrap()) as Box<dyn ForwardModel>);
    let mut solver = method.build(&problem).unwrap();
    let sheet = detector.sheet_conductance_s();
    let mut rng = fastrand::Rng::with_seed(3);
    let mut noise = Noise::new(7);
    let adc = Adc { noise_lsb: 1.5, bits: 12, ..detector.adc };
    println!("sheet {sheet}");
    // none
    let mut invented = 0;
    for _ in 0..10000 {
        let z = tactomo::readings::Readings::from_fn(16, |_, _| adc.noise_lsb * adc.lsb_v() * noise.normal());
        invented += usize::from(!solver.solve(&z).unwrap().contacts.is_empty());
    }
    println!("invented in 10000 frames: {invented}");
    let mut test = |name: &str, make: &mut dyn FnMut(&mut fastrand::Rng) -> Vec<Contact>, trials: usize| {
        if !name.starts_with(&only) {
            return;
        }
        let (mut right, mut errs, mut cerr, mut cold, mut warm, mut flags) = (0, vec![], vec![], vec![], vec![], 0);
        let mut counts = std::collections::BTreeMap::new();
        for _ in 0..trials {
            let contacts = make(&mut rng);
            let exact = readings_v(&fine.impedance_ohm(&contacts).unwrap(), &detector);
            solver.reset();
            let t = Instant::now();
            let s = solver.solve(&measured(&exact, &adc, &mut noise)).unwrap();
            cold.push(t.elapsed().as_secs_f64() * 1e6);
            let r2 = measured(&exact, &adc, &mut noise);
            let t = Instant::now();
            let _ = solver.solve(&r2).unwrap();
            warm.push(t.elapsed().as_secs_f64() * 1e6);
            *counts.entry(s.contacts.len()).or_insert(0) += 1;
            if s.flags.misfit {
                flags += 1;
            }
            if std::env::var("SHOW").is_ok() && (s.contacts.len() != contacts.len() || s.flags.misfit) {
                let p = |x: f64| format!("{:.1}", x * 1e3);
                println!(
                    "  true {}",
                    contacts
                        .iter()
                        .map(|c| format!("({},{}) {:.2}", p(c.x_m), p(c.y_m), c.conductance_s / sheet))
                        .collect::<Vec<_>>()
                        .join(" ")
                );
                println!(
                    "  found {} res {:.2}",
                    s.contacts
                        .iter()
                        .map(|c| format!(
                            "({},{}) {:.2} r {:?}",
                            p(c.x_m),
                            p(c.y_m),
                            c.conductance_s / sheet,
                            c.radius_m.map(p)
                        ))
                        .collect::<Vec<_>>()
                        .join(" "),
                    s.residual.unwrap_or(0.0)
                );
            }
            if s.contacts.len() == contacts.len() {
                right += 1;
                let mut found = s.contacts.clone();
                for c in &contacts {
                    let (i, d) = found
                        .iter()
                        .enumerate()
                        .map(|(i, f)| (i, (f.x_m - c.x_m).hypot(f.y_m - c.y_m)))
                        .min_by(|a, b| a.1.total_cmp(&b.1))
                        .unwrap();
                    errs.push(d * 1e3);
                    cerr.push((found[i].conductance_s / c.conductance_s - 1.0).abs() * 100.0);
                    found.remove(i);
                }
            }
        }
        for v in [&mut errs, &mut cerr, &mut cold, &mut warm] {
            v.sort_by(f64::total_cmp);
            if v.is_empty() {
                v.push(f64::NAN)
            }
        }
        let q = |v: &Vec<f64>, p: f64| v[((v.len() - 1) as f64 * p) as usize];
        println!(
            "{name:<22} right {:>5.1} %  err mm mean {:.3} p50 {:.3} p95 {:.3}  cond % p50 {:.1} p95 {:.1}  cold us {:.0} p95 {:.0}  warm {:.0} p95 {:.0} misfit {flags} {counts:?}",
            100.0 * right as f64 / trials as f64,
            errs.iter().sum::<f64>() / errs.len() as f64,
            q(&errs, 0.5),
            q(&errs, 0.95),
            q(&cerr, 0.5),
            q(&cerr, 0.95),
            q(&cold, 0.5),
            q(&cold, 0.95),
            q(&warm, 0.5),
            q(&warm, 0.95)
        );
    };
    let place = |rng: &mut fastrand::Rng, m: f64| [(rng.f64() - 0.5) * 2.0 * m, (rng.f64() - 0.5) * 2.0 * m];
    for level in [0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0] {
        test(
            &format!("one {level}"),
            &mut |rng| {
                let [x, y] = place(rng, 0.028);
                vec![Contact::flat(x, y, 0.0025, level * sheet)]
            },
            200,
        );
    }
    for level in [0.03, 0.3, 3.0] {
        for k in [2, 3, 4, 5] {
            test(
                &format!("{k} of {level}"),
                &mut |rng| {
                    let mut all: Vec<Contact> = vec![];
                    while all.len() < k {
                        let [x, y] = place(rng, 0.027);
                        if all.iter().all(|c| (c.x_m - x).hypot(c.y_m - y) > 0.010) {
                            all.push(Contact::flat(x, y, 0.0025, level * sheet * (0.5 + rng.f64())));
                        }
                    }
                    all
                },
                100,
            );
        }
        for d in [0.004, 0.006, 0.009, 0.012] {
            test(
                &format!("pair {level} {d}"),
                &mut |rng| {
                    let [x, y] = place(rng, 0.02);
                    let a = rng.f64() * 6.28;
                    let (dx, dy) = (0.5 * d * a.cos(), 0.5 * d * a.sin());
                    vec![
                        Contact::flat(x - dx, y - dy, 0.0015, level * sheet),
                        Contact::flat(x + dx, y + dy, 0.0015, level * sheet),
                    ]
                },
                100,
            );
        }
    }
}
