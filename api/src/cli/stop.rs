//! Ctrl-C and the time limit.

use lacuna_kernel::budget::{CancelToken, StopReason};
use tokio::signal;

use crate::problem::Problem;

/// Fires the token on the first SIGINT or SIGTERM, so that nothing half written stays; the second ends the
/// process at once.
///
/// # Errors
/// When the system gives no signals or no thread.
pub(super) fn on_signals(token: &CancelToken) -> Result<(), Problem> {
    let token = token.clone();
    on_signals_do(move || token.fire(StopReason::Cancelled))
}

/// Does something on the first SIGINT or SIGTERM, as [`on_signals`] fires a token.
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
        tokio::select! {
            _ = signal::ctrl_c() => {}
            _ = terminate.recv() => {}
        }
    }
    #[cfg(not(unix))]
    let _ = signal::ctrl_c().await;
}
