//! Whom this program trusts when it is a client.

use std::sync::Arc;

use ureq::tls::{RootCerts, TlsConfig};

/// Whom the machine trusts; `SSL_CERT_FILE` names authorities of one's own.
#[must_use]
pub fn tls() -> TlsConfig {
    TlsConfig::builder()
        .root_certs(RootCerts::PlatformVerifier)
        .unversioned_rustls_crypto_provider(Arc::new(rustls::crypto::ring::default_provider()))
        .build()
}
