//! What an interrupted command takes with it: temporary files, and folders made for results.

use std::fs;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Exit status after Ctrl-C and after a request to end: 128 and the number of SIGINT, as shells count.
pub const EXIT_INTERRUPTED: u8 = 130;

/// Axes move at this process' command.
static LIVE: AtomicBool = AtomicBool::new(false);
static PRESSES: AtomicU32 = AtomicU32::new(0);
/// Presses that are left to whoever moves axes.
const MOST_PRESSES: u32 = 2;

/// From now on the first two interrupts are counted, and left to whoever asks for them.
pub(crate) fn count_presses() {
    LIVE.store(true, Ordering::Relaxed);
}

/// Interrupts so far.
pub(crate) fn presses() -> u32 {
    PRESSES.load(Ordering::Relaxed)
}

static PENDING: Mutex<Pending> = Mutex::new(Pending { files: Vec::new(), folders: Vec::new() });

/// Files and folders that are nobody's before their set is complete.
#[derive(Debug)]
pub(crate) struct Pending {
    /// Temporary files.
    pub(crate) files: Vec<PathBuf>,
    /// Folders made for results, outer before inner.
    pub(crate) folders: Vec<PathBuf>,
}

/// The list of this process. Whoever holds it keeps an interrupt waiting.
pub(crate) fn pending() -> MutexGuard<'static, Pending> {
    PENDING.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Pending {
    /// Removes everything on the list.
    fn remove(&mut self) {
        // What is gone already, or has become somebody else's, is left.
        for file in self.files.drain(..) {
            let _ = fs::remove_file(file);
        }
        for folder in self.folders.drain(..).rev() {
            let _ = fs::remove_dir(folder);
        }
    }
}

/// From now on Ctrl-C, and the request to end that a system sends, tidy up before this process ends.
///
/// Where a signal is ignored or handled already, as below `nohup`, that stays as it is, and only the request to end is heard.
pub fn tidy_up_on_interrupt() {
    // Without a handler the signals end the process as ever; only temporary files may stay.
    if ctrlc::try_set_handler(asked).is_err() {
        listen_to_termination();
    }
}

/// Scripts start what they put in the background with Ctrl-C ignored: the request to end is heard even so.
#[cfg(unix)]
fn listen_to_termination() {
    use signal_hook::consts::SIGTERM;
    use signal_hook::iterator::Signals;
    if let Ok(mut signals) = Signals::new([SIGTERM]) {
        std::thread::spawn(move || signals.forever().for_each(|_| asked()));
    }
}

#[cfg(not(unix))]
fn listen_to_termination() {}

fn asked() {
    // Whoever moves axes brings them to rest; who presses a third time does not want to wait for that.
    if LIVE.load(Ordering::Relaxed) && PRESSES.fetch_add(1, Ordering::Relaxed) < MOST_PRESSES {
        return;
    }
    // Held until the process is gone, so that nothing new comes up.
    let mut pending = pending();
    pending.remove();
    std::process::exit(EXIT_INTERRUPTED.into());
}
