//! Connections to the database: a few that are shared, each given back only by whoever ended well.

use std::ops::{Deref, DerefMut};
use std::str::FromStr;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio_postgres::config::SslMode;
use tokio_postgres::error::SqlState;
use tokio_postgres::{Client, Config, Connection, NoTls, Socket};
use tokio_postgres_rustls::MakeRustlsConnect;

use crate::problem::{Problem, ProblemKind};

/// Connections of one process, besides the one that listens.
const CONNECTIONS: usize = 8;

/// How long the database may take to let a connection in.
const CONNECT: Duration = Duration::from_secs(3);

/// Silence after which a connection is probed, and then given up.
const SILENCE: Duration = Duration::from_secs(10);

/// Why a question to the database has no answer.
#[derive(Debug)]
pub(super) enum Failure {
    /// The database, or the way to it.
    Database(tokio_postgres::Error),
    /// What the caller is told.
    Refused(Box<Problem>),
}

impl From<tokio_postgres::Error> for Failure {
    fn from(error: tokio_postgres::Error) -> Self {
        Self::Database(error)
    }
}

impl From<Problem> for Failure {
    fn from(problem: Problem) -> Self {
        Self::Refused(Box::new(problem))
    }
}

impl From<serde_json::Error> for Failure {
    fn from(error: serde_json::Error) -> Self {
        Problem::internal(format!("a record of the database cannot be read: {error}")).into()
    }
}

impl From<Failure> for Problem {
    /// A database that is away is no defect; one that refuses what we ask is.
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::Refused(problem) => *problem,
            Failure::Database(error) if is_away(&error) => {
                tracing::warn!(error = %words(&error), "the database is away");
                away()
            }
            Failure::Database(error) => Self::internal(format!("the database refused: {}", words(&error))),
        }
    }
}

/// What is told while the database cannot be reached.
pub(super) fn away() -> Problem {
    let detail = "The database does not answer; nothing was changed that was not confirmed, so the same request may be sent again";
    Problem::new(ProblemKind::Unavailable, detail).code("database-unreachable").retry_after(2)
}

/// The error with its causes; the database's own text is among them.
fn words(error: &tokio_postgres::Error) -> String {
    let mut text = error.to_string();
    let mut source = std::error::Error::source(error);
    while let Some(cause) = source {
        text = format!("{text}: {cause}");
        source = cause.source();
    }
    text
}

fn is_away(error: &tokio_postgres::Error) -> bool {
    let Some(state) = error.code() else {
        // Nothing that the database said: the connection broke off or was never made.
        return true;
    };
    let passing = [SqlState::TOO_MANY_CONNECTIONS, SqlState::DISK_FULL, SqlState::OUT_OF_MEMORY, SqlState::QUERY_CANCELED];
    passing.contains(state) || ["08", "57", "40"].iter().any(|class| state.code().starts_with(class))
}

/// The way to the database.
pub(super) struct Pool {
    config: Config,
    tls: Option<MakeRustlsConnect>,
    idle: Mutex<Vec<Client>>,
    places: Arc<Semaphore>,
}

impl std::fmt::Debug for Pool {
    /// Without the password.
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("Pool").field("hosts", &self.config.get_hosts()).finish_non_exhaustive()
    }
}

impl Pool {
    /// A pool by the database's address, `postgres://...`.
    pub(super) fn new(address: &str) -> Result<Self, Problem> {
        let bad = |why: String| Problem::new(ProblemKind::Usage, format!("LACUNA_DATABASE_URL cannot be used: {why}")).code("bad-setting");
        // The error of the parser does not repeat the address, which holds a password.
        let mut config = Config::from_str(address).map_err(|error| bad(words(&error)))?;
        config.application_name("lacuna").connect_timeout(CONNECT).keepalives_idle(SILENCE).tcp_user_timeout(SILENCE);
        let tls = match config.get_ssl_mode() {
            SslMode::Disable => None,
            _ => match MakeRustlsConnect::with_native_certs() {
                Ok((tls, _)) => Some(tls),
                Err(_) if config.get_ssl_mode() == SslMode::Prefer => None,
                Err(errors) => return Err(bad(format!("sslmode asks for TLS, and no certificates of authorities are found: {errors:?}"))),
            },
        };
        Ok(Self { config, tls, idle: Mutex::default(), places: Arc::new(Semaphore::new(CONNECTIONS)) })
    }

    /// A connection to ask over, and give back with [`Pooled::done`].
    pub(super) async fn get(&self) -> Result<Pooled<'_>, Failure> {
        // The semaphore lives as long as the pool, and nobody closes it.
        let place = Arc::clone(&self.places).acquire_owned().await.map_err(|error| Problem::internal(error.to_string()))?;
        let idle = std::iter::from_fn(|| crate::locked(&self.idle).pop()).find(|client| !client.is_closed());
        let client = match idle {
            Some(client) => client,
            None => self.connect().await?,
        };
        Ok(Pooled { client: Some(client), pool: self, _place: place })
    }

    async fn connect(&self) -> Result<Client, tokio_postgres::Error> {
        async fn drive<T: tokio_postgres::tls::TlsStream + Unpin>(connection: Connection<Socket, T>) {
            if let Err(error) = connection.await {
                tracing::debug!(error = %words(&error), "a connection to the database ended");
            }
        }
        match self.tls.clone() {
            Some(tls) => {
                let (client, connection) = self.config.connect(tls).await?;
                tokio::spawn(drive(connection));
                Ok(client)
            }
            None => {
                let (client, connection) = self.config.connect(NoTls).await?;
                tokio::spawn(drive(connection));
                Ok(client)
            }
        }
    }

    /// Listens to a channel until the connection breaks off; `hear` gets every payload.
    pub(super) async fn listen(
        &self,
        channel: &str,
        listening: impl FnOnce(),
        mut hear: impl FnMut(&str),
    ) -> Result<(), tokio_postgres::Error> {
        let (messages, mut heard) = tokio::sync::mpsc::unbounded_channel();
        let client = match self.tls.clone() {
            Some(tls) => {
                let (client, connection) = self.config.connect(tls).await?;
                tokio::spawn(forward(connection, messages));
                client
            }
            None => {
                let (client, connection) = self.config.connect(NoTls).await?;
                tokio::spawn(forward(connection, messages));
                client
            }
        };
        client.batch_execute(&format!("LISTEN {channel}")).await?;
        listening();
        while let Some(payload) = heard.recv().await {
            hear(&payload);
        }
        Ok(())
    }
}

/// Sends on what the database tells, until the connection ends.
async fn forward<T: tokio_postgres::tls::TlsStream + Unpin>(
    mut connection: Connection<Socket, T>,
    messages: tokio::sync::mpsc::UnboundedSender<String>,
) {
    while let Some(Ok(message)) = std::future::poll_fn(|context| connection.poll_message(context)).await {
        if let tokio_postgres::AsyncMessage::Notification(told) = message
            && messages.send(told.payload().to_owned()).is_err()
        {
            return;
        }
    }
}

/// A connection in use. One that is dropped without [`Pooled::done`] is closed: what went wrong over it may go on.
pub(super) struct Pooled<'a> {
    client: Option<Client>,
    pool: &'a Pool,
    _place: OwnedSemaphorePermit,
}

impl Pooled<'_> {
    /// Gives the connection back.
    pub(super) fn done(mut self) {
        if let Some(client) = self.client.take() {
            crate::locked(&self.pool.idle).push(client);
        }
    }
}

impl Deref for Pooled<'_> {
    type Target = Client;

    #[expect(clippy::expect_used, reason = "the client leaves in `done` alone, which consumes the guard")]
    fn deref(&self) -> &Client {
        self.client.as_ref().expect("a connection in use")
    }
}

impl DerefMut for Pooled<'_> {
    #[expect(clippy::expect_used, reason = "the client leaves in `done` alone, which consumes the guard")]
    fn deref_mut(&mut self) -> &mut Client {
        self.client.as_mut().expect("a connection in use")
    }
}
