//! Rank correlation, and how often chance alone gives one.

/// Random orders that a correlation is compared with.
const SHUFFLES: u32 = 20_000;
/// Seed of these orders: a test gives the same answer each time.
const SEED: u64 = 1;

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

/// Probability that pairs without any connection are correlated so strongly, in either direction: the share of random orders of one side that are
/// (a permutation test); `None` where there is no correlation.
pub fn chance(pairs: &[[f64; 2]]) -> Option<f64> {
    let found = spearman(pairs)?.abs();
    let mut random = fastrand::Rng::with_seed(SEED);
    let mut shuffled = pairs.to_vec();
    let mut as_strong = 0;
    for _ in 0..SHUFFLES {
        for last in (1..shuffled.len()).rev() {
            let other = random.usize(..=last);
            let value = shuffled[last][1];
            shuffled[last][1] = std::mem::replace(&mut shuffled[other][1], value);
        }
        // Sums of the same ranks in another order differ in their last digits.
        as_strong += u32::from(spearman(&shuffled).is_some_and(|other| other.abs() >= found - 1e-9));
    }
    Some(f64::from(as_strong + 1) / f64::from(SHUFFLES + 1))
}

/// A probability in words: random orders give none below the thousandth that they can tell.
pub fn p_text(chance: f64) -> String {
    if chance < 1e-3 { "p < 0.001".to_owned() } else { format!("p = {chance:.3}") }
}

/// Which of a family of tests, by their probabilities under chance alone, hold so that one false one among all is less likely than `level`: Holm, "A simple
/// sequentially rejective multiple test procedure", Scandinavian Journal of Statistics 6 (1979). A test that could not be made takes part, and fails.
pub fn holm(chances: &[Option<f64>], level: f64) -> Vec<bool> {
    let of = |index: usize| chances[index].unwrap_or(1.0);
    let mut order: Vec<usize> = (0..chances.len()).collect();
    order.sort_by(|a, b| of(*a).total_cmp(&of(*b)));
    let passes = |(place, index): &(usize, usize)| of(*index) <= level / (chances.len() - place) as f64;
    let passed: Vec<usize> = order.into_iter().enumerate().take_while(passes).map(|(_, index)| index).collect();
    (0..chances.len()).map(|index| passed.contains(&index)).collect()
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

/// Mean of some values; `None` of none.
pub fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// Median of some values, between the two in the middle where they are even in number; `None` of none.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let last = values.len().checked_sub(1)?;
    Some((values[last / 2] + values[last.div_ceil(2)]) / 2.0)
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
    fn chance_gives_an_order_as_often_as_counting_says() {
        // Of the 120 orders of five, the rising and the falling one are as strong as the rising one.
        let rising: Vec<[f64; 2]> = (0..5).map(|k| [f64::from(k), f64::from(k)]).collect();
        assert!((chance(&rising).unwrap() - 2.0 / 120.0).abs() < 0.004, "{:?}", chance(&rising));
        assert_eq!(chance(&rising), chance(&rising));
        let mixed = [[1.0, 2.0], [2.0, 1.0], [3.0, 4.0], [4.0, 3.0]];
        assert!(chance(&mixed).unwrap() > 0.3);
        assert_eq!(chance(&rising[..2]), None);
    }

    #[test]
    fn of_many_tests_each_needs_more() {
        // Alone all of 5 % would hold; of four, the least needs 1.25 %, the next 1.67 %, and what follows a failure fails.
        assert_eq!(holm(&[Some(0.04), Some(0.01), Some(0.015), None], 0.05), [false, true, true, false]);
        assert_eq!(holm(&[Some(0.02), Some(0.02), Some(0.02)], 0.05), [false; 3]);
        assert_eq!(holm(&[Some(0.04)], 0.05), [true]);
        assert_eq!(holm(&[], 0.05), [] as [bool; 0]);
    }

    #[test]
    fn no_probability_is_printed_as_zero() {
        assert_eq!([4e-4, 1e-3, 0.0384].map(p_text), ["p < 0.001", "p = 0.001", "p = 0.038"]);
    }

    #[test]
    fn nothing_to_rank_is_no_number() {
        assert_eq!(spearman(&[[1.0, 2.0], [2.0, 3.0]]), None);
        assert_eq!(spearman(&[[1.0, 2.0], [2.0, 2.0], [3.0, 2.0]]), None);
    }

    #[test]
    fn a_median_is_the_middle_or_between_the_two_in_it() {
        assert_eq!(median(vec![5.0, 1.0, 3.0]), Some(3.0));
        assert_eq!(median(vec![9.0, 1.0, 2.0, 4.0]), Some(3.0));
        assert_eq!(median(Vec::new()), None);
    }
}
