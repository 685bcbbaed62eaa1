//! Watching a run from outside: Ctrl-C stops it at the next step, a bar shows how far it is.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use signal_hook::consts::SIGINT;
use signal_hook::flag;
use std::io::{self, IsTerminal};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

static STOP: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// Runs shorter than this show no bar.
const PATIENCE: Duration = Duration::from_secs(1);

/// The bar counts in thousandths.
const PARTS: f64 = 1000.0;

/// The flag that Ctrl-C raises from now on; a second Ctrl-C ends the program at once.
pub fn stop_flag() -> Arc<AtomicBool> {
    let raise = || {
        let flag = Arc::new(AtomicBool::new(false));
        let interrupted = super::session::Exit::Interrupted as i32;
        // Without handlers Ctrl-C ends the program, which is no worse than before. The first asks for the flag that the
        // second raises.
        let _ = flag::register_conditional_shutdown(SIGINT, interrupted, flag.clone());
        let _ = flag::register(SIGINT, flag.clone());
        flag
    };
    STOP.get_or_init(raise).clone()
}

/// A bar on stderr, for a run that takes its time, on a terminal.
pub struct Bar {
    begun: Instant,
    bar: OnceLock<ProgressBar>,
}

impl Bar {
    /// A bar that is not shown yet; `None` where it would disturb.
    pub fn new(quiet: bool) -> Option<Arc<Bar>> {
        let wanted = io::stderr().is_terminal() && !quiet;
        wanted.then(|| Arc::new(Bar { begun: Instant::now(), bar: OnceLock::new() }))
    }

    /// Shows the part of the run that is done, 0 to 1.
    pub fn show(&self, part: f64) {
        if self.begun.elapsed() < PATIENCE {
            return;
        }
        let bar = self.bar.get_or_init(|| {
            let target = ProgressDrawTarget::stderr_with_hz(10);
            let bar = ProgressBar::with_draw_target(Some(PARTS as u64), target);
            match ProgressStyle::with_template("{wide_bar} {percent}% {eta}") {
                Ok(style) => bar.with_style(style),
                Err(_) => bar,
            }
        });
        bar.set_position((part * PARTS) as u64);
    }

    /// Takes the bar away.
    pub fn clear(&self) {
        if let Some(bar) = self.bar.get() {
            bar.finish_and_clear();
        }
    }
}
