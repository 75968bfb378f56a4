#![allow(missing_docs, clippy::unwrap_used)]
use tactomo_touch_core::{Frame, Solver, Table};
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let data = std::fs::read(&args[1]).unwrap();
    let verbose: usize = args.get(2).map_or(0, |s| s.parse().unwrap());
    let n = u32::from_le_bytes(data[..4].try_into().unwrap()) as usize;
    let table = Table::read(&data[4..4 + n]).unwrap();
    let floats: Vec<f32> = data[4 + n..].as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    let e = table.electrodes();
    let mut at = 0;
    let mut all: Vec<(usize, f32, usize, f32, usize)> = vec![];
    let mut frames = [0u64; 3];
    let mut solver = Solver::new();
    while at < floats.len() {
        let count = floats[at] as usize;
        let truth: Vec<&[f32]> = floats[at + 1..at + 1 + 4 * count].chunks(4).collect();
        at += 1 + 4 * count;
        let volts = &floats[at..at + e * e];
        at += e * e;
        let (auto_n, auto_e) = (floats[at] as usize, floats[at + 1]);
        at += 2;
        solver.reset();
        let answer = solver.solve(&table, &Frame::of_volts(volts)).unwrap();
        let found = answer.contacts();
        let mut pairs: Vec<(f32, usize, usize)> = truth.iter().enumerate().flat_map(|(k, c)| found.iter().enumerate().map(move |(l, f)| ((f.x_m - c[0]).hypot(f.y_m - c[1]), k, l))).collect();
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut ks, mut ls, mut sum, mut m) = (vec![], vec![], 0.0, 0);
        for (d, k, l) in pairs { if !ks.contains(&k) && !ls.contains(&l) { ks.push(k); ls.push(l); sum += d; m += 1; } }
        let err = if m == 0 { f32::INFINITY } else { sum / m as f32 };
        all.push((count, err, found.len(), auto_e, auto_n));
        (0..3).for_each(|k| frames[k] += u64::from(answer.work.frames[k]));
        if verbose == count && (found.len() != count || err > 2.0 * auto_e + 1e-4) {
            let t: Vec<String> = truth.iter().map(|c| format!("[{:.1},{:.1} r{:.1} {:.2}sq]", 1e3 * c[0], 1e3 * c[1], 1e3 * c[2], c[3])).collect();
            let f: Vec<String> = found.iter().map(|c| format!("({:.1},{:.1} r{:.1} {:.2}sq)", 1e3 * c.x_m, 1e3 * c.y_m, 1e3 * c.radius_m, c.conductance_s / table.head().sheet_s)).collect();
            println!("core {} {:.3} res {:.2} fl {} {:?} | auto {auto_n} {:.3} | {} -> {}", found.len(), 1e3 * err, answer.residual, answer.flags.bits(), answer.work.frames, 1e3 * auto_e, t.join(" "), f.join(" "));
        }
    }
    for count in 1..=3 {
        let of: Vec<_> = all.iter().filter(|a| a.0 == count).collect();
        let q = |v: Vec<f32>| { let mut v = v; v.sort_by(f32::total_cmp); format!("median {:.3} mean {:.3} p90 {:.3}", 1e3 * v[v.len() / 2], 1e3 * v.iter().sum::<f32>() / v.len() as f32, 1e3 * v[v.len() * 9 / 10]) };
        let both: Vec<_> = of.iter().filter(|a| a.2 == count && a.4 == count).collect();
        println!("{count}: core right {}/{} {} | auto right {} {}", of.iter().filter(|a| a.2 == count).count(), of.len(), q(of.iter().map(|a| a.1).collect()), of.iter().filter(|a| a.4 == count).count(), q(of.iter().map(|a| a.3).collect()));
        println!("   both right {}: core {} | auto {}", both.len(), q(both.iter().map(|a| a.1).collect()), q(both.iter().map(|a| a.3).collect()));
    }
    println!("work {frames:?} size of solver {} answer {}", size_of::<Solver>(), size_of::<tactomo_touch_core::Answer>());
}
