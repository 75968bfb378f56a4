//! What is done to answers after a method has made them: solutions to solutions.

pub(crate) mod association;
pub(crate) mod correct;
pub(crate) mod force;
