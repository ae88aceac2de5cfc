//! Colours of OBJ files whose materials and pictures are in other files: of an archive, or a folder that was uploaded.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};

use super::budget::Budget;
use super::image::{Image, repeated};
use super::{FormatError, ReadLimits, Reading, number, obj, quote, text_start};

/// Gives the bytes of a file beside the OBJ file, by its path from there (`/` between folders). They are not kept: one such
/// file at a time is in memory.
pub type Resolve<'r, 'a> = &'r dyn Fn(&str) -> Option<Cow<'a, [u8]>>;

/// Endings of the files that an OBJ file may need.
pub const ENDINGS: &[&str] = &["mtl", "png", "jpg", "jpeg"];
/// An OBJ file's files are in its folder, or in folders in it down to this depth.
pub const DEPTH: usize = 2;
/// More than so many notes say nothing new.
const MOST_NOTES: usize = 8;

/// Reads an OBJ file as [`obj::read`] does. If its vertices have no colours, its materials give them: by the picture of
/// the first face that has a vertex (`map_Kd`), or by its plain colour (`Kd`). A file that isn't there costs its
/// colours and is noted.
///
/// # Errors
/// Those of [`obj::read`], and [`FormatError::TooManyBytes`] for pictures beyond the limits.
pub fn read(bytes: &[u8], limits: &ReadLimits, resolve: Resolve) -> Result<Reading, FormatError> {
    let mut reading = obj::read(bytes, limits)?;
    // which vertices were left out is not known any more
    if reading.surface.cloud.colors.is_some() || reading.dropped.no_return > 0 || reading.surface.faces.is_empty() {
        return Ok(reading);
    }
    let text = &bytes[text_start(bytes)?..];
    let mut budget = limits.budget();
    let mut materials = Materials::default();
    for line in lines(text).filter(|line| keyword(line) == b"mtllib") {
        materials.read(&rest(line), resolve, &mut budget)?;
    }
    let count = reading.surface.cloud.len();
    budget.take(count as u64, size_of::<Option<[u8; 3]>>())?;
    let mut colors = vec![None; count];
    color_vertices(text, &materials, &mut colors, &mut budget)?;
    let colored = colors.iter().flatten().count();
    if colored > 0 {
        reading.dropped.colors += (count - colored) as u64;
        reading.surface.cloud.colors = Some(colors.into_iter().map(Option::unwrap_or_default).collect());
    }
    reading.dropped.notes.extend(materials.notes);
    Ok(reading)
}

/// What a material gives to the vertices of its faces.
enum Material {
    Plain([u8; 3]),
    Image(Image),
}

#[derive(Default)]
struct Materials {
    all: HashMap<Vec<u8>, Material>,
    notes: Vec<String>,
    /// Paths that were read, or tried in vain: a file that names one a million times has it read once.
    done: HashSet<String>,
}

impl Materials {
    fn note(&mut self, what: &str, path: &str, problem: &str) {
        match self.notes.len() {
            0..MOST_NOTES => self.notes.push(format!("colours: the {what} {} {problem}", quote(path.as_bytes()))),
            MOST_NOTES => self.notes.push("colours: further files are missing or can't be read".into()),
            _ => {}
        }
    }

    /// Reads a library of materials.
    fn read(&mut self, path: &str, resolve: Resolve, budget: &mut Budget) -> Result<(), FormatError> {
        if self.done.contains(path) {
            return Ok(());
        }
        budget.take(1, size_of::<String>() + path.len())?;
        self.done.insert(path.to_owned());
        let Some(text) = resolve(path) else {
            // the name of a file may have blanks, and a line the names of several
            let parts: Vec<&str> = path.split_ascii_whitespace().collect();
            let is_known = |part: &&str| self.done.contains(*part) || resolve(part).is_some();
            if parts.len() > 1 && parts.iter().any(is_known) {
                return parts.into_iter().try_for_each(|part| self.read(part, resolve, budget));
            }
            self.note("materials", path, "are not there");
            return Ok(());
        };
        let mut name = Vec::new();
        for line in lines(&text) {
            match keyword(line) {
                b"newmtl" => name = rest(line).into_bytes(),
                b"Kd" => {
                    let mut channels = [0.0; 3];
                    let words = words(line).skip(1);
                    channels.iter_mut().zip(words).for_each(|(x, word)| *x = number::parse(word).unwrap_or(0.0));
                    budget.take(1, size_of::<Material>() + name.len())?;
                    // `as` from a float saturates
                    let color = channels.map(|channel| (channel * 255.0).round() as u8);
                    self.all.entry(name.clone()).or_insert(Material::Plain(color));
                }
                b"map_Kd" => self.read_picture(&name, &picture_path(line), resolve, budget)?,
                _ => {}
            }
        }
        Ok(())
    }

    /// Gives a material its picture.
    fn read_picture(
        &mut self,
        name: &[u8],
        path: &str,
        resolve: Resolve,
        budget: &mut Budget,
    ) -> Result<(), FormatError> {
        if self.done.contains(path) {
            return Ok(());
        }
        let found = resolve(path);
        let problem = match found.as_deref().map(|bytes| Image::read(bytes, budget)).transpose()? {
            Some(Ok(picture)) => {
                self.all.insert(name.to_vec(), Material::Image(picture));
                return Ok(());
            }
            Some(Err(problem)) => problem,
            None => "is not there".into(),
        };
        budget.take(1, size_of::<String>() + path.len())?;
        self.done.insert(path.to_owned());
        self.note("picture", path, &problem);
        Ok(())
    }
}

/// Gives each vertex the colour of the first face that has it.
fn color_vertices(
    text: &[u8],
    materials: &Materials,
    colors: &mut [Option<[u8; 3]>],
    budget: &mut Budget,
) -> Result<(), FormatError> {
    let mut coordinates: Vec<[f32; 2]> = Vec::new();
    let mut vertices = 0;
    let mut material = None;
    for line in lines(text) {
        match keyword(line) {
            b"v" => vertices += 1,
            b"vt" => {
                budget.take(1, size_of::<[f32; 2]>())?;
                let mut place = [0.0; 2];
                let words = words(line).skip(1);
                place.iter_mut().zip(words).for_each(|(x, word)| *x = number::parse(word).unwrap_or(f64::NAN) as f32);
                coordinates.push(place);
            }
            b"usemtl" => material = materials.all.get(rest(line).as_bytes()),
            b"f" => {
                let Some(material) = material else { continue };
                for word in words(line).skip(1) {
                    let mut parts = word.split(|byte| *byte == b'/');
                    let vertex = index(parts.next(), vertices).and_then(|vertex| colors.get_mut(vertex));
                    let Some(color @ None) = vertex else { continue };
                    *color = match material {
                        Material::Plain(plain) => Some(*plain),
                        Material::Image(picture) => {
                            let place = index(parts.next(), coordinates.len()).and_then(|at| coordinates.get(at));
                            // v goes up
                            place.and_then(|[u, v]| {
                                picture.color(repeated(f64::from(*u)), 1.0 - repeated(f64::from(*v)))
                            })
                        }
                    };
                }
            }
            _ => {}
        }
    }
    Ok(())
}

/// An index as OBJ counts, from 1, or back from the last one so far.
fn index(word: Option<&[u8]>, count: usize) -> Option<usize> {
    let number: i64 = std::str::from_utf8(word?).ok()?.parse().ok()?;
    let index = if number < 0 { number.checked_add(count as i64)? } else { number.checked_sub(1)? };
    usize::try_from(index).ok()
}

/// The path of a `map_Kd` line, behind its options.
fn picture_path(line: &[u8]) -> String {
    let mut words: Vec<&[u8]> = words(line).skip(1).collect();
    while let Some(option) = words.first().filter(|word| word.starts_with(b"-")) {
        let most = match *option {
            b"-s" | b"-o" | b"-t" => 3,
            b"-mm" => 2,
            _ => 1,
        };
        let is_value = |word: &&&[u8]| most == 1 || number::parse(word).is_some();
        let values = words.iter().skip(1).take(most).take_while(is_value).count();
        words.drain(..(1 + values).min(words.len()));
    }
    path_of(&words.join(&b' '))
}

/// What stands behind the keyword, as a path or a name.
fn rest(line: &[u8]) -> String {
    let line = line.trim_ascii();
    let length = keyword(line).len();
    path_of(line.get(length..).unwrap_or_default())
}

fn path_of(bytes: &[u8]) -> String {
    let path = String::from_utf8_lossy(bytes.trim_ascii()).replace('\\', "/");
    path.trim_start_matches("./").to_owned()
}

fn lines(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split(|byte| *byte == b'\n' || *byte == b'\r')
}

fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

fn keyword(line: &[u8]) -> &[u8] {
    words(line).next().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    const OBJ: &[u8] =
        b"mtllib .\\parts\\a b.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 5 5 5\nvt 0.1 0.9\nvt 0.9 0.9\n\
        vt 0.1 0.1\nusemtl wood\nf 1/1 2/2 -3/-1\nusemtl plain\nf 2 4 3\n";
    const MATERIALS: &[u8] =
        b"newmtl plain\nKd 1 0.5 0\n\nnewmtl wood\nKd 1 1 1\nmap_Kd -s 1 1 1 -clamp on my wood.png\n";

    fn picture() -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 2, 2);
        encoder.set_color(png::ColorType::Rgb);
        let mut writer = encoder.write_header().expect("a header");
        writer.write_image_data(&[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]).expect("pixels");
        writer.finish().expect("an end");
        bytes
    }

    #[test]
    fn pictures_and_plain_colours_go_to_the_vertices() {
        let picture = picture();
        let resolve = |path: &str| match path {
            "parts/a b.mtl" => Some(Cow::Borrowed(MATERIALS)),
            "my wood.png" => Some(Cow::Borrowed(&picture[..])),
            _ => None,
        };
        let reading = read(OBJ, &ReadLimits::default(), &resolve).expect("sound");
        let colors = reading.surface.cloud.colors.expect("colours");
        assert_eq!(colors, [[1, 2, 3], [4, 5, 6], [7, 8, 9], [255, 128, 0], [0; 3]]);
        assert_eq!((reading.dropped.colors, reading.dropped.notes.len()), (1, 0));
    }

    #[test]
    fn what_is_not_there_costs_colours_only() {
        let reading = read(OBJ, &ReadLimits::default(), &|_| None).expect("sound");
        assert_eq!((reading.surface.cloud.len(), reading.surface.cloud.colors), (5, None));
        assert_eq!(reading.dropped.notes, ["colours: the materials \"parts/a b.mtl\" are not there"]);
        let resolve = |path: &str| path.ends_with("mtl").then_some(Cow::Borrowed(MATERIALS));
        let reading = read(OBJ, &ReadLimits::default(), &resolve).expect("sound");
        assert_eq!(reading.dropped.notes, ["colours: the picture \"my wood.png\" is not there"]);
        assert_eq!(reading.surface.cloud.colors.expect("plain ones")[0], [255; 3]);
        let resolve =
            |path: &str| Some(Cow::Borrowed(if path.ends_with("mtl") { MATERIALS } else { &b"no picture"[..] }));
        let notes = read(OBJ, &ReadLimits::default(), &resolve).expect("sound").dropped.notes;
        assert!(notes[0].contains("is neither PNG nor JPEG"), "{notes:?}");
    }

    #[test]
    fn files_are_read_once_however_often_they_are_named() {
        let text = String::from_utf8_lossy(OBJ).replace("mtllib .\\parts\\a b.mtl\n", &"mtllib a.mtl\n".repeat(5000));
        let materials = format!("newmtl wood\n{}", "map_Kd x.png\n".repeat(5000));
        let asked = std::cell::Cell::new(0);
        let resolve = |path: &str| {
            asked.set(asked.get() + 1);
            Some(Cow::Borrowed(if path == "a.mtl" { materials.as_bytes() } else { &b"no picture"[..] }))
        };
        let reading = read(text.as_bytes(), &ReadLimits::default(), &resolve).expect("sound");
        assert_eq!((asked.get(), reading.dropped.notes.len()), (2, 1));
        let many: String = (0..5000).map(|k| format!("mtllib {k}.mtl\n")).collect();
        let notes = read((many + &text).as_bytes(), &ReadLimits::default(), &|_| None).expect("sound").dropped.notes;
        assert_eq!(notes.len(), MOST_NOTES + 1);
        // a line may name several
        let text = String::from_utf8_lossy(OBJ).replace(".\\parts\\a b.mtl", "x.mtl a.mtl");
        let resolve = |path: &str| (path == "a.mtl").then_some(Cow::Borrowed(MATERIALS));
        let colors = read(text.as_bytes(), &ReadLimits::default(), &resolve).expect("sound").surface.cloud.colors;
        assert_eq!(colors.expect("plain ones")[3], [255, 128, 0]);
    }
}
