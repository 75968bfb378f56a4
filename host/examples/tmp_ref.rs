use tactomo::case::Case;
use tactomo::forward::{ForwardModel, Slab, readings_v};
fn main() {
    for path in std::env::args().skip(1) {
        let case = Case::read(std::path::Path::new(&path)).unwrap();
        let slab = Slab::new(&case.detector).unwrap();
        let z = slab.impedance_ohm(&case.contacts).unwrap();
        let ours = readings_v(&z, &case.detector);
        let n = 16;
        let vmax = case.readings.largest_v();
        let (mut a, mut b, mut c) = (0.0, 0.0, 0.0);
        let mut deltas = vec![];
        for g in 0..n {
            let d: Vec<f64> = (0..n).map(|e| case.readings.at(g, e) - ours.at(g, e)).collect();
            let q: Vec<f64> = (0..n).map(|e| case.detector.drive_v - ours.at(g, e)).collect();
            let q: Vec<f64> = q;
            let s = d.iter().zip(&q).map(|(a, b)| a * b).sum::<f64>() / q.iter().map(|a| a * a).sum::<f64>();
            a += d.iter().map(|x| x * x).sum::<f64>();
            b += d.iter().zip(&q).map(|(x, q)| (x - s * q).powi(2)).sum::<f64>();
            let s2 = d.iter().enumerate().filter(|(e, _)| *e != g).map(|(e, a)| a * q[e]).sum::<f64>()
                / q.iter().enumerate().filter(|(e, _)| *e != g).map(|(_, a)| a * a).sum::<f64>();
            c += d.iter().enumerate().filter(|(e, _)| *e != g).map(|(e, x)| (x - s2 * q[e]).powi(2)).sum::<f64>();
            deltas.push(s2 * (z[(g, g)] + 4.0));
        }
        let rms = |x: f64| (x / 256.0).sqrt() / vmax * 100.0;
        println!(
            "{:<30} vmax {:.3} rms % {:.3} -> rows {:.3} off {:.3}; delta ohm {:?} E_gg {:.0}",
            path.rsplit('/').next().unwrap(),
            vmax,
            rms(a),
            rms(b),
            rms(c),
            deltas.iter().take(6).map(|x| (x * 10.0).round() / 10.0).collect::<Vec<_>>(),
            slab.electrode_fields_ohm()[(0, 0)]
        );
    }
}
