//! The running service: listening, serving, and going down in order.

use std::convert::Infallible;
use std::future::Future;
use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::Router;
use axum::body::Body;
use hyper::body::Incoming;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::server::graceful::GracefulShutdown;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::OwnedSemaphorePermit;
use tower::ServiceExt;

use super::connection::{Connection, Patience};
use super::router::{operation, probes, router};
use super::state::{AppState, Shared};
use crate::config::Config;
use crate::jobs::desk::Retention;
use crate::jobs::worker;
use crate::problem::Problem;
use crate::traces;

/// Time for answers that are under way when the time for jobs is over.
const LAST_ANSWERS: Duration = Duration::from_secs(1);

/// Time for which a closed connection takes what its peer still sends.
const LINGERING: Duration = Duration::from_secs(30);

/// A peer of a closed connection that has sent nothing for so long has sent all.
const SILENT: Duration = Duration::from_secs(2);

/// Between two sweeps of what is too old to keep.
const SWEEP_EVERY: Duration = Duration::from_secs(3600);

/// Listens and serves until `stop` is ready; `told` gets the address once it is known.
///
/// # Errors
/// When the address or the data folder cannot be used.
pub async fn serve(config: Config, told: impl FnOnce(std::net::SocketAddr), stop: impl Future<Output = ()>) -> Result<(), Problem> {
    let failed = |error| Problem::io(format!("cannot listen on {}", config.bind), &error);
    let listener = TcpListener::bind(config.bind).await.map_err(failed)?;
    let address = listener.local_addr().map_err(failed)?;
    let watched = match config.metrics_bind {
        Some(place) => {
            let failed = |error| Problem::io(format!("cannot listen on {place} (LACUNA_METRICS_BIND)"), &error);
            Some(TcpListener::bind(place).await.map_err(failed)?)
        }
        None => None,
    };
    let state = AppState::open(config).await?;
    let count = if state.config.role.works() { state.config.workers } else { 0 };
    let workers = worker::start(&state.desk, count, state.config.job_limits, state.engine)
        .map_err(|error| Problem::io("no threads for the workers", &error))?;
    let sweeper = tokio::spawn(sweep(state.clone()));
    told(address);
    tracing::info!(%address, role = %state.config.role, workers = count, "serving");

    let connections = GracefulShutdown::new();
    let app = if state.config.role.answers() { router(state.clone()) } else { probes(state.clone()) };
    // Whoever looks after the service sees it go down, too: this address is answered until the end.
    if let Some(watched) = watched {
        if let Ok(address) = watched.local_addr() {
            tracing::info!(%address, "probes and metrics");
        }
        let (app, state) = (operation(state.clone()), state.clone());
        tokio::spawn(async move { accept(&watched, app, &state, None).await });
    }
    tokio::select! {
        () = accept(&listener, app.clone(), &state, Some(&connections)) => {}
        () = stop => {}
    }
    // In this order: not ready and no new work, open streams end, running jobs are finished, then answers under way.
    tracing::info!("going down");
    state.desk.stop();
    state.closing.send_replace(true);
    sweeper.abort();
    let drain = Duration::from_secs(state.config.drain_seconds);
    let desk = Arc::clone(&state.desk);
    let start = Instant::now();
    let drained = tokio::task::spawn_blocking(move || end_workers(&desk, workers, drain));
    // Until jobs have ended, who calls anew is told that the service is not ready, or how a job is, instead of being turned away.
    tokio::select! {
        () = accept(&listener, app, &state, Some(&connections)) => {}
        _ = drained => {}
    }
    drop(listener);
    let left = drain.saturating_sub(start.elapsed()).max(LAST_ANSWERS);
    let _ = tokio::time::timeout(left, connections.shutdown()).await;
    let _ = tokio::task::spawn_blocking(traces::finish).await;
    tracing::info!("down");
    Ok(())
}

async fn accept(listener: &TcpListener, app: Router, state: &Shared, connections: Option<&GracefulShutdown>) {
    loop {
        // Who looks after the service is not counted: its address is answered however many others there are.
        let place = if connections.is_some() { place(state).await } else { None };
        match listener.accept().await {
            Ok((stream, _)) => attend(stream, app.clone(), state, connections, place),
            Err(error) => {
                // Out of descriptors, most likely: wait for connections to end instead of spinning.
                tracing::warn!(%error, "a connection was not accepted");
                tokio::time::sleep(Duration::from_millis(100)).await;
            }
        }
    }
}

/// A place for one more connection. Who comes when all are taken waits, at the listening socket, until one ends.
async fn place(state: &Shared) -> Option<OwnedSemaphorePermit> {
    if state.connections.available_permits() == 0 {
        tracing::warn!(connections = state.config.connections, "all connections are taken (LACUNA_CONNECTIONS), others wait");
    }
    Arc::clone(&state.connections).acquire_owned().await.ok()
}

/// Answers a connection, which has its place until it ends; those that are counted are waited for when the service goes down.
fn attend(stream: TcpStream, app: Router, state: &Shared, connections: Option<&GracefulShutdown>, place: Option<OwnedSemaphorePermit>) {
    let _ = stream.set_nodelay(true);
    let service = service_fn(move |request: hyper::Request<Incoming>| {
        let app = app.clone();
        async move {
            let answer = app.oneshot(request.map(Body::new)).await;
            Ok::<_, Infallible>(answer.unwrap_or_else(|never| match never {}))
        }
    });
    let mut builder = hyper::server::conn::http1::Builder::new();
    // A client that sends its head byte by byte would hold a connection forever.
    builder.timer(TokioTimer::new()).header_read_timeout(Duration::from_secs(state.config.header_seconds));
    let patience = Patience { stalled: Duration::from_secs(state.config.body_seconds), lingering: LINGERING, silent: SILENT };
    let stream = Connection::new(stream, patience);
    let connection = builder.serve_connection(TokioIo::new(stream), service);
    let told = move |ended: hyper::Result<()>| {
        drop(place);
        if let Err(error) = ended {
            tracing::debug!(%error, "a connection broke off");
        }
    };
    match connections {
        Some(connections) => {
            let connection = connections.watch(connection);
            tokio::spawn(async move { told(connection.await) });
        }
        None => {
            tokio::spawn(async move { told(connection.await) });
        }
    }
}

/// Waits for running jobs, then stops them: they are taken up again at the next start.
fn end_workers(desk: &crate::jobs::desk::Desk, workers: Vec<std::thread::JoinHandle<()>>, drain: Duration) {
    let start = std::time::Instant::now();
    while start.elapsed() < drain && workers.iter().any(|worker| !worker.is_finished()) {
        std::thread::sleep(Duration::from_millis(20));
    }
    desk.interrupt();
    for worker in workers {
        let _ = worker.join();
    }
}

async fn sweep(state: Shared) {
    let hours = |hours: u64| Duration::from_secs(hours.saturating_mul(3600));
    let age = hours(state.config.retention_hours);
    let retention = Retention { jobs: age, records: hours(state.config.expired_hours), most_records: state.config.expired_jobs };
    loop {
        match state.beside(None, move |state| state.desk.sweep(retention)).await {
            Ok(removed) => tracing::info!(removed, "swept"),
            Err(problem) => tracing::error!(detail = %problem.detail, "not swept"),
        }
        // A job that waits may be the only one that still needs a file.
        let idle = state.desk.gauges().await.is_ok_and(|gauges| gauges.queued + gauges.running == 0);
        let uploads = state.beside(None, move |state| {
            let swept = if idle { state.store.sweep_uploads(age) } else { Ok(0) };
            swept.map_err(|error| Problem::io("sweeping uploads", &error))
        });
        match uploads.await {
            Ok(removed) => tracing::info!(removed, "uploads swept"),
            Err(problem) => tracing::error!(detail = %problem.detail, "uploads not swept"),
        }
        tokio::time::sleep(SWEEP_EVERY).await;
    }
}
