#![allow(missing_docs, clippy::unwrap_used)]
use tactomo_touch::solve::{self, Method, Problem};
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::{ForwardModel, readings_v};
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::Contact;
use tactomo_physics::simulate::{Noise, measured, finer_model};
use tactomo_touch_core::{Frame, Says, Solver, Table};
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let name = args.get(1).map_or("square-60", |s| s.as_str());
    let most: usize = args.get(2).map_or(1, |s| s.parse().unwrap());
    let scenes: usize = args.get(3).map_or(40, |s| s.parse().unwrap());
    let auto = args.get(4).is_some_and(|s| s == "auto");
    let det = Detector::preset(name).unwrap().taken_as_exact();
    let problem = Problem::of(&det).unwrap();
    let t = std::time::Instant::now();
    let bytes = solve::compile(&problem).unwrap();
    println!("compiled {} bytes in {:?}", bytes.len(), t.elapsed());
    let mut dump = Vec::new();
    dump.extend((bytes.len() as u32).to_le_bytes()); dump.extend(&bytes);
    let table = Table::read(&bytes).unwrap();
    let finer = finer_model(&det, &[], 0).unwrap();
    let scale = problem.spacing_m() / 0.015;
    let mut rng = fastrand::Rng::with_seed(7);
    let mut noise = Noise::new(3);
    let [w, h] = det.outline.size_m();
    let mut host = Method::Auto.build(&problem).unwrap();
    let mut core = Solver::new();
    for count in args.get(5).map_or(1, |s| s.parse().unwrap())..=most {
        let (mut ours, mut theirs, mut right, mut right_t) = (vec![], vec![], 0, 0);
        let mut time = std::time::Duration::ZERO;
        for s in 0..scenes {
            let mut contacts: Vec<Contact> = vec![];
            let mut tries = 0;
            while contacts.len() < count && tries < 100000 {
                tries += 1;
                let r = scale * (1e-3 + 5e-3 * rng.f64());
                let c = Contact::flat((rng.f64() - 0.5) * (w - 2e-3), (rng.f64() - 0.5) * (h - 2e-3), r, 1e-5 * 1e4f64.powf(rng.f64()));
                if contacts.iter().all(|o| (o.x_m - c.x_m).hypot(o.y_m - c.y_m) > o.radius_m + c.radius_m + 2e-3 * scale) { contacts.push(c); }
            }
            let readings = measured(&readings_v(&finer.impedance_ohm(&contacts).unwrap(), &det), &det.adc, &mut noise);
            let volts: Vec<f32> = readings.volts().iter().map(|v| *v as f32).collect();
            dump.extend((count as f32).to_le_bytes()); for c in &contacts { for v in [c.x_m, c.y_m, c.radius_m, c.conductance_s / det.sheet_conductance_s()] { dump.extend((v as f32).to_le_bytes()); } } for v in &volts { dump.extend(v.to_le_bytes()); }
            let t = std::time::Instant::now();
            core.reset();
            let answer = core.solve(&table, &Frame::of_volts(&volts)).unwrap();
            time += t.elapsed();
            let found: Vec<[f64; 2]> = answer.contacts().iter().map(|c| [f64::from(c.x_m), f64::from(c.y_m)]).collect();
            let err = matched(&contacts, &found);
            if found.len() == count { right += 1; }
            let mut line = format!("{s}: core {} err {:.3} mm res {:.2} flags {} work {:?}", found.len(), 1e3 * err, answer.residual, answer.flags.bits(), answer.work);
            ours.push(err);
            if auto {
                host.reset();
                let sol = host.solve(&readings).unwrap();
                let f: Vec<[f64; 2]> = sol.contacts.iter().map(|c| [c.x_m, c.y_m]).collect();
                let e = matched(&contacts, &f);
                dump.extend((f.len() as f32).to_le_bytes()); dump.extend((e as f32).to_le_bytes());
                theirs.push(e);
                if f.len() == count { right_t += 1; }
                line += &format!(" | auto {} err {:.3} res {:.2}", f.len(), 1e3 * e, sol.residual.unwrap_or(0.0));
            }
            for (k, c) in contacts.iter().enumerate() { line += &format!(" [{:.1},{:.1} r{:.1} {:.2}sq]", 1e3 * c.x_m, 1e3 * c.y_m, 1e3 * c.radius_m, c.conductance_s / det.sheet_conductance_s()); if k == 0 && count == 1 { if let Some(f) = answer.contacts().first() { line += &format!(" got r{:.1} {:.2}sq sig {:.3}", 1e3 * f.radius_m, f64::from(f.conductance_s) / det.sheet_conductance_s(), 1e3 * f.sigma_m[0]); } } }
            println!("{line}");
        }
        let q = |mut v: Vec<f64>| { v.sort_by(f64::total_cmp); if v.is_empty() { return String::new() } format!("median {:.3} mean {:.3} p90 {:.3} mm", 1e3 * v[v.len() / 2], 1e3 * v.iter().filter(|x| x.is_finite()).sum::<f64>() / v.len() as f64, 1e3 * v[v.len() * 9 / 10]) };
        println!("{name} {count}: core right {right}/{scenes} {} | auto right {right_t} {} ; {:?} a frame", q(ours), q(theirs), time / scenes as u32);
    }
    std::fs::write(format!("/tmp/wt/core-dump-{name}.bin"), dump).unwrap();
}
fn matched(contacts: &[Contact], found: &[[f64; 2]]) -> f64 {
    // Pairs nearest first, as many as there are.
    let mut pairs: Vec<(f64, usize, usize)> = contacts.iter().enumerate().flat_map(|(k, c)| found.iter().enumerate().map(move |(l, f)| ((f[0] - c.x_m).hypot(f[1] - c.y_m), k, l))).collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut ks, mut ls, mut sum, mut n) = (vec![], vec![], 0.0, 0);
    for (d, k, l) in pairs { if !ks.contains(&k) && !ls.contains(&l) { ks.push(k); ls.push(l); sum += d; n += 1; } }
    if n == 0 { f64::INFINITY } else { sum / f64::from(n) }
}
#[allow(dead_code)]
fn unused(_: Readings, _: Says, _: &dyn ForwardModel) {}
