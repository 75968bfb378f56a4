//! Rank correlation.

/// Spearman's rank correlation of pairs, with mean ranks for equals: -1 to 1; `None` of fewer than three pairs, or where one side is
/// all equal.
pub fn spearman(pairs: &[[f64; 2]]) -> Option<f64> {
    if pairs.len() < 3 {
        return None;
    }
    let [a, b] = [0, 1].map(|side| ranks(&pairs.iter().map(|pair| pair[side]).collect::<Vec<_>>()));
    let mean = (pairs.len() as f64 - 1.0) / 2.0;
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - mean) * (b - mean)).sum::<f64>();
    let scale = (product(&a, &a) * product(&b, &b)).sqrt();
    (scale > 0.0).then(|| product(&a, &b) / scale)
}

/// Rank of each value from 0; equals share their mean.
fn ranks(values: &[f64]) -> Vec<f64> {
    let rank = |value: &f64| {
        let below = values.iter().filter(|other| *other < value).count();
        let equal = values.iter().filter(|other| *other == value).count();
        below as f64 + (equal as f64 - 1.0) / 2.0
    };
    values.iter().map(rank).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn order_alone_counts() {
        let rising: Vec<[f64; 2]> = (1..9).map(|k| [f64::from(k), f64::from(k * k * k)]).collect();
        assert_eq!(spearman(&rising), Some(1.0));
        let falling: Vec<[f64; 2]> = rising.iter().map(|[x, y]| [*x, -y]).collect();
        assert_eq!(spearman(&falling), Some(-1.0));
        // By hand: ranks 0 1 2 3 and 1 0 3 2; sum of squared differences 4; 1 - 6 x 4 / (4 x 15) = 0.6.
        let mixed = [[1.0, 2.0], [2.0, 1.0], [3.0, 4.0], [4.0, 3.0]];
        assert!((spearman(&mixed).unwrap() - 0.6).abs() < 1e-12);
    }

    #[test]
    fn nothing_to_rank_is_no_number() {
        assert_eq!(spearman(&[[1.0, 2.0], [2.0, 3.0]]), None);
        assert_eq!(spearman(&[[1.0, 2.0], [2.0, 2.0], [3.0, 2.0]]), None);
    }
}
