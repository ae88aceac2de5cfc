//! `Accept` (RFC 9110, section 12.5.1): which of the formats of a resource a client wants.

use axum::http::{HeaderMap, header};

use super::problem::{Code, Problem};

/// A format on offer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Offer<T> {
    /// How its files end, which is how a client names it.
    pub ending: &'static str,
    /// Media types that mean it.
    pub media_types: &'static [&'static str],
    /// What it is.
    pub what: T,
}

/// A format that was chosen, with the media type that it was asked for by; `None` if that of any bytes will do.
pub type Chosen<T> = (T, Option<&'static str>);

/// Chooses what `format` names, else what `Accept` prefers, else the first offer.
///
/// # Errors
/// 422 for a name that is none of the offers, 406 if nothing on offer is accepted; both list the offers.
pub fn choose<T: Copy>(offers: &[Offer<T>], format: Option<&str>, headers: &HeaderMap) -> Result<Chosen<T>, Problem> {
    if let Some(name) = format {
        let found = offers.iter().find(|offer| offer.ending == name);
        return found.map(|offer| (offer.what, None)).ok_or_else(|| {
            let shown: String = name.chars().take(64).collect();
            Problem::new(Code::InvalidField, format!("format is {shown:?}"), format!("give one of {}", list(offers)))
        });
    }
    let ranges: Vec<Range> =
        headers.get_all(header::ACCEPT).iter().filter_map(|value| value.to_str().ok()).flat_map(ranges).collect();
    let Some(first) = offers.first() else { return Err(Problem::internal("nothing is on offer")) };
    if ranges.is_empty() {
        return Ok((first.what, None));
    }
    // that of any bytes is what is sent unasked: it means the first offer
    let unasked = (first, quality(&ranges, "application/octet-stream"), None);
    let of_types = offers.iter().flat_map(|offer| offer.media_types.iter().map(move |kind| (offer, *kind)));
    let by_type = of_types.map(|(offer, kind)| (offer, quality(&ranges, kind), Some(kind)));
    let mut best: Option<(&Offer<T>, f32, Option<&'static str>)> = None;
    for (offer, quality, kind) in std::iter::once(unasked).chain(by_type) {
        if quality > best.map_or(0.0, |(_, best, _)| best) {
            best = Some((offer, quality, kind));
        }
    }
    best.map(|(offer, _, kind)| (offer.what, kind)).ok_or_else(|| {
        let types: Vec<&str> = offers.iter().flat_map(|offer| offer.media_types).copied().collect();
        let hint = format!(
            "accept application/octet-stream and give format as one of {}, or accept one of {}",
            list(offers),
            types.join(", ")
        );
        Problem::new(Code::NotAcceptable, "none of the media types in Accept is offered", hint)
    })
}

fn list<T>(offers: &[Offer<T>]) -> String {
    offers.iter().map(|offer| offer.ending).collect::<Vec<_>>().join(", ")
}

/// A media range and how much it is wanted.
struct Range {
    kind: String,
    quality: f32,
}

/// The ranges of a header; what can't be read of it asks for nothing.
fn ranges(value: &str) -> impl Iterator<Item = Range> {
    value.split(',').filter_map(|range| {
        let mut parts = range.split(';').map(str::trim);
        let kind = parts.next()?.to_ascii_lowercase();
        let quality = parts.find_map(|part| part.strip_prefix("q=").or_else(|| part.strip_prefix("Q=")));
        let quality = quality.map_or(Some(1.0), |text| text.parse::<f32>().ok().filter(|q| (0.0..=1.0).contains(q)))?;
        kind.contains('/').then_some(Range { kind, quality })
    })
}

/// How much a media type is wanted: as the closest range says.
fn quality(ranges: &[Range], kind: &str) -> f32 {
    let whole = kind.split_once('/').map_or(String::new(), |(family, _)| format!("{family}/*"));
    let of = |name: &str| ranges.iter().find(|range| range.kind == name).map(|range| range.quality);
    of(kind).or_else(|| of(&whole)).or_else(|| of("*/*")).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const OFFERS: &[Offer<u8>] = &[
        Offer { ending: "ply", media_types: &["model/ply"], what: 0 },
        Offer { ending: "glb", media_types: &["model/gltf-binary"], what: 1 },
        Offer { ending: "las", media_types: &["application/vnd.las"], what: 2 },
    ];

    fn of(format: Option<&str>, accept: &[&'static str]) -> Result<Chosen<u8>, Code> {
        let mut headers = HeaderMap::new();
        for value in accept {
            headers.append(header::ACCEPT, value.parse().expect("a header"));
        }
        choose(OFFERS, format, &headers).map_err(|problem| problem.code())
    }

    #[test]
    fn what_is_wanted_most_is_chosen() {
        assert_eq!(of(None, &[]), Ok((0, None)));
        assert_eq!(of(None, &["*/*"]), Ok((0, None)));
        assert_eq!(of(None, &["model/gltf-binary"]), Ok((1, Some("model/gltf-binary"))));
        assert_eq!(
            of(None, &["text/html, application/*;q=0.5", "Model/GLTF-binary;q=0.9"]),
            Ok((1, Some("model/gltf-binary")))
        );
        assert_eq!(of(None, &["application/vnd.las;q=0.2, */*;q=0.1"]), Ok((2, Some("application/vnd.las"))));
        assert_eq!(of(None, &["model/*"]), Ok((0, Some("model/ply"))));
        assert_eq!(of(None, &["application/octet-stream, model/gltf-binary;q=0.9"]), Ok((0, None)));
        assert_eq!(of(Some("las"), &["text/html"]), Ok((2, None)), "a name says it all");
    }

    #[test]
    fn what_is_not_offered_is_refused() {
        assert_eq!(of(None, &["text/html"]), Err(Code::NotAcceptable));
        assert_eq!(of(None, &["model/gltf-binary;q=0, model/x"]), Err(Code::NotAcceptable));
        assert_eq!(of(Some("doc"), &[]), Err(Code::InvalidField));
        // nothing that can be read: as if there were none
        assert_eq!(of(None, &["what", "a/b;q=7"]), Ok((0, None)));
    }
}
