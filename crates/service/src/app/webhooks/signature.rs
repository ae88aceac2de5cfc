//! How a message shows that it is from here and when it was sent: the scheme of Standard Webhooks, HMAC-SHA-256 over
//! id, time and body.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use hmac::{Hmac, KeyInit, Mac};
use sha2::Sha256;
use visage_domain::WebhookSecret;

/// A secret as it is given to its owner, once.
pub fn written(secret: &WebhookSecret) -> String {
    format!("whsec_{}", STANDARD.encode(secret.0))
}

/// The header `webhook-signature` of a message that is sent at this time, in seconds since 1970.
pub(super) fn signature(secret: &WebhookSecret, id: &str, seconds: i64, body: &str) -> String {
    // keys of any length are taken; this one has 32 bytes
    let Ok(mut mac) = Hmac::<Sha256>::new_from_slice(&secret.0) else { return String::new() };
    mac.update(format!("{id}.{seconds}.").as_bytes());
    mac.update(body.as_bytes());
    format!("v1,{}", STANDARD.encode(mac.finalize().into_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As computed by `openssl dgst -sha256 -mac HMAC`.
    #[test]
    fn a_signature_is_what_others_compute() {
        let secret = WebhookSecret(*b"0123456789abcdef0123456789abcdef");
        assert_eq!(written(&secret), "whsec_MDEyMzQ1Njc4OWFiY2RlZjAxMjM0NTY3ODlhYmNkZWY=");
        let signed = signature(&secret, "msg_1", 1_614_265_330, r#"{"test": 2432232314}"#);
        assert_eq!(signed, "v1,aTF4+pE6A/FmvKM0YSVBBUfRhLIlBiaBUR+EjGls6Mc=");
    }
}
