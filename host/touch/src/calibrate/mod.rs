//! What makes a detector on paper the one that was built.

pub mod force;
