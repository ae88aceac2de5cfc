//! How much a key may ask for: requests in a minute, uploads at a time, jobs that wait, bytes that are kept. Of those who
//! need no key each address has its own requests and uploads; what they have made counts as that of one.

use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use axum::extract::Request;
use axum::http::{HeaderMap, HeaderName, header};

use super::Caller;
use crate::extract::{is_json, media_type};
use crate::forwarded::Client;
use crate::problem::{Code, Problem};
use crate::{fetching, uploads};
use visage_domain::KeyId;
use visage_service::config::Quotas;
use visage_service::storage::Database;

/// Keys and addresses that are counted at a time.
const MOST: usize = 10_000;
/// Over which requests are counted.
const MINUTE: Duration = Duration::from_secs(60);

/// What is going on, by key.
#[derive(Debug, Default)]
pub struct Usage(Mutex<HashMap<Who, Counts>>);

/// Whose requests and uploads are counted together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Who {
    /// Those of a key.
    Key(KeyId),
    /// Those without one from an address; of IPv6 from its network of 64 bits, which is one customer's.
    Address(Option<IpAddr>),
}

impl Who {
    /// Whoever has sent a request.
    pub fn of(caller: &Caller, client: Option<&Client>) -> Who {
        let network = |address| match address {
            IpAddr::V6(address) => IpAddr::V6((address.to_bits() >> 64 << 64).into()),
            v4 => v4,
        };
        match &caller.key {
            Some(key) => Who::Key(key.id),
            None => Who::Address(client.map(|client| network(client.address))),
        }
    }

    fn key(self) -> Option<KeyId> {
        match self {
            Who::Key(key) => Some(key),
            Who::Address(_) => None,
        }
    }
}

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
    who: Who,
}

impl Drop for Uploading {
    fn drop(&mut self) {
        if let Some(counts) = self.usage.lock().get_mut(&self.who) {
            counts.uploads = counts.uploads.saturating_sub(1);
        }
    }
}

impl Usage {
    fn lock(&self) -> std::sync::MutexGuard<'_, HashMap<Who, Counts>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes one request off what a key may ask for; with how long to wait if there is none left. A minute's worth
    /// may come at once.
    fn take(&self, who: Who, per_minute: u32, now: Instant) -> Result<(), Duration> {
        let most = f64::from(per_minute);
        let mut all = self.lock();
        make_room(&mut all, now);
        let counts = all.entry(who).or_insert(Counts { left: most, since: now, uploads: 0 });
        let earned = now.saturating_duration_since(counts.since).as_secs_f64() * most / 60.0;
        counts.left = (counts.left + earned).min(most);
        counts.since = now;
        if counts.left < 1.0 {
            return Err(Duration::from_secs_f64((1.0 - counts.left) * 60.0 / most.max(1.0)));
        }
        counts.left -= 1.0;
        Ok(())
    }

    fn upload(self: &Arc<Self>, who: Who, most: usize) -> Option<Uploading> {
        let mut all = self.lock();
        let counts = all.entry(who).or_insert(Counts { left: 0.0, since: Instant::now(), uploads: 0 });
        if counts.uploads >= most {
            return None;
        }
        counts.uploads += 1;
        Some(Uploading { usage: self.clone(), who })
    }
}

/// Forgets whom it makes no difference to: after a minute everything is allowed again. If that is not enough, all but those
/// who upload: strangers by the million must not fill the memory.
fn make_room(all: &mut HashMap<Who, Counts>, now: Instant) {
    if all.len() < MOST {
        return;
    }
    all.retain(|_, counts| counts.uploads > 0 || now.saturating_duration_since(counts.since) < MINUTE);
    if all.len() >= MOST {
        all.retain(|_, counts| counts.uploads > 0);
    }
}

/// What of a request counts.
#[derive(Debug, Clone, Copy)]
pub struct Size {
    /// Whether it brings files, or has them fetched.
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
            is_upload: announced.is_some() || place == fetching::PLACE || (has_body && !is_json(&media_type(headers))),
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
    who: Who,
    size: Size,
) -> Result<Option<Uploading>, Problem> {
    let key = who.key();
    if let Some(per_minute) = quotas.requests_per_minute {
        usage.take(who, per_minute, Instant::now()).map_err(|wait| {
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
    match quotas.uploads.map(|most| (most, usage.upload(who, most))) {
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
        let [a, b] = [Who::Address(None), Who::Key(KeyId::new())];
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
        let first = usage.upload(Who::Address(None), 2).expect("there is room");
        let _second = usage.upload(Who::Address(None), 2).expect("there is room");
        assert!(usage.upload(Who::Address(None), 2).is_none());
        drop(first);
        assert!(usage.upload(Who::Address(None), 2).is_some());
    }

    #[test]
    fn addresses_by_the_million_fill_no_memory_and_an_upload_is_not_forgotten() {
        let (usage, now) = (Arc::new(Usage::default()), Instant::now());
        let _upload = usage.upload(Who::Address(None), 1).expect("there is room");
        for number in 0..3 * MOST as u32 {
            assert_eq!(usage.take(Who::Address(Some(IpAddr::from(number.to_be_bytes()))), 1, now), Ok(()));
        }
        assert!(usage.lock().len() <= MOST);
        assert!(usage.upload(Who::Address(None), 1).is_none());
        // the addresses of one network of IPv6 count together
        let from = |text: &str| {
            let client = Client::from(text.parse::<IpAddr>().expect("an address"));
            Who::of(&Caller::default(), Some(&client))
        };
        assert_eq!(from("2001:db8::1"), from("2001:db8::ffff"));
        assert_ne!(from("2001:db8::1"), from("2001:db8:0:1::1"));
    }
}
