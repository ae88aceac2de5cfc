//! How much a key may ask for: requests in a minute, uploads at a time, jobs that wait, bytes that are kept. Those
//! who need no key count as one.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use axum::extract::Request;
use axum::http::{HeaderMap, HeaderName, header};

use super::Caller;
use crate::extract::{is_json, media_type};
use crate::problem::{Code, Problem};
use crate::uploads;
use visage_domain::KeyId;
use visage_service::config::Quotas;
use visage_service::storage::Database;

/// What is going on, by key.
#[derive(Debug, Default)]
pub struct Usage(Mutex<HashMap<Option<KeyId>, Counts>>);

#[derive(Debug)]
struct Counts {
    /// Requests that may come at once.
    left: f64,
    /// As of when.
    since: Instant,
    uploads: usize,
}

/// An upload under way, counted for as long as this lives.
#[derive(Debug)]
pub struct Uploading {
    usage: Arc<Usage>,
    key: Option<KeyId>,
}

impl Drop for Uploading {
    fn drop(&mut self) {
        if let Some(counts) = self.usage.lock().get_mut(&self.key) {
            counts.uploads = counts.uploads.saturating_sub(1);
        }
    }
}

impl Usage {
    fn lock(&self) -> std::sync::MutexGuard<'_, HashMap<Option<KeyId>, Counts>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes one request off what a key may ask for; with how long to wait if there is none left. A minute's worth
    /// may come at once.
    fn take(&self, key: Option<KeyId>, per_minute: u32, now: Instant) -> Result<(), Duration> {
        let most = f64::from(per_minute);
        let mut all = self.lock();
        let counts = all.entry(key).or_insert(Counts { left: most, since: now, uploads: 0 });
        let earned = now.saturating_duration_since(counts.since).as_secs_f64() * most / 60.0;
        counts.left = (counts.left + earned).min(most);
        counts.since = now;
        if counts.left < 1.0 {
            return Err(Duration::from_secs_f64((1.0 - counts.left) * 60.0 / most.max(1.0)));
        }
        counts.left -= 1.0;
        Ok(())
    }

    fn upload(self: &Arc<Self>, key: Option<KeyId>, most: usize) -> Option<Uploading> {
        let mut all = self.lock();
        let counts = all.entry(key).or_insert(Counts { left: 0.0, since: Instant::now(), uploads: 0 });
        if counts.uploads >= most {
            return None;
        }
        counts.uploads += 1;
        Some(Uploading { usage: self.clone(), key })
    }
}

/// What of a request counts.
#[derive(Debug, Clone, Copy)]
pub struct Size {
    /// Whether it brings files.
    is_upload: bool,
    /// How many bytes it brings, as far as it says.
    bytes: u64,
    /// Whether it orders a job.
    is_job: bool,
}

impl Size {
    /// By its place and its headers; nothing of the body is read.
    pub fn of(request: &Request, place: &str) -> Size {
        let headers: &HeaderMap = request.headers();
        let number = |name| headers.get(name).and_then(|value| value.to_str().ok()?.parse().ok());
        let length = number(header::CONTENT_LENGTH);
        let is_begun = request.method() == "POST" && place == uploads::OF_SET;
        let announced = number(HeaderName::from_static("upload-length")).filter(|_| is_begun);
        let has_body = length.is_some_and(|length: u64| length > 0) || headers.contains_key(header::TRANSFER_ENCODING);
        Size {
            is_upload: announced.is_some() || (has_body && !is_json(&media_type(headers))),
            // what comes piece by piece counts as a whole from its beginning
            bytes: announced.or(length.filter(|_| place != uploads::ONE)).unwrap_or(0),
            is_job: request.method() == "POST"
                && matches!(place, "/v1/jobs" | "/v1/jobs/upload" | "/v1/jobs/{id}/retry"),
        }
    }
}

/// Whether a key may ask for this now; what is answered has to be kept until it is done.
pub async fn admitted(
    quotas: &Quotas,
    usage: &Arc<Usage>,
    database: &dyn Database,
    caller: &Caller,
    size: Size,
) -> Result<Option<Uploading>, Problem> {
    let key = caller.key.as_ref().map(|key| key.id);
    if let Some(per_minute) = quotas.requests_per_minute {
        usage.take(key, per_minute, Instant::now()).map_err(|wait| {
            let detail = format!("{per_minute} requests a minute are allowed, and these are used up");
            Problem::new(Code::RateLimited, detail, "ask less often: wait for jobs with ?wait, or follow their events")
                .retry_after(wait.as_secs_f64().ceil() as u64)
        })?;
    }
    if let Some(most) = quotas.queued_jobs.filter(|_| size.is_job) {
        let waiting = database.jobs_waiting_of(key).await?;
        if waiting >= most {
            let detail = format!("{waiting} jobs of this key wait or run, {most} may");
            return Err(
                Problem::new(Code::QuotaExceeded, detail, "wait for some to end, or cancel some").retry_after(10)
            );
        }
    }
    if !size.is_upload {
        return Ok(None);
    }
    if let Some(most) = quotas.stored_bytes {
        let stored = database.bytes_stored_of(key).await?;
        if stored.saturating_add(size.bytes) > most {
            let detail = format!(
                "{stored} bytes of this key are kept, with these {} there would be more than {most}",
                size.bytes
            );
            let hint = "delete what is not needed any more, or ask the operator for more";
            return Err(Problem::new(Code::QuotaExceeded, detail, hint).retry_after(60));
        }
    }
    match quotas.uploads.map(|most| (most, usage.upload(key, most))) {
        Some((most, None)) => {
            let detail = format!("{most} uploads at a time are allowed, and so many are under way");
            Err(Problem::new(Code::RateLimited, detail, "wait until one of them has ended").retry_after(1))
        }
        Some((_, uploading)) => Ok(uploading),
        None => Ok(None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_come_back_with_time_and_each_key_has_its_own() {
        let (usage, begin) = (Usage::default(), Instant::now());
        let [a, b] = [None, Some(KeyId::new())];
        for _ in 0..60 {
            assert_eq!(usage.take(a, 60, begin), Ok(()));
        }
        let wait = usage.take(a, 60, begin).expect_err("used up");
        assert!((0.9..=1.0).contains(&wait.as_secs_f64()), "{wait:?}");
        assert_eq!(usage.take(b, 60, begin), Ok(()));
        assert!(usage.take(a, 60, begin + Duration::from_millis(1100)).is_ok());
        assert!(usage.take(a, 60, begin + Duration::from_millis(1200)).is_err());
        // a clock that went back gives nothing
        assert!(usage.take(a, 60, begin).is_err());
        // not more than a minute's worth, however long nobody asked
        let later = begin + Duration::from_secs(3600);
        assert_eq!((0..100).filter(|_| usage.take(a, 60, later).is_ok()).count(), 60);
    }

    #[test]
    fn uploads_count_until_they_are_dropped() {
        let usage = Arc::new(Usage::default());
        let first = usage.upload(None, 2).expect("there is room");
        let _second = usage.upload(None, 2).expect("there is room");
        assert!(usage.upload(None, 2).is_none());
        drop(first);
        assert!(usage.upload(None, 2).is_some());
    }
}
