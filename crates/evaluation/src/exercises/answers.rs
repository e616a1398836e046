//! What a student types: a name and answers, refused in the same sentence wherever they are typed.

use super::cards::{Card, Question, QuestionKind};
use super::work::{Answers, number};

/// Names and answers are no longer, characters.
pub const LONGEST: usize = 80;

/// Why an answer is not taken.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{question}: {problem}")]
pub struct AnswerError {
    /// The question, and the answer where it is the answer that is wrong.
    question: String,
    /// What is wrong with it.
    problem: String,
}

impl AnswerError {
    fn new(question: impl Into<String>, problem: impl Into<String>) -> Self {
        Self {
            question: question.into(),
            problem: problem.into(),
        }
    }
}

/// The name of who hands in.
///
/// # Errors
/// There is none, or it is long, in a sentence.
pub fn student(text: &str) -> Result<String, String> {
    let name = line(text, usize::MAX);
    match name.chars().count() {
        0 => Err("expected a name".to_owned()),
        1..=LONGEST => Ok(name),
        _ => Err(format!("expected a name of at most {LONGEST} characters")),
    }
}

/// Answers by their questions, each of which has one.
///
/// # Errors
/// One is missing, given twice, or none that its question can have.
pub fn checked<'a>(
    card: Card,
    given: impl IntoIterator<Item = (&'a str, &'a str)>,
) -> Result<Answers, AnswerError> {
    let mut answers = Answers::new();
    for (name, value) in given {
        let (name, value) = (line(name, LONGEST), line(value, usize::MAX));
        let shown = || format!("{name}={}", line(&value, LONGEST));
        let mut questions = card.questions().iter();
        let question = questions.find(|question| question.name == name);
        let question = question.ok_or_else(|| AnswerError::new(shown(), expected(card)))?;
        check(question, &value).map_err(|problem| AnswerError::new(shown(), problem))?;
        if answers.insert(name.clone(), value).is_some() {
            return Err(AnswerError::new(name, "it is answered twice; keep one"));
        }
    }
    let mut questions = card.questions().iter();
    match questions.find(|question| !answers.contains_key(question.name)) {
        Some(question) => {
            let problem = format!("it is not answered; {}", expected(card));
            Err(AnswerError::new(question.name, problem))
        }
        None => Ok(answers),
    }
}

/// What a card asks for, in a sentence.
fn expected(card: Card) -> String {
    let names: Vec<&str> = card.questions().iter().map(|q| q.name).collect();
    let name = card.name();
    match names.is_empty() {
        true => format!("`{name}` has no questions; leave it out"),
        false => format!("`{name}` asks for {}", names.join(", ")),
    }
}

fn check(question: &Question, value: &str) -> Result<(), String> {
    if value.chars().count() > LONGEST {
        return Err(format!(
            "expected an answer of at most {LONGEST} characters"
        ));
    }
    match question.kind {
        QuestionKind::Number if number(value).is_none() => {
            Err(format!("expected a number in {}", question.unit))
        }
        QuestionKind::Choice if !question.choices.contains(&value) => {
            Err(format!("expected one of: {}", question.choices.join(", ")))
        }
        _ => Ok(()),
    }
}

/// Text of a stranger on one line that a terminal can show, of at most so many characters.
pub(super) fn line(text: &str, most: usize) -> String {
    let words: Vec<&str> = text.split_whitespace().collect();
    let shown = words.join(" ");
    let shown = shown.chars().filter(|c| !c.is_control());
    shown.take(most).collect()
}
