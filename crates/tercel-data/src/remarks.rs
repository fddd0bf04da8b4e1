//! What a reader has to say beside the table.

use crate::import::LeftOut;

/// Decisions and losses on the way from a file to a table.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Remarks {
    /// What was decided and the user should know, in sentences.
    pub notes: Vec<String>,
    /// Rows that are not in the table, by reason.
    pub left_out: Vec<LeftOut>,
}
