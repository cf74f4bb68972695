//! Progress on stderr: a bar for people, lines for programs.

use std::io::{IsTerminal, Write};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use lacuna_kernel::budget::{Progress, ProgressSink};

use super::args::ProgressMode;

/// Redrawing more often than this only costs time.
const EVERY: Duration = Duration::from_millis(80);

/// Tells progress and takes the bar away at the end.
pub(super) struct Reporter {
    sink: Option<ProgressSink>,
    bar: bool,
}

impl Reporter {
    /// A reporter as the user asked for.
    pub(super) fn new(mode: ProgressMode, quiet: bool) -> Self {
        let bar = match mode {
            ProgressMode::Auto => std::io::stderr().is_terminal(),
            ProgressMode::Bar => true,
            ProgressMode::Json | ProgressMode::None => false,
        };
        let sink = match mode {
            _ if quiet => None,
            ProgressMode::Json => Some(throttled(json_line)),
            _ if bar => Some(throttled(bar_line)),
            _ => None,
        };
        Self { bar: bar && sink.is_some(), sink }
    }

    /// What the kernel tells.
    pub(super) fn sink(&self) -> Option<ProgressSink> {
        self.sink.clone()
    }
}

impl Drop for Reporter {
    fn drop(&mut self) {
        if self.bar {
            let _ = write!(std::io::stderr().lock(), "\r\x1b[K");
        }
    }
}

/// Passes on the first and the last of every phase and some between.
fn throttled(line: fn(&Progress, Duration) -> String) -> ProgressSink {
    let start = Instant::now();
    let last: Mutex<(Option<Instant>, &'static str)> = Mutex::new((None, ""));
    Arc::new(move |progress: &Progress| {
        let mut last = crate::locked(&last);
        let soon = last.0.is_some_and(|last| last.elapsed() < EVERY);
        if soon && last.1 == progress.phase && progress.fraction < 1.0 {
            return;
        }
        *last = (Some(Instant::now()), progress.phase);
        let mut stderr = std::io::stderr().lock();
        // A terminal that went away is no reason to stop the work.
        let _ = stderr.write_all(line(progress, start.elapsed()).as_bytes()).and_then(|()| stderr.flush());
    })
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to [0, 24]")]
fn bar_line(progress: &Progress, elapsed: Duration) -> String {
    const WIDTH: usize = 24;
    let fraction = progress.fraction.clamp(0.0, 1.0);
    let filled = (fraction * WIDTH as f64) as usize;
    let bar = format!("{}{}", "#".repeat(filled), "-".repeat(WIDTH - filled));
    let (phase, count) = (progress.phase, progress.count);
    let bound = progress.bound_mm.map(|bound| format!("  within {bound:.3e} mm")).unwrap_or_default();
    format!("\r\x1b[K{phase:>9} [{bar}] {:3.0} %  {count}{bound}  {:.1} s", fraction * 100.0, elapsed.as_secs_f64())
}

fn json_line(progress: &Progress, elapsed: Duration) -> String {
    let mut value = serde_json::json!({
        "phase": progress.phase, "fraction": progress.fraction, "count": progress.count, "elapsed_s": elapsed.as_secs_f64(),
    });
    if let Some(bound_mm) = progress.bound_mm {
        value["bound_mm"] = bound_mm.into();
    }
    format!("{value}\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_say_phase_share_and_count() {
        let progress = Progress { phase: "dilate", fraction: 0.5, count: 12, bound_mm: None };
        let bar = bar_line(&progress, Duration::from_secs(2));
        assert!(bar.contains("dilate") && bar.contains("############------------") && bar.contains("50 %") && bar.contains("12"));
        assert!(!bar.contains("within") && !json_line(&progress, Duration::ZERO).contains("bound_mm"), "nothing is proven yet");
        let proven = Progress { bound_mm: Some(0.125), ..progress };
        assert!(bar_line(&proven, Duration::ZERO).contains("within 1.250e-1 mm"));
        let line = json_line(&proven, Duration::ZERO);
        assert!(line.contains(r#""bound_mm":0.125"#) && line.ends_with("}\n"), "{line}");
        assert!(bar_line(&Progress { phase: "x", fraction: 7.0, count: 0, bound_mm: None }, Duration::ZERO).contains("100 %"));
    }
}
