//! Ctrl-C, the wish of the system, and a terminal that is closed.

use lacuna_kernel::budget::{CancelToken, StopReason};
use tokio::signal;

use crate::problem::Problem;

/// Fires the token on the first SIGINT, SIGTERM or SIGHUP, so that nothing half written stays; the second ends the
/// process at once.
///
/// # Errors
/// When the system gives no signals or no thread.
pub(super) fn on_signals(token: &CancelToken) -> Result<(), Problem> {
    let token = token.clone();
    on_signals_do(move || token.fire(StopReason::Cancelled))
}

/// Does something on the first of these signals, as [`on_signals`] fires a token.
///
/// # Errors
/// As [`on_signals`].
pub(super) fn on_signals_do(act: impl FnOnce() + Send + 'static) -> Result<(), Problem> {
    let failed = |error| Problem::io("signals cannot be watched", &error);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().build().map_err(failed)?;
    let watch = move || {
        runtime.block_on(async {
            asked().await;
            act();
            asked().await;
        });
        std::process::exit(130);
    };
    std::thread::Builder::new().name("signals".into()).spawn(watch).map(drop).map_err(failed)
}

/// Waits until the user or the system asks the process to end.
pub(super) async fn asked() {
    #[cfg(unix)]
    {
        let Ok(mut terminate) = signal::unix::signal(signal::unix::SignalKind::terminate()) else {
            return std::future::pending().await;
        };
        let hangup = async {
            if !outlives_its_terminal()
                && let Ok(mut hangup) = signal::unix::signal(signal::unix::SignalKind::hangup())
            {
                hangup.recv().await
            } else {
                std::future::pending().await
            }
        };
        tokio::select! {
            _ = signal::ctrl_c() => {}
            _ = terminate.recv() => {}
            _ = hangup => {}
        }
    }
    #[cfg(not(unix))]
    let _ = signal::ctrl_c().await;
}

/// Whether whoever started the process had it ignore that its terminal is closed, as `nohup` does. Where the system does not tell, it is not so.
#[cfg(unix)]
fn outlives_its_terminal() -> bool {
    static IGNORED: std::sync::OnceLock<bool> = std::sync::OnceLock::new();
    *IGNORED.get_or_init(|| {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
        // SIGHUP is the first signal.
        mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).is_some_and(|mask| mask & 1 == 1)
    })
}
