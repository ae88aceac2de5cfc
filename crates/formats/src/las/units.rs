//! The unit of a LAS file's coordinates, as its coordinate system says.

use super::header::Header;
use crate::{DeclaredUnit, FormatError};

const PROJECTION: &str = "LASF_Projection";
/// Records with keys of GeoTIFF, and with well-known text.
const GEO_KEYS: u16 = 34735;
const TEXT: u16 = 2112;
/// Keys of GeoTIFF: the kind of the system, the unit of a projected one.
const KIND: u16 = 1024;
const PROJECTED_UNIT: u16 = 3076;
const GEOGRAPHIC: u16 = 2;
/// Radians in a degree, by which a unit of angles is known.
const DEGREE: f64 = std::f64::consts::PI / 180.0;

const INTERNATIONAL_FOOT: DeclaredUnit = DeclaredUnit { metres: 0.3048 };
const SURVEY_FOOT: DeclaredUnit = DeclaredUnit { metres: 1200.0 / 3937.0 };

/// The unit that the file declares; `None` where it says nothing.
///
/// # Errors
/// [`FormatError::Malformed`] for a geographic system: degrees are no coordinates of a shape.
pub(super) fn declared(bytes: &[u8], header: &Header) -> Result<Option<DeclaredUnit>, FormatError> {
    if let Some(text) = header.record_of(bytes, PROJECTION, TEXT) {
        return of_text(&String::from_utf8_lossy(text));
    }
    match header.record_of(bytes, PROJECTION, GEO_KEYS) {
        Some(keys) => of_keys(keys),
        None => Ok(None),
    }
}

fn degrees() -> FormatError {
    let remedy = "project it into metres (`pdal translate` with filters.reprojection)";
    FormatError::malformed("the coordinate system", "coordinates are longitudes and latitudes", remedy)
}

fn of_keys(keys: &[u8]) -> Result<Option<DeclaredUnit>, FormatError> {
    let numbers: Vec<u16> = keys.chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect();
    let value = |wanted: u16| numbers.chunks_exact(4).skip(1).find(|key| key[0] == wanted).map(|key| key[3]);
    if value(KIND) == Some(GEOGRAPHIC) {
        return Err(degrees());
    }
    Ok(match value(PROJECTED_UNIT) {
        Some(9001) => Some(DeclaredUnit::METRE),
        Some(9002) => Some(INTERNATIONAL_FOOT),
        Some(9003) => Some(SURVEY_FOOT),
        _ => None,
    })
}

/// By well-known text, old or new: the last unit of lengths before the heights are spoken of.
fn of_text(text: &str) -> Result<Option<DeclaredUnit>, FormatError> {
    let upper = text.to_ascii_uppercase();
    let horizontal = ["VERT_CS", "VERTCRS", "VERTICALCRS"].iter().filter_map(|word| upper.find(word)).min();
    let upper = &upper[..horizontal.unwrap_or(upper.len())];
    let has = |words: &[&str]| words.iter().any(|word| upper.contains(word));
    if has(&["GEOGCS[", "GEOGCRS[", "GEOGRAPHICCRS[", "GEODCRS["]) && !has(&["PROJCS[", "PROJCRS[", "PROJECTEDCRS["]) {
        return Err(degrees());
    }
    let units = upper.match_indices("UNIT[").filter_map(|(at, word)| {
        let inside = &upper[at + word.len()..];
        let (_, behind) = inside.strip_prefix('"')?.split_once('"')?;
        let number = behind.trim_start_matches([',', ' ']);
        let end = number.find([',', ']']).unwrap_or(number.len());
        number[..end].trim().parse::<f64>().ok()
    });
    let lengths = units.filter(|metres| *metres > 0.0 && (metres / DEGREE - 1.0).abs() > 1e-3 && metres.is_finite());
    Ok(lengths.last().map(|metres| DeclaredUnit { metres }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_and_keys_say_the_unit() {
        let unit = |text: &str| of_text(text).expect("a projection").map(|unit| unit.metres);
        let geographic =
            r#"GEOGCS["WGS 84",DATUM["D",SPHEROID["S",6378137,298.25]],UNIT["degree",0.0174532925199433]]"#;
        assert_eq!(
            unit(&format!(r#"PROJCS["UTM 33N",{geographic},UNIT["metre",1,AUTHORITY["EPSG","9001"]]]"#)),
            Some(1.0)
        );
        let feet = format!(
            r#"COMPD_CS["x",PROJCS["y",{geographic},UNIT["US survey foot",0.3048006096012192]],VERT_CS["h",UNIT["metre",1]]]"#
        );
        assert_eq!(unit(&feet), Some(0.3048006096012192));
        let recent = r#"PROJCRS["x",BASEGEOGCRS["y",ANGLEUNIT["degree",0.0174532925199433]],CS[Cartesian,2],LENGTHUNIT["metre",1]]"#;
        assert_eq!((unit(recent), unit("LOCAL_CS[\"x\"]")), (Some(1.0), None));
        assert!(of_text(geographic).is_err());
        let keys = |keys: &[[u16; 4]]| keys.iter().flatten().flat_map(|key| key.to_le_bytes()).collect::<Vec<u8>>();
        let foot = keys(&[[1, 1, 0, 2], [1024, 0, 1, 1], [3076, 0, 1, 9002]]);
        assert_eq!(of_keys(&foot), Ok(Some(INTERNATIONAL_FOOT)));
        let error = of_keys(&keys(&[[1, 1, 0, 1], [1024, 0, 1, 2]])).expect_err("degrees").to_string();
        assert!(error.contains("coordinates are longitudes and latitudes; project it into metres"), "{error}");
    }
}
