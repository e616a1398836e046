//! Exercises of the laboratory course: cards that are checked on the recording and on the settings, never on a number that
//! somebody typed from somewhere.
//!
//! | file | what |
//! |---|---|
//! | `cards.rs` | the cards: what each asks for |
//! | `checks/` | the check of each card |
//! | `work.rs` | what a student hands in, as a check sees it: samples, setup, answers |
//! | `turning.rs` | turns of a recording: its rests, and the gyroscope integrated between them |
//! | `answers.rs` | what a student types: name and answers |
//! | `hand_in.rs` | the file that is handed in, and judging it |
//! | `class.rs` | the hand-ins of a class, in one table |
//!
//! A check is a pure function: the same hand-in is judged the same by everybody. What it says are keys of the catalogue
//! `web/words/course.json` with numbers, so that page and program say it in English and in Spanish.

pub mod answers;
mod cards;
mod checks;
mod class;
mod hand_in;
mod judgement;
mod turning;
pub mod words;
mod work;

#[cfg(test)]
mod tests;

pub use cards::{Card, Question, QuestionKind};
pub use class::{Class, Graded, Student};
pub use hand_in::{HandIn, HandInError, Judged};
pub use judgement::{Judgement, Reason};
pub use work::{Answers, Start, Work, number};
