//! How far the work has come, for whoever watches.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::args::Talk;

/// Work shorter than this shows no bar.
const PATIENCE: Duration = Duration::from_secs(1);

/// Steps of the bar: tenths of a percent.
const STEPS: u64 = 1000;

/// A bar on standard error once the work takes longer than a second; silent when standard error is not a
/// terminal, and with `--quiet` or `--json`.
#[derive(Debug)]
pub struct Progress {
    /// `None`: nobody watches.
    since: Option<Instant>,
    bar: Option<ProgressBar>,
    stage: &'static str,
}

impl Progress {
    /// Progress as the command line asks for it.
    pub fn new(talk: Talk) -> Self {
        let watched = !talk.json && !talk.quiet && std::io::stderr().is_terminal();
        Progress { since: watched.then(Instant::now), bar: None, stage: "" }
    }

    /// Progress that nobody watches.
    pub fn silent() -> Self {
        Progress { since: None, bar: None, stage: "" }
    }

    /// Whether anybody watches.
    pub fn watched(&self) -> bool {
        self.since.is_some()
    }

    /// Names what is being done.
    pub fn stage(&mut self, name: &'static str) {
        self.stage = name;
        if let Some(bar) = &self.bar {
            bar.set_message(name);
            bar.set_position(0);
        }
    }

    /// Says more of what is being done.
    pub fn note(&mut self, text: &str) {
        if let Some(bar) = &self.bar {
            bar.set_message(text.to_owned());
        }
    }

    /// Tells the share of the stage that is done, 0 to 1.
    pub fn share(&mut self, done: f64) {
        let Some(since) = self.since else { return };
        if self.bar.is_none() && since.elapsed() > PATIENCE {
            let bar = ProgressBar::with_draw_target(Some(STEPS), ProgressDrawTarget::stderr_with_hz(8));
            if let Ok(style) = ProgressStyle::with_template("{msg:<12} {bar:40} {percent:>3} %  {elapsed}") {
                bar.set_style(style);
            }
            bar.set_message(self.stage);
            self.bar = Some(bar);
        }
        if let Some(bar) = &self.bar {
            bar.set_position((done.clamp(0.0, 1.0) * STEPS as f64) as u64);
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
