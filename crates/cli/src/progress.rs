//! Progress on standard error: only on a terminal, only when something takes longer than a second.

use std::io::IsTerminal as _;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use northing_recording::{Recording, Watched};

use crate::interrupt::happened;

/// Nothing is drawn before this has passed.
const PATIENCE: Duration = Duration::from_secs(1);
/// How often a drawn bar moves.
const TICK: Duration = Duration::from_millis(200);
/// Events between two looks at the clock, a power of two.
const EVENTS_PER_LOOK: u64 = 4096;

/// The progress of one piece of work.
#[derive(Debug)]
pub(crate) struct Progress {
    bar: ProgressBar,
    started: Instant,
    shown: bool,
    terminal: bool,
    count: u64,
}

impl Progress {
    /// Work of a known number of steps; `what` is said beside the bar.
    pub(crate) fn of_steps(steps: u64, what: &str) -> Self {
        let style = "{msg} [{bar:32}] {pos}/{len}, {eta} left";
        Self::new(
            ProgressBar::with_draw_target(Some(steps), ProgressDrawTarget::hidden()),
            style,
            what,
        )
    }

    /// Work on a stream of unknown length.
    pub(crate) fn of_stream(what: &str) -> Self {
        let style = "{spinner} {msg}: {human_pos} samples, {elapsed}";
        Self::new(
            ProgressBar::with_draw_target(None, ProgressDrawTarget::hidden()),
            style,
            what,
        )
    }

    fn new(bar: ProgressBar, style: &str, what: &str) -> Self {
        // The templates are constants; the fallback only loses the look.
        if let Ok(style) = ProgressStyle::with_template(style) {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.set_message(what.to_owned());
        Self {
            bar,
            started: Instant::now(),
            shown: false,
            terminal: std::io::stderr().is_terminal(),
            count: 0,
        }
    }

    /// One more event of a stream; cheap enough to be called for each.
    pub(crate) fn event(&mut self) {
        self.event_at(self.count + 1);
    }

    /// One more event, after which so many steps are done.
    pub(crate) fn event_at(&mut self, steps: u64) {
        self.count += 1;
        if self.count.is_multiple_of(EVENTS_PER_LOOK) && self.may_draw() {
            self.bar.set_position(steps);
        }
    }

    /// A step is done.
    fn step(&mut self) {
        self.count += 1;
        if self.may_draw() {
            self.bar.set_position(self.count);
        }
    }

    fn may_draw(&mut self) -> bool {
        if !self.shown && self.terminal && self.started.elapsed() > PATIENCE {
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
            // Goes on turning when nothing is counted, as while a smoother goes backwards.
            self.bar.enable_steady_tick(TICK);
            self.shown = true;
        }
        self.shown
    }
}

/// The progress of work that threads share.
#[derive(Debug)]
pub(crate) struct SharedProgress(Mutex<Progress>);

impl SharedProgress {
    /// Work of a known number of steps.
    pub(crate) fn of_steps(steps: u64, what: &str) -> Self {
        Self(Mutex::new(Progress::of_steps(steps, what)))
    }

    /// A step is done.
    pub(crate) fn step(&self) {
        if let Ok(mut progress) = self.0.lock() {
            progress.step();
        }
    }
}

/// The events of a recording, until the program is interrupted, with their progress.
pub(crate) fn watched<'a>(recording: &'a mut Recording, what: &str) -> Watched<'a> {
    let mut progress = Progress::of_stream(what);
    recording.watched(move || {
        progress.event();
        !happened()
    })
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
