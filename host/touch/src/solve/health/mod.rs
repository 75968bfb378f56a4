//! Which electrodes cannot be right.

pub(crate) mod electrodes;
pub(crate) mod watch;
