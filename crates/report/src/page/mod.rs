//! What a page is made of: facts, tables, figures with captions, the frame around them.

pub(crate) mod facts;
pub(crate) mod html;
pub(crate) mod instrument;
#[cfg(test)]
pub(crate) mod markup_checks;
pub(crate) mod setup;
pub(crate) mod table;
