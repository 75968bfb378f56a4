//! Contacts from frame to frame.
//!
//! What was found last is fitted again. Where that does not explain a frame (of a [patient](Solver::patient) solver: nor the one before), more contacts are looked
//! for beside it, and without it. Of two explanations the one with the larger evidence is believed. What leaves too much is mended: one more where that would explain much,
//! each in turn looked for anew beside the others, and one fewer where those that stay do as well.
//!
//! All that is done in pieces, each of which ends soon, so that whoever has something else to do between them can.

mod given;

use crate::answer::{Answer, Certainty, Flags};
use crate::beside::beside;
use crate::circuit::Circuit;
use crate::evidence::{freedom, is_misfit, is_nothing, limit, score, weakest};
use crate::fit::{Bench, Fit, Fitting, Scene, Went, Work, Working};
use crate::frame::{Errors, Frame, FrameError};
use crate::held::Room;
use crate::normal::ANY_RADIUS;
use crate::real::Real;
use crate::scan::{first, no_candidates};
use crate::search::{FIRST_GAIN, Search, Terms, Wants};
use crate::table::Table;
use crate::unknown::Unknown;

/// Most contacts that a board looks for.
pub const BOARD_CONTACTS: usize = 3;
/// What is followed explains a frame as long as its sum of squares is below this times what the search left: the host's.
const WORSE: f32 = 1.3;
/// Steps at most where contacts are followed, and where one that is gone is left out.
const FOLLOWING: u8 = 4;
const LEAVING_OUT: u8 = 20;
/// Frames without a better answer after which one that does not fit is searched again; doubled each time, up to the second.
const PATIENCE: [u32; 2] = [1, 64];

/// A frame to be explained.
#[derive(Clone, Copy)]
pub(crate) struct Task<'a, T> {
    pub table: &'a Table<'a>,
    pub frame: &'a Frame<'a, T>,
    pub errors: &'a Errors<T>,
    /// What is not known of the detector; none is as its table says.
    pub unknown: Option<&'a Unknown<'a>>,
}

impl<T: Real> Task<'_, T> {
    pub fn readings(&self) -> T {
        T::of(self.errors.count as u32)
    }

    /// Whether the detector's fields are as its table says.
    pub fn is_known(&self) -> bool {
        self.unknown.is_none_or(|unknown| unknown.tables == 0)
    }
}

/// What a piece of work needs besides.
struct Means<'a, 'm, T> {
    room: Option<&'a mut Room<'m, T>>,
    attend: &'a mut dyn FnMut(),
}

/// What is being made of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// There is no frame.
    Idle,
    /// What was found last is fitted to it, without what is no longer there.
    Followed,
    /// What was told before is looked at once more.
    Kept,
    /// It is searched.
    Searched,
    /// What the search has found is looked at once more.
    Found,
}

/// What the next piece of work is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Piece {
    /// A look of a fit.
    Fit,
    /// Places for a first contact.
    First,
    /// A look at contacts beside which one more is looked for; then places from this one on.
    Others,
    Beside(u16),
}

/// Finds contacts in frames, one after the other: those of one table.
#[derive(Clone, Debug)]
pub struct Solver<T = f32, const K: usize = BOARD_CONTACTS, const D: usize = 0> {
    pub(crate) circuit: Circuit<T, K>,
    pub(crate) fitting: Fitting<T, K, D>,
    pub(crate) search: Search<T, K, D>,
    stage: Stage,
    piece: Piece,
    /// Work on this frame so far; pieces of a search.
    pub(crate) work: Work<K>,
    pieces: u32,
    pub(crate) scene: Scene<T, K, D>,
    pub(crate) ids: [u32; K],
    /// Numbers begin at 1.
    pub(crate) next_id: u32,
    /// What the last search left of a reading, and the frames that one that did not end well is not repeated for.
    searched: T,
    /// How sure it was of the number of contacts that it found.
    certainty: Option<Certainty<T>>,
    /// Twice the logarithm of the evidence for what was answered last.
    evidence: Option<T>,
    patience: u32,
    wait: u32,
    /// Whether the last frame was not explained by what was followed, or there was none.
    was_lost: bool,
    /// Whether one is waited for that is not explained either.
    is_patient: bool,
    /// Whether the frame is to be searched, whatever explains it.
    is_begun: bool,
    /// Most contacts that are looked for.
    most: usize,
    /// What was followed with a contact that the readings hardly speak for, and whether that stays.
    doubted: Option<Fit<T, K, D>>,
    stays: bool,
}

impl<T: Real, const K: usize, const D: usize> Default for Solver<T, K, D> {
    fn default() -> Self {
        Self::blank(false)
    }
}

impl Solver {
    /// A solver that has seen nothing, in the numbers and for the contacts of a board; one of others is [`Solver::default`]. Each frame is answered by itself.
    pub const fn new() -> Self {
        Self::blank(false)
    }
}

impl<T: Real, const K: usize, const D: usize> Solver<T, K, D> {
    /// Pieces of work that a search takes at most; one that is not done by then ends with the best that it has, and [misfit](Flags::MISFIT) is raised. They grow with
    /// the contacts that are tried one after the other, and with those of each try: about as the square of their most.
    ///
    /// On a board it is 600. Of 2400 frames of none to six contacts on a made-up sheet, searches that explain what three or fewer left took up to 300, those of random
    /// readings up to 1400. Five contacts on `square-60` take more than 400 and fewer than 600.
    pub const MOST_PIECES: u32 = (600 * K * K / (BOARD_CONTACTS * BOARD_CONTACTS)) as u32;

    /// One that waits, for frames whose rows are read one after the other: while something lands or lifts, these are not rows of one scene. A frame that what is
    /// followed does not explain is flagged, keeps the contacts of the one before, and is searched only if the next one is not explained either.
    pub const fn patient() -> Self {
        Self::blank(true)
    }

    const fn blank(is_patient: bool) -> Self {
        Self {
            circuit: Circuit::EMPTY,
            fitting: Fitting::NONE,
            search: Search::NONE,
            stage: Stage::Idle,
            piece: Piece::Fit,
            work: Work::NONE,
            pieces: 0,
            scene: Scene::EMPTY,
            ids: [0; K],
            next_id: 1,
            searched: T::ZERO,
            certainty: None,
            evidence: None,
            patience: PATIENCE[0],
            wait: 0,
            was_lost: true,
            is_patient,
            is_begun: false,
            most: K,
            doubted: None,
            stays: false,
        }
    }

    /// Forgets the frames before.
    pub fn reset(&mut self) {
        *self = Self { most: self.most, ..Self::blank(self.is_patient) };
    }

    /// Looks for so many contacts at most, of the `K` that there may be.
    pub fn limit(&mut self, most: usize) {
        self.most = most.clamp(1, K);
    }

    /// The contacts of a frame.
    ///
    /// # Errors
    /// [`FrameError`] if it cannot be a frame of the table's detector.
    pub fn solve(&mut self, table: &Table<'_>, frame: &Frame<'_, T>) -> Result<Answer<T, K>, FrameError> {
        self.stage = Stage::Idle;
        loop {
            if let Some(answer) = self.solve_in_pieces(table, frame, u32::MAX, &mut || {})? {
                return Ok(answer);
            }
        }
    }

    /// How far the detector is that the last answer makes likely from the table's, in each direction that is not known, in standard deviations.
    pub fn steps(&self) -> &[T; D] {
        &self.scene.steps
    }

    /// Whether a frame is being worked on: [`solve_in_pieces`](Self::solve_in_pieces) goes on with it.
    pub fn is_busy(&self) -> bool {
        self.stage != Stage::Idle
    }

    /// Does so many pieces of the work on a frame, or fewer if it is done with fewer; the contacts once it is done. It is to be called with the same frame until then.
    ///
    /// No piece takes longer than two looks at three contacts, some 300 000 floating-point operations. A frame whose contacts are followed takes two to five, and
    /// a search [`MOST_PIECES`](Self::MOST_PIECES) at most. During a piece `attend` is called after each look at contacts or at a place, for who has something else to attend to.
    ///
    /// # Errors
    /// [`FrameError`] if it cannot be a frame of the table's detector.
    pub fn solve_in_pieces(
        &mut self,
        table: &Table<'_>,
        frame: &Frame<'_, T>,
        pieces: u32,
        attend: &mut dyn FnMut(),
    ) -> Result<Option<Answer<T, K>>, FrameError> {
        self.work_on(table, frame, None, pieces, &mut Means { room: None, attend })
    }

    /// The contacts of a frame of a detector that is not known exactly. The room is to be the same for all frames; `D` directions count at most.
    ///
    /// # Errors
    /// [`FrameError`] if it cannot be a frame of the table's detector.
    ///
    /// # Panics
    /// If there is less [room](Room::numbers) than it takes.
    pub fn solve_unknown(
        &mut self,
        table: &Table<'_>,
        unknown: &Unknown<'_>,
        room: &mut Room<'_, T>,
        frame: &Frame<'_, T>,
    ) -> Result<Answer<T, K>, FrameError> {
        self.stage = Stage::Idle;
        loop {
            let means = &mut Means { room: Some(&mut *room), attend: &mut || {} };
            if let Some(answer) = self.work_on(table, frame, Some(unknown), u32::MAX, means)? {
                return Ok(answer);
            }
        }
    }

    fn work_on(
        &mut self,
        table: &Table<'_>,
        frame: &Frame<'_, T>,
        unknown: Option<&Unknown<'_>>,
        pieces: u32,
        means: &mut Means<'_, '_, T>,
    ) -> Result<Option<Answer<T, K>>, FrameError> {
        frame.check(table)?;
        let (frame, left_out) = frame.without_broken(table);
        let errors = self.errors_of(&frame, table, unknown.is_some());
        let task = Task { table, frame: &frame, errors: &errors, unknown };
        if self.stage == Stage::Idle {
            (self.stage, self.work) = (Stage::Followed, Work::NONE);
            (self.doubted, self.stays) = (None, false);
            self.fit(self.scene, T::of(ANY_RADIUS), FOLLOWING);
            self.fitting.goes_on = true;
        }
        let answer = (0..pieces).find_map(|_| self.go_on(task, means));
        Ok(answer.map(|mut answer| {
            answer.left_out = left_out;
            answer.flags.raise(Flags::FAULT, left_out != 0);
            answer
        }))
    }

    /// What is known of a frame's errors. Where one begins, it is found whether patterns are held on.
    fn errors_of(&mut self, frame: &Frame<'_, T>, table: &Table<'_>, is_unknown: bool) -> Errors<T> {
        let mut errors = Errors::of(frame, table);
        if is_unknown {
            // Pads are among what is not known.
            errors.pads.fill(T::ZERO);
        }
        if self.stage == Stage::Idle {
            self.fitting.on.begin_frame(&mut errors, frame.volts.len());
            (self.circuit.is_solved, self.fitting.is_derived) = (false, false);
        }
        errors
    }

    /// Does a piece of work.
    fn go_on(&mut self, task: Task<'_, T>, means: &mut Means<'_, '_, T>) -> Option<Answer<T, K>> {
        let readings = task.readings();
        let mut work = Working { done: &mut self.work, attend: &mut *means.attend };
        let mut bench = Bench { circuit: &mut self.circuit, room: means.room.as_deref_mut() };
        let wants = match self.piece {
            Piece::Fit => match self.fitting.go_on(task, &mut bench, &mut work) {
                Went::On => None,
                Went::ToEnd(found) if self.stage == Stage::Searched => Some(self.search.fitted(found, readings)),
                Went::ToEnd(found) => return self.fitted(found, task, means),
            },
            Piece::First => {
                self.search.starts = first(task, &mut work);
                Some(self.search.placed(readings))
            }
            Piece::Others => match self.fitting.go_on(task, &mut bench, &mut work) {
                Went::ToEnd(Some(_)) => {
                    self.piece = Piece::Beside(0);
                    None
                }
                // Nothing can be said of what makes no sense.
                _ => Some(self.search.placed(readings)),
            },
            Piece::Beside(from) => {
                let (fitting, starts) = (&mut self.fitting, &mut self.search.starts);
                if D > 0
                    && let (Some(unknown), Some(room)) = (task.unknown, &mut bench.room)
                {
                    fitting.births(task, unknown, bench.circuit, room, starts, &mut work);
                    let wants = self.search.placed(readings);
                    return self.count_piece(task).or_else(|| self.prepare(wants, task));
                }
                match beside(task, bench.circuit, &fitting.normal, from.into(), starts, &mut work) {
                    Some(next) => {
                        self.piece = Piece::Beside(next as u16);
                        None
                    }
                    None => Some(self.search.placed(readings)),
                }
            }
        };
        if let Some(answer) = self.count_piece(task) {
            return Some(answer);
        }
        wants.and_then(|wants| self.prepare(wants, task))
    }

    /// Counts a piece of a search, and ends one that takes too many.
    fn count_piece(&mut self, task: Task<'_, T>) -> Option<Answer<T, K>> {
        if self.stage != Stage::Searched {
            return None;
        }
        self.pieces += 1;
        if self.pieces < Self::MOST_PIECES { None } else { self.found(self.search.best_so_far(), task) }
    }

    /// Prepares what a search wants done.
    fn prepare(&mut self, wants: Wants<T, K, D>, task: Task<'_, T>) -> Option<Answer<T, K>> {
        match wants {
            Wants::Fit(scene, radius_deviation, steps) => self.fit(scene, radius_deviation, steps),
            Wants::First => self.piece = Piece::First,
            Wants::Beside(scene, radius_deviation) => {
                self.fit(scene, radius_deviation, 0);
                (self.search.starts, self.piece) = (no_candidates(), Piece::Others);
            }
            Wants::Nothing(found) => return self.found(found, task),
        }
        None
    }

    fn fit(&mut self, scene: Scene<T, K, D>, radius_deviation: T, steps: u8) {
        self.fitting.begin(scene, radius_deviation, steps);
        self.piece = Piece::Fit;
    }

    /// Takes a fit that is none of a search.
    fn fitted(
        &mut self,
        found: Option<Fit<T, K, D>>,
        task: Task<'_, T>,
        means: &mut Means<'_, '_, T>,
    ) -> Option<Answer<T, K>> {
        if self.stage != Stage::Followed {
            return Some(self.end(found, self.stage == Stage::Kept, task));
        }
        // One that the readings hardly speak for goes, unless those that stay do worse without it than it costs.
        match (self.doubted.take(), found, found.and_then(|fit| weakest(&fit))) {
            (Some(all), Some(fewer), _) if score(&all) < score(&fewer) && !is_nothing(&all) => {
                self.stays = true;
                self.fit(all.scene, T::of(ANY_RADIUS), 0);
                None
            }
            (_, Some(fit), Some(gone)) if !self.stays || is_nothing(&fit) => {
                self.doubted = Some(fit);
                self.fit(fit.scene.without(gone), T::of(ANY_RADIUS), LEAVING_OUT);
                None
            }
            _ => self.followed(found, task, means),
        }
    }

    /// Decides what becomes of a frame by what was followed in it.
    fn followed(
        &mut self,
        found: Option<Fit<T, K, D>>,
        task: Task<'_, T>,
        means: &mut Means<'_, '_, T>,
    ) -> Option<Answer<T, K>> {
        let readings = task.readings();
        // Nothing is left of what there was, or far less unexplained: what did not fit is gone.
        let has_changed =
            found.map_or(self.scene.count > 0, |fit| self.search.more && T::of(WORSE) * fit.cost < self.searched);
        if has_changed {
            self.wait = 0;
        }
        let most = |fit: &Fit<T, K, D>| (T::of(WORSE) * self.searched).max(limit(readings - freedom(fit)));
        let alone =
            found.is_none().then(|| first(task, &mut Working { done: &mut self.work, attend: &mut *means.attend }));
        let is_lost = match (&found, &alone) {
            (Some(fit), _) => has_changed || fit.cost > most(fit),
            (None, alone) => alone.is_some_and(|alone| alone[0].gain >= T::of(FIRST_GAIN)),
        };
        self.search.more &= found.is_some();
        let may_search = !self.is_patient || self.was_lost && self.may_search();
        if core::mem::take(&mut self.is_begun) || is_lost && may_search {
            (self.stage, self.pieces) = (Stage::Searched, 0);
            let wants = self.search.begin(
                found,
                alone,
                readings,
                Terms {
                    is_known: task.is_known(),
                    most: self.most,
                    radius_m: task.table.head().radius_m,
                    bounds_m: task.table.bounds_m(),
                },
            );
            return self.prepare(wants, task);
        }
        if is_lost && !self.was_lost {
            // While something lands or lifts, rows are not those of one scene: what there was stays, and the next frame tells.
            self.stage = Stage::Kept;
            self.fit(self.scene, T::of(ANY_RADIUS), 0);
            return None;
        }
        Some(self.end(found, is_lost, task))
    }

    fn may_search(&mut self) -> bool {
        let may = self.wait == 0;
        self.wait = self.wait.saturating_sub(1);
        may
    }

    /// Takes what a search has found; notes how well it explains the frame. One that was not ended did not end well.
    fn found(&mut self, found: Option<Fit<T, K, D>>, task: Task<'_, T>) -> Option<Answer<T, K>> {
        self.search.more &= found.is_some();
        self.searched = found.map_or(T::ZERO, |fit| fit.cost);
        self.certainty = found.map(|fit| self.search.certainty(&fit));
        let fits = self.pieces < Self::MOST_PIECES && found.is_none_or(|fit| !is_misfit(&fit, task.readings()));
        self.patience = if fits { PATIENCE[0] } else { (2 * self.patience).min(PATIENCE[1]) };
        self.wait = if fits { 0 } else { self.patience };
        self.stage = Stage::Found;
        match found {
            Some(fit) => {
                self.fit(fit.scene, T::of(ANY_RADIUS), 0);
                None
            }
            None => Some(self.end(None, false, task)),
        }
    }

    /// The answer, with what is the last fit if there is one.
    fn end(&mut self, found: Option<Fit<T, K, D>>, is_lost: bool, task: Task<'_, T>) -> Answer<T, K> {
        let is_searched = self.stage == Stage::Found;
        // A search that ends well has nothing to wait for.
        self.was_lost = if is_searched { self.wait > 0 } else { is_lost };
        self.stage = Stage::Idle;
        let before = self.scene;
        self.scene = found.map_or(Scene::EMPTY, |fit| fit.scene);
        self.evidence = found.map(|fit| fit.evidence);
        self.number(&before);
        self.certainty = self.certainty.filter(|_| is_searched || self.scene.count == before.count);
        let mut answer = self.answer(found, task);
        answer.flags.raise(Flags::MISFIT, self.was_lost);
        let is_doubtful = answer.flags.has(Flags::MISFIT) || answer.flags.has(Flags::MORE);
        answer.certainty = self.certainty.filter(|_| !is_doubtful);
        answer
    }
}
