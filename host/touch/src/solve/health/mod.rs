//! Which electrodes cannot be right, and which tables.

pub(crate) mod electrodes;
pub(crate) mod table;
pub(crate) mod watch;
