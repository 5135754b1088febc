//! The trusted certificates: those of this machine, or those of `--ca-file`. Verification cannot be switched off.

use anyhow::{Context, Result, bail};
use rumqttc::Transport;
use std::path::Path;
use ureq::tls::{Certificate, PemItem, RootCerts, TlsConfig, parse_pem};

/// Reads `--ca-file`.
///
/// # Errors
/// A missing file, or a file without a certificate.
pub fn read(path: impl AsRef<Path>) -> Result<Vec<u8>> {
    let path = path.as_ref();
    let shown = path.display();
    let pem = resight::input::read(path, resight::input::Kind::Secret).context("--ca-file")?;
    if certificates(&pem).is_empty() {
        bail!(
            "--ca-file {shown}: there is no certificate in it; PEM is needed (-----BEGIN CERTIFICATE-----)"
        );
    }
    Ok(pem)
}

fn certificates(pem: &[u8]) -> Vec<Certificate<'static>> {
    let certificate = |item| match item {
        Ok(PemItem::Certificate(certificate)) => Some(certificate),
        _ => None,
    };
    parse_pem(pem).filter_map(certificate).collect()
}

/// Returns the settings of the webhook. A machine without certificates of its own trusts the public authorities.
pub fn of_webhook(ca: Option<&[u8]>) -> TlsConfig {
    let known = match ca {
        Some(pem) => certificates(pem),
        None => {
            let found = rustls_native_certs::load_native_certs().certs;
            found.iter().map(|der| Certificate::from_der(der).to_owned()).collect()
        }
    };
    let roots = if known.is_empty() { RootCerts::WebPki } else { RootCerts::new_with_certs(&known) };
    TlsConfig::builder().root_certs(roots).build()
}

/// Returns the settings of `mqtts`.
///
/// # Errors
/// The machine's certificates cannot be read.
pub fn of_mqtt(ca: Option<&[u8]>) -> Result<Transport> {
    match ca {
        Some(pem) => Ok(Transport::tls(pem.to_vec(), None, None)),
        None => Transport::try_tls_with_default_config()
            .context("the certificates of this machine; give --ca-file"),
    }
}
