//! The thresholds that decide between answers: what is believed, what is searched again, and what is let go.
//!
//! One name for one thing, in standard deviations, in squares of those ("squared deviations", as sums of squares and scores are), in nats
//! (logarithms of odds or of evidence), or in shares, each with its source or the measurement behind it. Constants of a computation, as steps of a fit
//! or sizes of a grid, stay with it. Those of electrodes that cannot be right are in `health`. Whoever changes one runs
//! `cargo lab bank`, on a seed that was not used to choose it.

// What readings say.

/// Readings above this share of the converter's range, or of the drive, say nothing.
pub(crate) const FULL_SHARE: f64 = 0.995;
/// Readings do not fit if more than this share of them is what no image gives; of touches of any shape it was 0.07 at most, of shorted,
/// exchanged and inverted electrodes more than 0.09.
pub(crate) const OUTSIDE_SHARE: f64 = 0.08;
/// An answer of any method that leaves this share of the readings, in the root mean square, does not explain them. Of `square-60`, exact, as
/// described and as built, no right answer but those of `bsbl` leaves more than 0.16 under one to five contacts, and of these 1 to 3 in 100 do. Transposed tables leave more in 79 of 100 with `nonnegative` and in all with `bsbl`; with 0.5, 2 and 100. Other
/// methods flag these by themselves or, negated ones, by [`OUTSIDE_SHARE`].
pub(crate) const LEFT_SHARE: f64 = 0.2;
/// Peaks of a linear image at least so high, over the highest, are contacts, and a contact is where the image is so high, over its peak.
pub(crate) const PEAK_SHARE: f32 = 0.6;

// Whether frames are of one scene.

/// Share of still frames in which a contact is taken to move, by each of the tests of a contact in each window of one frame. Windows
/// of more frames overlap, and have as many times more.
pub(crate) const FALSE_ALARMS: f64 = 3e-5;
/// Share of still frames in which a contact may have begun to move, so that the first frames are averaged no longer than others.
pub(crate) const FALSE_DOUBTS: f64 = 0.003;

// Whether readings are explained.

/// Price of a parameter (squared deviations), by which it has to lower the sum of squares: the Bayesian information criterion for 256
/// readings asks for 5.5; this leaves room for the many places that are looked at.
pub(crate) const PARAMETER_PRICE: f64 = 7.0;
/// Standard deviations of the sum of squares beyond which readings do not fit, frames are not of one scene, or a reading is of a contact: noise alone
/// is there a few times in a million frames. A contact that comes leaves hundreds in a few rows.
pub(crate) const MISFIT_DEVIATIONS: f64 = 5.0;
/// Standard deviations of the sum of squares beyond which it is worth the time to look for another explanation: once in some hundred frames.
pub(crate) const DOUBT_DEVIATIONS: f64 = 3.0;
/// Mean square (squared deviations) of what a fit leaves, above which it is the contacts that are wrong: no starts around a single one are
/// tried then, nor what the readings may be off by together. Below it, a start of the rough model explains enough for others not to be tried, and
/// one contact fits once two exchanged wires are exchanged back.
pub(crate) const WRONG_MEAN_SQUARE: f64 = 5.0;
/// Mean square (squared deviations) of what a fit of wide contacts leaves with the rough model, above which it is wrong with any. With 5, one of 32
/// presses on some rubbed detectors is found 5 mm off.
pub(crate) const WRONG_WIDE_MEAN_SQUARE: f64 = 50.0;

// When is searched again.

/// What is followed explains a frame as long as its sum of squares is below this times what the last search left, or would leave of as many
/// frames.
pub(crate) const WORSE: f64 = 1.3;
/// A scene that has not changed is searched again with so many times the frames: many frames show what one frame's noise hides.
pub(crate) const MORE_FRAMES: usize = 2;
/// Frames of rows in a row that do not fit, after which a search is worth it.
pub(crate) const UNFIT_FRAMES: u32 = 3;
/// How much more rows that do not fit count than those that do: noise alone does not make them, and those of the grounds that are scanned most
/// fit long before the others.
pub(crate) const UNFIT_WEIGHT: f64 = 5.0;
/// Time for which rows do not fit, so weighed, less that for which they do, from which they are not enough (s): that of 60 ms of which none fits,
/// in which all were read twice, and searched.
pub(crate) const UNFIT_S: f64 = 0.3;
/// Share of the readings, in the root of the sum of squares, by which those of what is followed may differ from those that the patterns of what
/// they may be off by together were made for.
pub(crate) const STALE_SHARE: f64 = 0.25;
/// Share of the readings, likewise, by which they may differ where a search ends.
pub(crate) const SETTLED_SHARE: f64 = 0.02;
/// What an image leaves may be so many times what the last fresh start left before the next one: jumping presses leave hundreds of times as
/// much, a scene that moves 2 mm a frame twice as much.
pub(crate) const IMAGE_WORSE: f64 = 4.0;
/// After so many frames with an image, contacts and shapes are tried again; doubled each time, up to the second.
pub(crate) const IMAGE_PATIENCE: [u32; 2] = [2, 64];
/// Standard error of places that a rub leaves of what the detector differs by, in mean distances of electrodes: 0.12 to 0.18 mm after 24 presses on
/// `square-60`. Against an exact detector, a calibration would be asked for in two of three right answers.
pub(crate) const CALIBRATED_SHARE: f64 = 0.01;
/// Factor on the standard errors of places from which a calibration is worth to be asked for.
pub(crate) const CALIBRATION_WORTH: f64 = 2.0;
/// Standard error of places up to which they are known well enough as they are, in mean distances of electrodes: 1 mm on `square-60`. There a
/// calibration is asked for in 73 % of answers with the right number and a place off by more than 1 mm, in 70 % of those with a wrong number, and
/// in 16 % of the others. By the factor alone it would be asked for in 79, 90 and 43 %.
pub(crate) const KNOWN_SHARE: f64 = 1.0 / 15.0;

// How many contacts.

/// Starts whose spots are less likely than the best by so many nats are left, and one more contact if it is so much less likely than none by what
/// spots tell: a mode that is 1 in 400 says nothing.
pub(crate) const MODES_NATS: f64 = 6.0;
/// Rise of the sum of squares (squared deviations), as spots tell it, above which one contact fewer is not tried with discs: one contact takes 22 nats
/// of evidence at most, and spots tell a rise up to twice too large. Without it a frame of several contacts takes three times as long.
pub(crate) const LOST_SQUARES: f64 = 100.0;
/// Gain in the sum of squares (squared deviations), in the linear theory, for there being any contact at all: noise alone has 1 in 10^7 frames
/// above it.
pub(crate) const FIRST_GAIN: f64 = 60.0;
/// One more contact is less likely than one fewer by so many nats before anything is read: scenes of few contacts are more common, and places
/// that are looked at are chosen.
pub(crate) const FEWER_NATS: f64 = 1.5;
/// Share of the evidence from which another number of contacts is named beside the one that was found: what is less than 95 % sure says what else
/// it may be.
pub(crate) const NAMED_SHARE: f64 = 0.05;
/// What a nat of evidence for what was found over more contacts counts on a detector that is not known exactly: the best of more contacts is a local
/// minimum oftener than that of as many, and patterns are made for those found. Of 230 cold answers on detectors as built that were tried against
/// one more, 61 of the 62 wrong ones have too few contacts, while 93 % was claimed of all; with a third of a nat 74 % is, and 73 % are right. A power of
/// the likelihood is what is used where that is known roughly (Miller and Dunson, Robust Bayesian inference via coarsening, 2019).
pub(crate) const MORE_CONTACTS_NAT: f64 = 1.0 / 3.0;
/// Probability of numbers of contacts for which no start was worth a fit, on such a detector: 9 of 225 answers for which none was are wrong, and
/// after a rub 1 of 68.
pub(crate) const UNTRIED_SHARE: f64 = 0.03;
/// Standard deviation of the logarithm of a contact's conductance about its mean in frames that are explained together: a factor of e.
pub(crate) const STRENGTH_DEVIATION: f64 = 1.0;
/// Radius, in usual ones, above which a contact may be two: without it hands of five are four for longer. And the distance, in sums of their radii,
/// below which two may be one: with 1, two of 80 scenes more are wrong.
pub(crate) const TWO_RADII: f64 = 1.6;
/// Radii that contacts may have while their number is not yet right, in usual ones: too few contacts would be made as wide as may be.
pub(crate) const PLAUSIBLE_RADII: f64 = 3.0;
/// What has less than this share of the conductance is no contact of the network: of pairs of like contacts on detectors as built the count is
/// right in 71 % with it, and in 56 % without. What it leaves out of three is a hundredth of the others.
pub(crate) const NETWORK_LEAST_SHARE: f64 = 0.01;

// What is known of a contact.

/// Smallest and largest conductance (sheet conductances): what is lighter is nothing, what is firmer makes no difference.
pub(crate) const CONDUCTANCES_SHEETS: [f64; 2] = [1e-6, 300.0];
/// Standard deviation of the logarithm of a conductance around the sheet's before anything is read: nearly nothing is known.
pub(crate) const CONDUCTANCE_DEVIATION: f64 = 4.0;
/// Standard error of the logarithm of a radius up to which it is known from the readings: a fifth of it.
pub(crate) const KNOWN_RADIUS_DEVIATION: f64 = 0.2;

// What is known of the baseline.

/// Leakage that may have come or gone since the baseline was taken (sheet conductances), unless readings show more: that of some minutes at the
/// fastest drift which a baseline follows.
pub(crate) const LEAKAGE_SHEETS: f64 = 1e-4;
/// Share of what contacts leave from which leakage explains it, where they leave so much that more contacts would be looked for.
pub(crate) const LEAKAGE_SHARE: f64 = 0.5;

// When a contact goes.

/// Nats by which frames of late have to speak for no contact before it is let go, or for more that stay. A filter of rows that is as far behind
/// the best goes on from that: noise alone does that to the right one in 1 of 400 000.
pub(crate) const GONE_NATS: f64 = 12.0;
/// Conductance (sheet conductances) below which a contact cannot be distinguished from nothing: a hundredth of the lightest that is found well.
pub(crate) const VANISHING_SHEETS: f64 = 1e-5;
/// A contact is lost when the logarithm of its conductance is known no better than this standard deviation, and it is light.
pub(crate) const WEAK_DEVIATION: f64 = 0.3;
/// Share of the conductance of the frame before, below which a contact may be let go.
pub(crate) const LIFTED_SHARE: f64 = 0.6;
/// Frames for which a contact that is lost keeps its number: a tenth of a second of 1200 frames/s.
pub(crate) const LOST_FRAMES: u32 = 120;
/// Frames for which a contact that is lost is expected to go on as it went. Longer, its velocity says less than where it was.
pub(crate) const COASTING_FRAMES: f64 = 12.0;

// Contacts, or something else.

/// So many contacts may stand for something else, if they leave more than noise does.
pub(crate) const SUSPICIOUS_CONTACTS: usize = 3;
/// A line or a ring is less likely than contacts by so many nats before anything is read, which is 1 in 1100: fingers are more common. Pairs 10 to 15 mm
/// apart and lines of 16 to 24 mm on `square-60` as built are explained alike: with 6 nats 7 of 80 such pairs are lines and 59 of 80 lines are found, with 7
/// one and 40. What is nearly as likely is named.
pub(crate) const SHAPE_NATS: f64 = 7.0;
/// Standard errors of how far apart the outermost contacts are by which they have moved since a shape was compared with them: of noise alone, 1 in 400.
pub(crate) const SPREAD_DEVIATIONS: f64 = 3.0;
/// A shape of so many times the rival's score on the coarse mesh is given up.
pub(crate) const SHAPE_RIVALS: f64 = 4.0;
/// Shortest line, in mean distances of electrodes.
pub(crate) const SHORTEST_LINE: f64 = 0.7;
/// Smallest ring's radius, in mean distances of electrodes, and that of a single contact which may be one: discs of 6 mm on `square-60` are as well
/// explained by rings of 4 mm.
pub(crate) const SMALLEST_RING: f64 = 0.35;
/// A shape that was chosen is kept as long as it is so large, as a share of what a search asks for: the width of a ring of 13 mm on detectors as built
/// wanders from 7 to 9 mm, as the readings hardly tell it.
pub(crate) const KEPT_SHAPE_SHARE: f64 = 0.6;

// Exchanged wires.

/// Mean square of what one contact leaves with two wires exchanged back, as a share of that before, that shows an exchange.
pub(crate) const HEALED_SHARE: f64 = 0.1;
/// Share of what is left without an exchange up to which, in the linear theory, it is tried with fits.
pub(crate) const HEALED_SHARE_ROUGHLY: f64 = 0.5;
