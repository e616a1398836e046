//! A class of Python in a process of its own, over pipes: whatever it does, the program goes on.

use std::env;
use std::io::{BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::Duration;

use super::pipelined::Pipelined;
use super::protocol::{ANSWER, Answer, LONGEST_TEXT, Request, failure};
use super::remote::{Channel, Remote};
use super::{Made, Pace, register};
use crate::attitude::{EstimatorKind, Parameters};
use crate::error::EvaluationError;
use northing_core::attitude::StartUncertainty;

/// What the process runs: the class `Estimator` and the loop that serves one.
const HOST: &str = include_str!("estimator.py");
/// Names the interpreter.
const PYTHON: &str = "NORTHING_PYTHON";
/// Tells the process to keep the traceback of a failure to itself.
const QUIET: &str = "NORTHING_ESTIMATOR_QUIET";
/// How long importing the file and making the estimator may last.
const START_PATIENCE: Duration = Duration::from_secs(60);
/// How long one call may last.
const PATIENCE: Duration = Duration::from_secs(5);

/// Whether a failure has been shown in full: once is enough, a comparison has many runs.
static SHOWN: AtomicBool = AtomicBool::new(false);

/// A class in a file: `mine.py:Mine`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PythonClass {
    file: PathBuf,
    class: String,
    /// The interpreter, where it is known.
    python: Option<PathBuf>,
}

impl PythonClass {
    /// Whether a text can only mean a class in a file.
    #[must_use]
    pub fn is_meant_by(text: &str) -> bool {
        text.rsplit_once(':')
            .is_some_and(|(file, _)| file.to_lowercase().ends_with(".py"))
    }
}

impl FromStr for PythonClass {
    type Err = EvaluationError;

    fn from_str(text: &str) -> Result<Self, EvaluationError> {
        let fails = |problem: String| EvaluationError::OwnEstimator {
            sentence: format!("`{text}`: {problem}"),
        };
        let parts = text
            .rsplit_once(':')
            .filter(|(file, class)| file.ends_with(".py") && is_identifier(class));
        let (file, class) = parts.ok_or_else(|| {
            fails("expected a file and a class in it, such as mine.py:Mine".to_owned())
        })?;
        let file = PathBuf::from(file);
        if !file.is_file() {
            return Err(fails(format!("there is no file {}", file.display())));
        }
        // The run may be elsewhere by the time that it starts.
        let file = std::path::absolute(&file).unwrap_or(file);
        Ok(Self {
            file,
            class: class.to_owned(),
            python: None,
        })
    }
}

fn is_identifier(text: &str) -> bool {
    let mut letters = text.chars();
    let first = letters
        .next()
        .is_some_and(|c| c.is_alphabetic() || c == '_');
    first && letters.all(|c| c.is_alphanumeric() || c == '_')
}

/// Registers a class of Python, `FILE.py:CLASS`, under that name. It runs in a process of its own, begun when a run begins, by
/// the interpreter that `NORTHING_PYTHON` names, else the one beside the program, else `python3` of the path.
///
/// # Errors
/// The text is no such name, or the file does not exist.
pub fn register_python(text: &str) -> Result<EstimatorKind, EvaluationError> {
    Ok(register_class(text, text.parse()?))
}

/// As [`register_python`], by this interpreter.
///
/// # Errors
/// As [`register_python`].
pub fn register_python_with(text: &str, python: PathBuf) -> Result<EstimatorKind, EvaluationError> {
    let class = PythonClass {
        python: Some(python),
        ..text.parse()?
    };
    Ok(register_class(text, class))
}

fn register_class(text: &str, class: PythonClass) -> EstimatorKind {
    let name = text.to_owned();
    let make = move |parameters: &Parameters, pace| -> Made {
        let uncertainty = StartUncertainty::of(&parameters.attitude);
        let begin = {
            let (class, name) = (class.clone(), name.clone());
            move || Remote::new(Process::begin(&class), &name, uncertainty)
        };
        Ok(match pace {
            Pace::Waits => Box::new(begin()),
            Pace::Live => Box::new(Pipelined::new(begin, &name, uncertainty)),
        })
    };
    let about = "a class of Python, in a process of its own";
    register(text, about, make)
}

/// The interpreter.
fn python() -> PathBuf {
    if let Some(named) = env::var_os(PYTHON).filter(|named| !named.is_empty()) {
        return named.into();
    }
    let name = if cfg!(windows) {
        "python.exe"
    } else {
        "python3"
    };
    // The program of a wheel lies beside the interpreter that it was installed for.
    let beside = env::current_exe().ok();
    let beside = beside.as_deref().and_then(Path::parent);
    let beside = beside.map(|folder| folder.join(name));
    beside
        .filter(|python| python.is_file())
        .unwrap_or_else(|| name.into())
}

/// A process that serves an estimator.
#[derive(Debug)]
struct Process {
    running: Result<Running, String>,
    /// It has said that it is ready.
    is_ready: bool,
}

#[derive(Debug)]
struct Running {
    child: Child,
    requests: ChildStdin,
    answers: Receiver<Result<Answer, String>>,
}

impl Process {
    /// Starts it; whether it comes up shows at the first call.
    fn begin(class: &PythonClass) -> Self {
        Self {
            running: Running::begin(class),
            is_ready: false,
        }
    }
}

impl Running {
    fn begin(class: &PythonClass) -> Result<Self, String> {
        let python = class.python.clone().unwrap_or_else(python);
        let mut command = Command::new(&python);
        command
            .args(["-c", HOST])
            .arg(&class.file)
            .arg(&class.class)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped());
        if SHOWN.load(Ordering::Relaxed) {
            command.env(QUIET, "1");
        }
        let mut child = command.spawn().map_err(|error| {
            format!(
                "cannot be run: `{}` does not start ({error}); install Python, or name its interpreter in {PYTHON}",
                python.display()
            )
        })?;
        let (Some(requests), Some(answers)) = (child.stdin.take(), child.stdout.take()) else {
            return Err("cannot be run: it has no pipes".to_owned());
        };
        let (send, receive) = sync_channel(1);
        std::thread::spawn(move || {
            let mut answers = BufReader::new(answers);
            loop {
                let answer = read(&mut answers);
                let is_last = answer.is_err();
                if send.send(answer).is_err() || is_last {
                    return;
                }
            }
        });
        Ok(Self {
            child,
            requests,
            answers: receive,
        })
    }

    fn answer(&mut self, patience: Duration) -> Result<Answer, String> {
        match self.answers.recv_timeout(patience) {
            Ok(answer) => answer,
            Err(RecvTimeoutError::Timeout) => {
                let seconds = patience.as_secs();
                Err(format!("has not answered for {seconds} s and was ended"))
            }
            Err(RecvTimeoutError::Disconnected) => Err("has ended without an answer".to_owned()),
        }
    }
}

/// One answer; what the other side says of its failure as an error.
fn read(answers: &mut impl Read) -> Result<Answer, String> {
    let ended = |_| "has ended without an answer".to_owned();
    let mut status = [0];
    answers.read_exact(&mut status).map_err(ended)?;
    if status[0] == 0 {
        let mut bytes = [0; ANSWER];
        answers.read_exact(&mut bytes).map_err(ended)?;
        return Answer::read(&bytes).ok_or_else(|| "has sent half an answer".to_owned());
    }
    let mut length = [0; 4];
    answers.read_exact(&mut length).map_err(ended)?;
    let length = u32::from_le_bytes(length) as usize;
    let mut text = vec![0; length.min(LONGEST_TEXT)];
    answers.read_exact(&mut text).map_err(ended)?;
    Err(failure(&text))
}

impl Channel for Process {
    fn ask(&mut self, request: &Request) -> Result<Answer, String> {
        let running = self.running.as_mut().map_err(|reason| reason.clone())?;
        if !self.is_ready {
            running.answer(START_PATIENCE)?;
            self.is_ready = true;
        }
        let sent = running.requests.write_all(&request.bytes());
        // One that has ended has said why.
        let _ = sent.and_then(|()| running.requests.flush());
        let answer = running.answer(PATIENCE);
        if answer.is_err() {
            SHOWN.store(true, Ordering::Relaxed);
        }
        answer
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // It may hang; there is nothing in it that anybody needs.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
