//! Intrinsics of a pinhole camera, as programs write them: JSON, a 3x3 matrix, or a table of keys and values.

use crate::FormatError;
use crate::poses::lines;
use crate::poses::node::Node;
use crate::quote;

/// A pinhole camera: the pixel (column, row) sees along ((column - cx) / fx, (row - cy) / fy, 1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intrinsics {
    /// Columns and rows of the picture that they are of, if it is said.
    pub size: Option<(usize, usize)>,
    /// Focal length in columns.
    pub fx: f64,
    /// Focal length in rows.
    pub fy: f64,
    /// The column straight ahead.
    pub cx: f64,
    /// The row straight ahead.
    pub cy: f64,
}

/// The shares of columns and rows by which a depth image is smaller than the picture of its intrinsics may differ by
/// this.
const SAME_SHAPE: f64 = 0.02;
/// The principal point is no farther from the middle than this share of the size.
const OFF_CENTRE: f64 = 0.15;
/// Names of a focal length and a principal point, for columns and rows.
const KEYS: [&[&str]; 4] = [&["fx"], &["fy"], &["cx", "ppx"], &["cy", "ppy"]];
/// Names of a size.
const SIZE_KEYS: [&[&str]; 2] =
    [&["width", "w", "resolution x", "resolution_x"], &["height", "h", "resolution y", "resolution_y"]];
/// Names of a 3x3 matrix.
const MATRIX_KEYS: [&str; 6] =
    ["intrinsic_matrix", "K", "intrinsics", "camera_matrix", "intrinsicMatrix", "cameraMatrix"];

impl Intrinsics {
    /// Those of the same camera for an image of another size, which shows the same.
    ///
    /// Where their size is not said, it is told from the principal point, which lies near the middle: pictures are
    /// larger than depth images by halves (1920 columns for 256).
    pub(super) fn of_size(&self, columns: usize, rows: usize) -> Result<Intrinsics, FormatError> {
        let (width, height) = match self.size {
            Some((width, height)) => (width as f64, height as f64),
            None => self.likely_size(columns as f64, rows as f64),
        };
        let (by_x, by_y) = (columns as f64 / width, rows as f64 / height);
        // an image without rows or columns is of no shape
        let is_same = (by_x / by_y - 1.0).abs() < SAME_SHAPE;
        if !is_same {
            let problem = format!("they are of {width} x {height} pixels, the depth image has {columns} x {rows}");
            return Err(FormatError::malformed("the intrinsics", problem, "give those of the depth camera"));
        }
        let scaled = |c: f64, by: f64| (c + 0.5) * by - 0.5;
        let scaled = Intrinsics {
            size: Some((columns, rows)),
            fx: self.fx * by_x,
            fy: self.fy * by_y,
            cx: if by_x == 1.0 { self.cx } else { scaled(self.cx, by_x) },
            cy: if by_y == 1.0 { self.cy } else { scaled(self.cy, by_y) },
        };
        let is_off = |c: f64, size: usize| (c / size as f64 - 0.5).abs() > OFF_CENTRE;
        if self.size.is_none() && (is_off(scaled.cx, columns) || is_off(scaled.cy, rows)) {
            let problem = format!(
                "the principal point {} {} is not in the middle of {columns} x {rows} pixels, nor of a larger picture",
                self.cx, self.cy
            );
            return Err(FormatError::malformed(
                "the intrinsics",
                problem,
                "add the width and height that they are for",
            ));
        }
        Ok(scaled)
    }

    fn likely_size(&self, columns: f64, rows: f64) -> (f64, f64) {
        let halves = |c: f64, size: f64| (4.0 * (c + 0.5) / size).round() / 2.0;
        let factor = halves(self.cx, columns);
        let is_one = factor == halves(self.cy, rows) && factor >= 1.0;
        if is_one { (columns * factor, rows * factor) } else { (columns, rows) }
    }

    fn new(size: Option<(usize, usize)>, [fx, fy, cx, cy]: [f64; 4]) -> Result<Intrinsics, String> {
        let is_sound = |length: f64| length.is_finite() && length > 0.0;
        if !(is_sound(fx) && is_sound(fy)) {
            return Err(format!("the focal lengths are {fx} and {fy}"));
        }
        if !(cx.is_finite() && cy.is_finite()) {
            return Err(format!("the principal point is {cx} {cy}"));
        }
        Ok(Intrinsics { size: size.filter(|(width, height)| *width > 0 && *height > 0), fx, fy, cx, cy })
    }

    /// From a 3x3 matrix, row by row.
    fn of_matrix(size: Option<(usize, usize)>, m: [f64; 9]) -> Result<Intrinsics, String> {
        if m[3] != 0.0 || m[6] != 0.0 || m[7] != 0.0 || m[8] != 1.0 {
            return Err("the matrix is not fx 0 cx, 0 fy cy, 0 0 1".to_owned());
        }
        Intrinsics::new(size, [m[0], m[4], m[2], m[5]])
    }
}

/// Reads intrinsics, whatever they are written by: JSON with `intrinsic_matrix`, `K`, `intrinsics` or `fx`, `fy`, `cx`,
/// `cy`; a 3x3 matrix as text; lines of a key and a value (`Fx,603.4`); a line `fx fy cx cy`. `name` serves messages.
///
/// # Errors
/// [`FormatError::Malformed`] if there are none in it.
pub fn read_intrinsics(name: &str, bytes: &[u8]) -> Result<Intrinsics, FormatError> {
    let fault = |problem: String| {
        let remedy = "give {\"width\": ..., \"height\": ..., \"fx\": ..., \"fy\": ..., \"cx\": ..., \"cy\": ...}";
        FormatError::malformed(quote(name.as_bytes()), problem, remedy)
    };
    let text = std::str::from_utf8(bytes).map_err(|_| fault("it is no text".to_owned()))?;
    let text = text.trim_start_matches('\u{feff}').trim_start();
    let found = if text.starts_with('{') {
        let node = Node::read(text).map_err(|_| fault("it is no sound JSON".to_owned()))?;
        of_json(&node, 3)
    } else {
        of_text(text)
    };
    found.unwrap_or_else(|| Err("there are no intrinsics in it".to_owned())).map_err(fault)
}

type Found = Option<Result<Intrinsics, String>>;

/// From an object, or one in it.
fn of_json(node: &Node, depth: usize) -> Found {
    let Node::Map(entries) = node else { return None };
    let number = |keys: &[&str]| {
        let is_one = |key: &str| keys.contains(&key.to_lowercase().as_str());
        entries.iter().find(|(key, _)| is_one(key)).and_then(|(_, node)| node.number())
    };
    let size = SIZE_KEYS.map(number);
    let size = size[0].zip(size[1]).map(|(width, height)| (width as usize, height as usize));
    for key in MATRIX_KEYS {
        let Some(Ok(m)) = node.get(key).and_then(Node::numbers).map(<[f64; 9]>::try_from) else { continue };
        let [a, b, c, d, e, f, g, h, i] = m;
        // some write it row by row, others column by column: the last row is 0 0 1
        let is_by_rows = g == 0.0 && h == 0.0;
        return Some(Intrinsics::of_matrix(size, if is_by_rows { m } else { [a, d, g, b, e, h, c, f, i] }));
    }
    if let [Some(fx), Some(fy), Some(cx), Some(cy)] = KEYS.map(number) {
        return Some(Intrinsics::new(size, [fx, fy, cx, cy]));
    }
    let inner = (depth > 0).then(|| entries.iter().find_map(|(_, inner)| of_json(inner, depth - 1))).flatten();
    // the size may stand beside them
    inner.map(|found| found.map(|found| Intrinsics { size: found.size.or(size), ..found }))
}

/// From a matrix, a line of four numbers, or lines of keys and values.
fn of_text(text: &str) -> Found {
    let rows: Vec<&str> = lines::data(text).take(4).map(|(_, line)| line).collect();
    if let [a, b, c] = rows.as_slice()
        && let (Some(a), Some(b), Some(c)) = (lines::numbers::<3>(a), lines::numbers::<3>(b), lines::numbers::<3>(c))
    {
        return Some(Intrinsics::of_matrix(None, [a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]]));
    }
    if let [line] = rows.as_slice() {
        if let Some(m) = lines::numbers::<9>(line) {
            return Some(Intrinsics::of_matrix(None, m));
        }
        if let Some(four) = lines::numbers::<4>(line) {
            return Some(Intrinsics::new(None, four));
        }
    }
    let value = |keys: &[&str]| {
        let pairs = lines::data(text).filter_map(|(_, line)| line.split_once([',', ':', '=', ';', '\t']));
        let mut fitting = pairs.filter(|(key, _)| keys.contains(&key.trim().to_lowercase().as_str()));
        fitting.find_map(|(_, value)| value.trim().trim_end_matches([',', ';']).parse::<f64>().ok())
    };
    let size = SIZE_KEYS.map(value);
    let size = size[0].zip(size[1]).map(|(width, height)| (width as usize, height as usize));
    match KEYS.map(value) {
        [Some(fx), Some(fy), Some(cx), Some(cy)] => Some(Intrinsics::new(size, [fx, fy, cx, cy])),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Intrinsics, String> {
        read_intrinsics("camera.json", text.as_bytes()).map_err(|error| error.to_string())
    }

    #[test]
    fn every_way_of_writing_them_is_read() {
        let camera = Intrinsics { size: Some((640, 480)), fx: 525.0, fy: 526.0, cx: 319.5, cy: 239.5 };
        for text in [
            "{\"width\": 640, \"height\": 480, \"intrinsic_matrix\": [525, 0, 0, 0, 526, 0, 319.5, 239.5, 1]}",
            "{\"w\": 640, \"h\": 480, \"K\": [525, 0, 0, 0, 526, 0, 319.5, 239.5, 1]}",
            "{\"width\": 640, \"height\": 480, \"intrinsics\": [525, 0, 319.5, 0, 526, 239.5, 0, 0, 1]}",
            "{\"width\": 640, \"height\": 480, \"camera_matrix\": [[525, 0, 319.5], [0, 526, 239.5], [0, 0, 1]]}",
            "{\"width\": 640, \"height\": 480, \"depth\": {\"fx\": 525, \"fy\": 526, \"ppx\": 319.5, \"ppy\": 239.5}}",
            "Stream,Depth\nResolution x,640\nResolution y,480\nFx,525\nFy,526\nPPx,319.5\nPPy,239.5\n",
        ] {
            assert_eq!(read(text), Ok(camera), "{text}");
        }
        let sizeless = Ok(Intrinsics { size: None, ..camera });
        assert_eq!(read("525,0,319.5\n0,526,239.5\n0,0,1\n"), sizeless);
        assert_eq!(read("525 526 319.5 239.5"), sizeless);
    }

    #[test]
    fn what_is_none_is_refused() {
        for (text, problem) in [
            ("{}", "there are no intrinsics in it"),
            ("{", "it is no sound JSON"),
            ("hello", "there are no intrinsics in it"),
            ("0 526 319.5 239.5", "the focal lengths are 0 and 526"),
            ("1 0 0\n0 1 0\n1 0 1\n", "the matrix is not fx 0 cx"),
            ("nan 1 2 3", "the focal lengths are NaN and 1"),
        ] {
            let error = read(text).expect_err(text);
            assert!(error.starts_with(&format!("\"camera.json\": {problem}")), "{error}");
        }
    }

    #[test]
    fn intrinsics_of_a_larger_picture_fit_its_depth_image() {
        let phone = Intrinsics { size: Some((1920, 1440)), fx: 1500.0, fy: 1500.0, cx: 959.5, cy: 719.5 };
        let scaled = phone.of_size(256, 192).expect("the same shape");
        assert_eq!((scaled.fx, scaled.cx, scaled.cy), (200.0, 127.5, 95.5));
        // without a size it is told from the principal point, which is not quite in the middle
        let sizeless = Intrinsics { size: None, cx: 963.0, cy: 712.0, ..phone };
        assert_eq!(sizeless.of_size(256, 192).expect("7.5 times as large").fx, 200.0);
        let own = Intrinsics { size: None, cx: 320.0, cy: 235.0, ..phone };
        assert_eq!(own.of_size(640, 480).expect("of the image itself"), Intrinsics { size: Some((640, 480)), ..own });
        assert!(Intrinsics { cx: 50.0, ..own }.of_size(640, 480).is_err());
        assert!(phone.of_size(640, 640).is_err());
    }
}
