//! Names that users give. They are shown and compared, never used as paths; still, nothing odd comes in.

use super::problem::{Code, Problem};
use visage_formats::Format;
use visage_geometry::names::UnknownName;

/// The longest file name, in bytes: what file systems allow.
const LONGEST_FILE_NAME: usize = 255;
/// The longest name or label of a scan set, job or model, in characters.
const LONGEST_TEXT: usize = 200;

/// A plain file name: no folders, no control characters.
pub fn file_name(name: &str) -> Result<String, Problem> {
    let refused = |why: &str| {
        // the name itself may hold anything: quote it
        let detail = format!("the file name {name:?} {why}");
        Err(Problem::new(Code::InvalidName, detail, "send a plain file name such as scan01.ply"))
    };
    if name.is_empty() {
        return refused("is empty");
    }
    if name.len() > LONGEST_FILE_NAME {
        return refused("is longer than 255 bytes");
    }
    if name == "." || name == ".." || name.contains(['/', '\\']) {
        return refused("names a folder");
    }
    if name.chars().any(char::is_control) {
        return refused("has a control character");
    }
    if name.trim() != name {
        return refused("begins or ends with a blank");
    }
    Ok(name.to_owned())
}

/// The name of a scan: a file name, or the path of a file from some folder on, since scans of several folders may have the
/// same file names. Its ending tells a format that is read here.
pub fn scan_name(name: &str) -> Result<String, Problem> {
    let name = path_name(name)?;
    surface_format(&name)?;
    Ok(name)
}

/// The name of a file with scans in it: a scan, or an archive of a set.
pub fn scans_file_name(name: &str) -> Result<String, Problem> {
    if visage_formats::archive::is_archive(name) { file_name(name) } else { scan_name(name) }
}

/// The path of a file from some folder on: plain file names parted by slashes, no folder of it hidden.
fn path_name(name: &str) -> Result<String, Problem> {
    let (folders, file) = name.rsplit_once('/').map_or((None, name), |(folders, file)| (Some(folders), file));
    file_name(file)?;
    let parts = || folders.into_iter().flat_map(|folders| folders.split('/'));
    let is_plain = |part: &str| !part.starts_with('.') && file_name(part).is_ok();
    if name.len() > LONGEST_FILE_NAME || !parts().all(is_plain) {
        let detail = format!("the file name {name:?} is no path within a folder, or longer than 255 bytes");
        return Err(Problem::new(Code::InvalidName, detail, "send a name such as scan01.ply or front/scan01.ply"));
    }
    Ok(name.to_owned())
}

/// The file name of a scan or model, whose ending tells a format that is read here.
pub fn surface_file_name(name: &str) -> Result<String, Problem> {
    let name = file_name(name)?;
    surface_format(&name)?;
    Ok(name)
}

/// The format of a scan or model, by its file name.
pub fn surface_format(name: &str) -> Result<&'static Format, Problem> {
    visage_formats::check_name(name).map_err(|error| Problem::unreadable(name, &error))
}

/// A time that is to come.
pub fn time_to_come(field: &str, text: &str) -> Result<jiff::Timestamp, Problem> {
    let refused =
        |detail| Problem::new(Code::InvalidField, detail, "send a time to come, such as 2030-01-31T00:00:00Z");
    let time: jiff::Timestamp = text.parse().map_err(|error| refused(format!("{field} is no time: {error}")))?;
    if time <= jiff::Timestamp::now() {
        return Err(refused(format!("{field} is {time}, which is over")));
    }
    Ok(time)
}

/// A name or label: short, in one line.
pub fn text(field: &str, value: &str) -> Result<String, Problem> {
    let value = value.trim();
    if value.is_empty() || value.chars().count() > LONGEST_TEXT || value.chars().any(char::is_control) {
        let detail = format!("{field} must have 1 to {LONGEST_TEXT} characters in one line");
        return Err(Problem::new(Code::InvalidField, detail, "shorten it, or leave it out"));
    }
    Ok(value.to_owned())
}

/// The words of a text that is searched for.
pub fn words(field: &str, value: &str) -> Result<Vec<String>, Problem> {
    Ok(text(field, value)?.split_whitespace().map(str::to_owned).collect())
}

/// A unit of length.
pub fn unit(value: &str) -> Result<visage_geometry::Unit, Problem> {
    value.parse().map_err(|error: UnknownName| {
        let hint = format!("send {}, or leave it out", error.names());
        Problem::new(Code::InvalidField, format!("unit: {error}"), hint)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_names_pass() {
        for name in ["bun000.ply", "Scan 1 (front).ply", "été.obj", "..ply", "a..b.ply"] {
            assert_eq!(file_name(name).expect("plain"), name);
        }
    }

    #[test]
    fn paths_and_control_characters_do_not() {
        let long = "x".repeat(256);
        for name in ["", ".", "..", "../a.ply", "/etc/passwd", "a\\b.ply", "a\0.ply", "a\n.ply", " a.ply", &long] {
            assert_eq!(file_name(name).expect_err(name).code(), Code::InvalidName);
        }
    }

    #[test]
    fn scans_may_be_in_folders_but_not_outside() {
        for name in ["a.ply", "front/a.ply", "x/y z/a.E57", "..ply"] {
            assert_eq!(scan_name(name).expect("a scan"), name);
        }
        let long = format!("{}/a.ply", "x".repeat(250));
        for name in ["/a.ply", "../a.ply", "x/../a.ply", "x//a.ply", "./a.ply", ".x/a.ply", "x /a.ply", "x/", &long] {
            assert_eq!(scan_name(name).expect_err(name).code(), Code::InvalidName, "{name}");
        }
        assert_eq!(scans_file_name("set.tar.gz").expect("an archive"), "set.tar.gz");
        assert_eq!(scan_name("set.zip").expect_err("no scan").code(), Code::UnsupportedFormat);
    }

    #[test]
    fn the_ending_tells_the_format() {
        assert_eq!(surface_file_name("a.b.PLY").expect("read here"), "a.b.PLY");
        for name in ["photo.jpg", "ply", "a.ply.xz", "a.zip"] {
            assert_eq!(surface_file_name(name).expect_err(name).code(), Code::UnsupportedFormat);
        }
    }

    #[test]
    fn labels_are_short_lines() {
        assert_eq!(text("label", "  face ").expect("short"), "face");
        assert!(text("label", "").is_err());
        assert!(text("label", "a\nb").is_err());
        assert!(text("label", &"x".repeat(201)).is_err());
    }
}
