//! Run estimators over recordings and say how good they are, in numbers, words and pictures.

pub mod trace;
