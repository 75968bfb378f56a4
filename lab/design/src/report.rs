//! How a study went, and how what it found is shown.

use std::time::Instant;

use tactomo_study::view::{Part, View};

use super::Claim;
use super::claim::{self, CLAIMS};

/// What was concluded, and how a study went.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Course {
    /// Whether each claim of the paper holds that the study judges.
    pub claims: Vec<Claim>,
    /// Whether it was ended before all was done.
    pub is_stopped: bool,
    /// What it took (s).
    pub seconds: f64,
}

impl Course {
    /// Of a study that began at a time.
    pub(crate) fn since(start: Instant, is_stopped: bool, claims: Vec<Claim>) -> Self {
        Self { claims, is_stopped, seconds: start.elapsed().as_secs_f64() }
    }

    /// What a study shows first: under its title what it is about, and its claims.
    pub(crate) fn view(&self, title: &str, lead: &str) -> View {
        let mut view = View::new(title, lead);
        if self.is_stopped {
            view = view.text("**Stopped before the end**: what is shown and concluded is of what was done.");
        }
        if !self.claims.is_empty() {
            view = view.with(claim::table(&self.claims));
        }
        View { method: format!("Computed in {:.1} s.", self.seconds), ..view }
    }
}

/// What several studies say of the paper, before each of them: their claims come there.
pub fn overview(views: &mut Vec<View>) {
    let mut first = View::new("Which detector", "What of the paper holds, and what of it belongs to its solver.");
    for view in views.iter_mut() {
        let is_claims = |part: &mut Part| matches!(part, Part::Table(table) if table.title == CLAIMS);
        let claims: Vec<Part> = view.parts.extract_if(.., is_claims).collect();
        if !claims.is_empty() {
            first.parts.push(Part::Heading(view.title.clone()));
            first.parts.extend(claims);
        }
    }
    views.insert(0, first);
}
