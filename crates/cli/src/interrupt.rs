//! Ctrl-C: streams end with an error, so that half-written temporary files are removed on the way out.

use std::process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

/// The exit code that shells expect of a program ended by Ctrl-C.
pub(crate) const EXIT_CODE: u8 = 130;
/// How long a command may take to clean up before it is ended.
const PATIENCE: Duration = Duration::from_secs(2);

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// From now on Ctrl-C (and a polite request to terminate) ends streams instead of the program; a
/// second one, or two seconds without an end, ends the program.
pub(crate) fn install() {
    // Where no handler can be installed, Ctrl-C keeps its usual meaning.
    let _ = ctrlc::set_handler(|| {
        if !INTERRUPTED.swap(true, Ordering::Relaxed) {
            thread::sleep(PATIENCE);
        }
        process::exit(i32::from(EXIT_CODE));
    });
}

/// Whether Ctrl-C was pressed.
pub(crate) fn happened() -> bool {
    INTERRUPTED.load(Ordering::Relaxed)
}

/// Ends the program where work cannot be left half done, if it was interrupted.
pub(crate) fn exit_if_happened() {
    if happened() {
        process::exit(i32::from(EXIT_CODE));
    }
}
