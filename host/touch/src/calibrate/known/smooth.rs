//! How smoothly errors run over the detector, by the evidence of known presses.
//!
//! An error is a smooth function, a Gaussian process, and what differs from press to press: of variance `noise^2 + (share s)^2` with `s` the
//! solver's standard error, which also holds what is the same at the same place. The four parameters are those of the largest marginal
//! likelihood (Rasmussen and Williams, 2006, section 5.4.1), with priors that a dozen presses outweigh; the smooth function is taken only if the
//! presses are so much likelier with it than without.

use crate::gaussian::{Prior, Process, Scatter};

/// Errors of one kind at the same presses: of x, of y, or of the logarithm of a conductance.
#[derive(Clone, Debug)]
pub(super) struct Channel {
    /// Errors.
    pub errors: Vec<f64>,
    /// Standard errors that the solver gave.
    pub claimed: Vec<f64>,
}

/// Errors that are equally smooth, and where.
#[derive(Clone, Debug)]
pub(super) struct Errors<'a> {
    /// Where presses were found (m).
    pub found_m: &'a [[f64; 2]],
    /// Errors.
    pub channels: Vec<Channel>,
    /// Longest side of the detector (m).
    pub side_m: f64,
    /// Whether the solver's standard errors hold what is the same at the same place.
    pub has_share: bool,
}

/// Parameters of errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Smooth {
    /// Of the smooth function.
    pub prior: Prior,
    /// Of what differs from press to press.
    pub scatter: Scatter,
}

/// What presses say.
#[derive(Clone, Copy, Debug)]
pub(super) struct Verdict {
    /// Parameters with a smooth function.
    pub smooth: Smooth,
    /// Logarithm of the evidence without a smooth function, and with one.
    pub log_evidence: [f64; 2],
    /// Whether there is one.
    pub is_smooth: bool,
}

/// Parameters as the search has them: logarithms of length, deviation, noise and share.
type Logs = [f64; 4];

/// Lengths: medians and bounds in sides, and deviation of the logarithm. Shorter ones are no smooth function, longer ones a constant.
const LENGTH: [f64; 3] = [0.5, 0.15, 3.0];
const LENGTH_DEVIATION: f64 = 0.7;
/// Deviation and noise in root mean squares of the errors.
const DEVIATION: [f64; 3] = [1.0, 0.03, 10.0];
const DEVIATION_DEVIATION: f64 = 1.5;
const NOISE: [f64; 3] = [0.2, 1e-3, 3.0];
const NOISE_DEVIATION: f64 = 1.5;
/// Share of the claimed standard errors.
const SHARE: [f64; 3] = [0.5, 0.02, 1.0];
const SHARE_DEVIATION: f64 = 1.0;
/// First and last step of the search, in logarithms: parameters to 5 % change no prediction by a hundredth of its deviation.
const STEPS: [f64; 2] = [0.8, 0.05];
/// Lengths that the search begins from, in sides.
const STARTS: [f64; 3] = [0.25, 0.7, 2.0];
/// Twice the logarithm of the evidence has to be larger by this with a smooth function, and by the logarithm of the count of numbers for each of its two
/// parameters (Bayes' information criterion): positive evidence of Kass and Raftery (*J. Am. Stat. Assoc.* 90, 1995).
const POSITIVE: f64 = 2.0;

impl Smooth {
    fn of(logs: &Logs) -> Self {
        let [length_m, deviation, noise, share] = logs.map(f64::exp);
        Self { prior: Prior { length_m, deviation }, scatter: Scatter { noise, share } }
    }

    /// This law with the deviations that so many numbers determine without bias: the likeliest are too small by what the parameters have fitted.
    /// Means stay, since all variances grow alike.
    fn widened(self, numbers: usize, parameters: usize) -> Self {
        let factor = (numbers as f64 / numbers.saturating_sub(parameters).max(1) as f64).sqrt();
        let prior = Prior { deviation: factor * self.prior.deviation, ..self.prior };
        let share = (factor * self.scatter.share).min(1.0);
        Self { prior, scatter: Scatter { noise: factor * self.scatter.noise, share } }
    }

    /// The smooth function of each channel.
    pub fn processes(&self, errors: &Errors) -> Option<Vec<Process>> {
        let process = |channel: &Channel| {
            Process::scattered(self.prior, self.scatter, errors.found_m, &channel.errors, &channel.claimed)
        };
        errors.channels.iter().map(process).collect()
    }

    fn log_evidence(&self, errors: &Errors) -> f64 {
        let processes = self.processes(errors);
        processes.map_or(f64::NEG_INFINITY, |all| all.iter().map(Process::log_evidence).sum())
    }

    /// Logarithm of the marginal likelihood where there is nothing but noise.
    fn log_evidence_of_noise(&self, errors: &Errors) -> f64 {
        let of_channel = |channel: &Channel| {
            let pairs =
                channel.errors.iter().zip(channel.claimed.iter().map(|claimed| self.scatter.variance(*claimed)));
            pairs
                .map(|(error, variance)| error * error / variance + (std::f64::consts::TAU * variance).ln())
                .sum::<f64>()
        };
        -0.5 * errors.channels.iter().map(of_channel).sum::<f64>()
    }
}

/// Bounds and priors of parameters.
struct Range {
    medians: Logs,
    low: Logs,
    high: Logs,
    deviations: Logs,
}

impl Range {
    fn of(errors: &Errors) -> Self {
        let all = || errors.channels.iter().flat_map(|channel| &channel.errors);
        let mean_square = all().map(|error| error * error).sum::<f64>() / all().count().max(1) as f64;
        let rms = mean_square.sqrt().max(f64::MIN_POSITIVE.sqrt());
        let share = if errors.has_share { SHARE } else { [1.0; 3] };
        let rows = [LENGTH.map(|at| at * errors.side_m), DEVIATION.map(|at| at * rms), NOISE.map(|at| at * rms), share];
        let column = |k: usize| rows.map(|row| row[k].ln());
        let deviations = [LENGTH_DEVIATION, DEVIATION_DEVIATION, NOISE_DEVIATION, SHARE_DEVIATION];
        Self { medians: column(0), low: column(1), high: column(2), deviations }
    }

    /// Logarithm of the prior of those parameters that are searched, but for a constant.
    fn log_prior(&self, logs: &Logs, free: &[usize]) -> f64 {
        let square = |k: &usize| ((logs[*k] - self.medians[*k]) / self.deviations[*k]).powi(2);
        -0.5 * free.iter().map(square).sum::<f64>()
    }

    /// The best parameters about a start, along one of them at a time with steps that are halved.
    fn searched(&self, start: Logs, free: &[usize], of: &dyn Fn(&Smooth) -> f64) -> (f64, Logs) {
        let value = |logs: &Logs| of(&Smooth::of(logs)) + self.log_prior(logs, free);
        let mut best = (value(&start), start);
        let mut step = STEPS[0];
        while step > STEPS[1] {
            let before = best.0;
            for k in free {
                for sign in [1.0, -1.0] {
                    let mut logs = best.1;
                    logs[*k] = (logs[*k] + sign * step).clamp(self.low[*k], self.high[*k]);
                    let found = value(&logs);
                    if found > best.0 {
                        best = (found, logs);
                        break;
                    }
                }
            }
            if best.0 <= before {
                step *= 0.5;
            }
        }
        best
    }
}

/// What errors say of their smoothness; `None` where they are no numbers to say anything.
pub(super) fn judge(errors: &Errors) -> Option<Verdict> {
    let range = Range::of(errors);
    let noise_only = if errors.has_share { vec![2, 3] } else { vec![2] };
    let free = [&[0, 1], &noise_only[..]].concat();
    let (_, without) = range.searched(range.medians, &noise_only, &|smooth| smooth.log_evidence_of_noise(errors));
    let from = |length: f64| {
        let mut start = range.medians;
        start[0] = (length * errors.side_m).ln();
        range.searched(start, &free, &|smooth| smooth.log_evidence(errors))
    };
    let (value, with) = STARTS.map(from).into_iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    let smooth = Smooth::of(&with);
    let log_evidence = [Smooth::of(&without).log_evidence_of_noise(errors), smooth.log_evidence(errors)];
    let numbers = errors.found_m.len() * errors.channels.len();
    let gain = 2.0 * (log_evidence[1] - log_evidence[0]);
    let is_smooth = gain > POSITIVE + 2.0 * (numbers as f64).ln();
    value.is_finite().then_some(Verdict { smooth: smooth.widened(numbers, free.len()), log_evidence, is_smooth })
}
