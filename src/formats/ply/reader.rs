//! Rows of numbers to a [`Surface`].

use super::body::{Ascii, Binary, Body, Fault};
use super::header::{Element, Encoding, Header, Kind, Property, ScalarType};
use crate::formats::{FormatError, ReadLimits, checked_coordinate};
use crate::geometry::{Cloud, Point3, RangeGrid, Surface};

/// Reads a PLY file: points with their attributes, triangles and the range grid, as far as the file has them.
///
/// Read of each vertex: `x y z` (any number type), `nx ny nz`, `red green blue` (or `diffuse_red` and so on) and
/// `intensity` (or `scalar_intensity`). Polygons are cut into fans of triangles.
///
/// # Errors
/// [`FormatError::Truncated`] when the file declares more than it holds (checked before anything is allocated),
/// [`FormatError::TooLarge`] beyond the limits, [`FormatError::Malformed`] with the row and the line or byte for
/// the rest: no vertices, coordinates that are not finite, indices of vertices that don't exist.
pub fn read(bytes: &[u8], limits: &ReadLimits) -> Result<Surface, FormatError> {
    let header = Header::parse(bytes)?;
    header.check_counts((bytes.len() - header.body_start) as u64)?;
    let plan = Plan::new(&header, limits)?;
    match header.encoding {
        Encoding::Ascii => plan.read(Ascii::new(bytes, header.body_start)),
        Encoding::LittleEndian => plan.read(Binary::<false>::new(bytes, header.body_start)),
        Encoding::BigEndian => plan.read(Binary::<true>::new(bytes, header.body_start)),
    }
}

/// What is to be read, after the header alone has been judged.
struct Plan<'a> {
    header: &'a Header,
    limits: &'a ReadLimits,
    vertices: u64,
    /// Columns and rows of the range grid, if there is one.
    grid: Option<(usize, usize)>,
}

impl<'a> Plan<'a> {
    fn new(header: &'a Header, limits: &'a ReadLimits) -> Result<Self, FormatError> {
        let count = |name: &str| header.elements.iter().find(|e| e.name == name).map_or(0, |e| e.count);
        let (vertices, faces) = (count("vertex"), count("face"));
        // u32 indexes points, and its largest value marks an empty pixel
        let max_points = limits.max_points.min(u64::from(u32::MAX) - 1);
        for (what, found, limit) in [("points", vertices, max_points), ("faces", faces, limits.max_faces)] {
            if found > limit {
                return Err(FormatError::TooLarge { what, found, limit });
            }
        }
        if vertices == 0 {
            return Err(FormatError::malformed("header", "there are no vertices", "send a file with points"));
        }
        Ok(Plan { header, limits, vertices, grid: grid_size(header)? })
    }

    fn read(&self, mut body: impl Body) -> Result<Surface, FormatError> {
        let mut surface = Surface::default();
        for element in &self.header.elements {
            match element.name.as_str() {
                "vertex" if surface.cloud.is_empty() => surface.cloud = self.read_vertices(element, &mut body)?,
                "face" if surface.faces.is_empty() => surface.faces = self.read_faces(element, &mut body)?,
                "range_grid" if surface.grid.is_none() && self.grid.is_some() => {
                    surface.grid = self.read_grid(element, &mut body)?;
                }
                _ => skip_element(element, &mut body)?,
            }
        }
        Ok(surface)
    }

    fn read_vertices(&self, element: &Element, body: &mut impl Body) -> Result<Cloud, FormatError> {
        let columns: Vec<Column> = element.properties.iter().map(Column::of).collect();
        let attributes = Attributes::of(&columns)?;
        let count = element.count as usize;
        let mut cloud = Cloud {
            points: Vec::with_capacity(count),
            normals: attributes.normals.then(|| Vec::with_capacity(count)),
            colors: attributes.colors.then(|| Vec::with_capacity(count)),
            intensities: attributes.intensities.then(|| Vec::with_capacity(count)),
        };
        for row in 0..count {
            read_vertex(&columns, &mut cloud, body).map_err(|fault| fault.at("vertex", row, element.count, body))?;
        }
        Ok(cloud)
    }

    fn read_faces(&self, element: &Element, body: &mut impl Body) -> Result<Vec<[u32; 3]>, FormatError> {
        let corners = |p: &Property| matches!(p.name.as_str(), "vertex_indices" | "vertex_index");
        let Some(corners) = element.properties.iter().position(corners) else {
            skip_element(element, body)?;
            return Ok(Vec::new());
        };
        let mut triangles = Vec::with_capacity(element.count as usize);
        for row in 0..element.count as usize {
            self.read_face(&element.properties, corners, &mut triangles, body)
                .map_err(|fault| fault.at("face", row, element.count, body))?;
            if triangles.len() as u64 > self.limits.max_faces {
                let found = triangles.len() as u64;
                return Err(FormatError::TooLarge { what: "faces", found, limit: self.limits.max_faces });
            }
        }
        Ok(triangles)
    }

    /// One polygon as a fan around its first corner; with fewer than three corners it is nothing.
    fn read_face(
        &self,
        properties: &[Property],
        corners: usize,
        triangles: &mut Vec<[u32; 3]>,
        body: &mut impl Body,
    ) -> Result<(), Fault> {
        body.begin_row()?;
        for (index, property) in properties.iter().enumerate() {
            let Kind::List { count, item } = property.kind else {
                body.skip(property.kind)?;
                continue;
            };
            if index != corners {
                body.skip(property.kind)?;
                continue;
            }
            let mut fan = [0u32; 2];
            for corner in 0..body.list_length(count)? {
                let vertex = self.vertex_index(body.integer(item)?)?;
                match corner {
                    0 | 1 => fan[corner as usize] = vertex,
                    _ => {
                        triangles.push([fan[0], fan[1], vertex]);
                        fan[1] = vertex;
                    }
                }
            }
        }
        body.end_row()
    }

    fn read_grid(&self, element: &Element, body: &mut impl Body) -> Result<Option<RangeGrid>, FormatError> {
        let (Some((columns, rows)), [Property { kind: Kind::List { count, item }, .. }]) =
            (self.grid, element.properties.as_slice())
        else {
            skip_element(element, body)?;
            return Ok(None);
        };
        let mut pixels = Vec::with_capacity(element.count as usize);
        for row in 0..element.count as usize {
            let pixel = self
                .read_pixel(*count, *item, body)
                .map_err(|fault| fault.at("range_grid", row, element.count, body))?;
            pixels.push(pixel);
        }
        Ok(Some(RangeGrid { columns, rows, pixels }))
    }

    fn read_pixel(&self, count: ScalarType, item: ScalarType, body: &mut impl Body) -> Result<u32, Fault> {
        body.begin_row()?;
        let pixel = match body.list_length(count)? {
            0 => RangeGrid::EMPTY,
            1 => self.vertex_index(body.integer(item)?)?,
            several => return Err(Fault::Wrong(format!("a pixel sees at most one vertex, this one lists {several}"))),
        };
        body.end_row()?;
        Ok(pixel)
    }

    #[inline]
    fn vertex_index(&self, index: i64) -> Result<u32, Fault> {
        match u64::try_from(index) {
            Ok(vertex) if vertex < self.vertices => Ok(vertex as u32),
            _ => Err(Fault::Wrong(format!("there is no vertex {index} among {}", self.vertices))),
        }
    }
}

/// Columns and rows of the range grid, checked against its number of pixels; `None` without a grid or its size.
fn grid_size(header: &Header) -> Result<Option<(usize, usize)>, FormatError> {
    let grid = header.elements.iter().find(|e| e.name == "range_grid");
    let (Some(grid), Some(columns), Some(rows)) = (grid, header.grid_columns, header.grid_rows) else {
        return Ok(None);
    };
    if columns.checked_mul(rows) != Some(grid.count) {
        let problem =
            format!("num_cols {columns} x num_rows {rows} does not give the {} pixels of range_grid", grid.count);
        return Err(FormatError::malformed("header", problem, "export the scan again, or without its range_grid"));
    }
    // both are factors of a count that was checked against the file's size
    Ok(Some((columns as usize, rows as usize)))
}

fn skip_element(element: &Element, body: &mut impl Body) -> Result<(), FormatError> {
    if element.properties.is_empty() {
        return Ok(());
    }
    for row in 0..element.count as usize {
        body.skip_row(&element.properties).map_err(|fault| fault.at(&element.name, row, element.count, body))?;
    }
    Ok(())
}

/// Slots of a vertex row's values: position, normal, color, intensity, and one for what is not kept.
const X: usize = 0;
const NX: usize = 3;
const RED: usize = 6;
const INTENSITY: usize = 9;
const UNUSED: usize = 10;

const SLOT_NAMES: [&str; 10] = ["x", "y", "z", "nx", "ny", "nz", "red", "green", "blue", "intensity"];

/// One vertex property: how it is read and where its value goes.
#[derive(Debug, Clone, Copy)]
struct Column {
    kind: Kind,
    slot: usize,
}

impl Column {
    fn of(property: &Property) -> Self {
        let name = property.name.to_ascii_lowercase();
        // other programs' names for the same things
        let name = match name.as_str() {
            "diffuse_red" => "red",
            "diffuse_green" => "green",
            "diffuse_blue" => "blue",
            "scalar_intensity" => "intensity",
            name => name,
        };
        let slot = match property.kind {
            Kind::Scalar(_) => SLOT_NAMES.iter().position(|slot| *slot == name).unwrap_or(UNUSED),
            Kind::List { .. } => UNUSED,
        };
        Column { kind: property.kind, slot }
    }
}

/// Which attributes the columns make up.
struct Attributes {
    normals: bool,
    colors: bool,
    intensities: bool,
}

impl Attributes {
    fn of(columns: &[Column]) -> Result<Self, FormatError> {
        let has = |slots: std::ops::Range<usize>| slots.into_iter().all(|slot| columns.iter().any(|c| c.slot == slot));
        if !has(X..X + 3) {
            let problem = "the vertices have no x, y and z";
            return Err(FormatError::malformed("header", problem, "export the file with positions"));
        }
        Ok(Attributes { normals: has(NX..NX + 3), colors: has(RED..RED + 3), intensities: has(INTENSITY..UNUSED) })
    }
}

#[inline]
fn read_vertex(columns: &[Column], cloud: &mut Cloud, body: &mut impl Body) -> Result<(), Fault> {
    let mut values = [0.0f64; UNUSED + 1];
    body.begin_row()?;
    for column in columns {
        match column.kind {
            Kind::Scalar(scalar) if column.slot == UNUSED => {
                body.number(scalar)?;
            }
            Kind::Scalar(scalar) => {
                let value = checked_coordinate(body.number(scalar)?)
                    .map_err(|problem| Fault::Wrong(format!("{} {problem}", SLOT_NAMES[column.slot])))?;
                let is_fraction = (RED..INTENSITY).contains(&column.slot) && scalar.is_float();
                values[column.slot] = if is_fraction { value * 255.0 } else { value };
            }
            list => body.skip(list)?,
        }
    }
    body.end_row()?;
    cloud.points.push(Point3::new(values[X], values[X + 1], values[X + 2]));
    if let Some(normals) = &mut cloud.normals {
        let normal = nalgebra::Vector3::new(values[NX], values[NX + 1], values[NX + 2]);
        normals.push(normal.try_normalize(f64::MIN_POSITIVE).unwrap_or_default().cast());
    }
    if let Some(colors) = &mut cloud.colors {
        // `as` saturates
        colors.push([values[RED], values[RED + 1], values[RED + 2]].map(|channel| channel.round() as u8));
    }
    if let Some(intensities) = &mut cloud.intensities {
        intensities.push(values[INTENSITY] as f32);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str) -> Result<Surface, FormatError> {
        read(text.as_bytes(), &ReadLimits::default())
    }

    /// The message of a file of three vertices `body`, after `header` lines of further elements.
    fn message(header: &str, body: &str) -> String {
        let xyz = "property float x\nproperty float y\nproperty float z\n";
        let text = format!("ply\nformat ascii 1.0\nelement vertex 3\n{xyz}{header}end_header\n{body}");
        read_text(&text).expect_err(body).to_string()
    }

    #[test]
    fn attributes_faces_and_unknown_elements_are_sorted_out() {
        let surface = read_text(
            "ply\nformat ascii 1.0\nelement camera 1\nproperty float view\nproperty list uchar int flags\n\
             element vertex 4\nproperty double x\nproperty float y\nproperty int z\nproperty float confidence\n\
             property float nx\nproperty float ny\nproperty float nz\nproperty float scalar_Intensity\n\
             property uchar diffuse_red\nproperty uchar diffuse_green\nproperty uchar diffuse_blue\n\
             element face 2\nproperty uchar material\nproperty list uchar int vertex_index\nend_header\n\
             0.5 2 7 8\n\
             0 0 0 0.5 0 0 2 0.25 1 2 3\n\n1 0 0 0.5 0 0 0 1 4 5 6\n1 1 0 0.5 0 1 0 1 0 0 0\n0 1 0 0.5 1 0 0 1 255 300 -1\n\
             9 4 0 1 2 3\n9 2 0 1\n",
        )
        .expect("all of this is sound");
        assert_eq!(surface.cloud.points[2], Point3::new(1.0, 1.0, 0.0));
        let normals = surface.cloud.normals.expect("nx ny nz");
        assert_eq!(normals[0], nalgebra::Vector3::z(), "normals are made unit vectors");
        assert_eq!(normals[1], nalgebra::Vector3::zeros(), "a zero normal stays unknown");
        assert_eq!(surface.cloud.colors.expect("diffuse colors")[3], [255, 255, 0]);
        assert_eq!(surface.cloud.intensities.expect("intensity")[..2], [0.25, 1.0]);
        assert_eq!(surface.faces, [[0, 1, 2], [0, 2, 3]], "a square makes two triangles, an edge none");
    }

    #[test]
    fn confidence_is_no_intensity_and_two_thirds_of_a_normal_are_none() {
        let surface = read_text(
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
             property float confidence\nproperty float nx\nproperty float ny\nend_header\n1 2 3 4 5 6",
        )
        .expect("sound");
        assert_eq!(surface.cloud, Cloud::from_points(vec![Point3::new(1.0, 2.0, 3.0)]));
    }

    #[test]
    fn float_colors_are_fractions() {
        let surface = read_text(
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
             property float red\nproperty float green\nproperty float blue\nend_header\n1 2 3 1 0.5 0\n",
        )
        .expect("sound");
        assert_eq!(surface.cloud.colors, Some(vec![[255, 128, 0]]));
    }

    #[test]
    fn a_range_grid_is_kept() {
        let surface = read_text(
            "ply\nformat ascii 1.0\nobj_info num_cols 2\nobj_info num_rows 3\nbye\nelement vertex 2\nproperty float x\n\
             property float y\nproperty float z\nelement range_grid 6\nproperty list uchar int vertex_indices\n\
             end_header\n0 0 0\n1 1 1\n0 \n1 0 \n0 \n0 \n1 1\n0",
        )
        .expect("a scan of two points");
        let empty = RangeGrid::EMPTY;
        let pixels = vec![empty, 0, empty, empty, 1, empty];
        assert_eq!(surface.grid, Some(RangeGrid { columns: 2, rows: 3, pixels }));
    }

    #[test]
    fn bad_rows_are_named_by_row_and_line() {
        let repair = "; repair the file or export it again";
        assert_eq!(message("", "0 0 0\n0 nan 0\n1 1 1\n"), format!("vertex 1 (line 9): y is not finite{repair}"));
        assert_eq!(message("", "0 0 0\n0 0 -inf\n1 1 1\n"), format!("vertex 1 (line 9): z is not finite{repair}"));
        assert_eq!(
            message("", "0 0 0\n0 0 1e300\n1 1 1\n"),
            format!("vertex 1 (line 9): z is too large to be a coordinate{repair}")
        );
        assert_eq!(
            message("", "0 0 0\n0 0\n1 1 1 1\n"),
            format!("vertex 1 (line 9): the line has fewer numbers than the header declares{repair}")
        );
        assert_eq!(message("", "0 0 0\n0 0 x\n1 1 1\n"), format!("vertex 1 (line 9): \"x\" is no number{repair}"));
        let faces = "element face 1\nproperty list uchar int vertex_indices\n";
        assert_eq!(
            message(faces, "0 0 0\n0 0 1\n1 1 1\n3 0 1 3\n"),
            format!("face 0 (line 13): there is no vertex 3 among 3{repair}")
        );
        assert_eq!(
            message(faces, "0 0 0\n0 0 1\n1 1 1\n3 0 1 -1\n"),
            format!("face 0 (line 13): there is no vertex -1 among 3{repair}")
        );
    }

    #[test]
    fn a_grid_that_does_not_fit_is_refused() {
        let grid = |columns: &str, count: u32| {
            format!(
                "obj_info num_cols {columns}\nobj_info num_rows 2\nelement range_grid {count}\n\
                 property list uchar int vertex_indices\n"
            )
        };
        let vertices = "0 0 0\n0 0 1\n1 1 1\n";
        let error = message(&grid("2", 3), &format!("{vertices}0\n0\n0\n"));
        assert!(
            error.starts_with("header: num_cols 2 x num_rows 2 does not give the 3 pixels of range_grid;"),
            "{error}"
        );
        let error = message(&grid("9223372036854775809", 2), &format!("{vertices}0\n0\n0\n"));
        assert!(error.contains("does not give the 2 pixels"), "{error}");
        let error = message(&grid("1", 2), &format!("{vertices}0\n2 0 1\n"));
        assert!(
            error.starts_with("range_grid 1 (line 16): a pixel sees at most one vertex, this one lists 2"),
            "{error}"
        );
        let error = message(&grid("1", 2), &format!("{vertices}0\n1 9\n"));
        assert!(error.starts_with("range_grid 1 (line 16): there is no vertex 9 among 3"), "{error}");
    }

    #[test]
    fn limits_hold_for_points_faces_and_fans() {
        let text = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                    element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n1 1 0\n\
                    6 0 1 2 0 1 2\n";
        let limited = |max_points, max_faces| read(text.as_bytes(), &ReadLimits { max_points, max_faces });
        assert!(limited(3, 4).is_ok());
        let error = limited(2, 4).expect_err("three points").to_string();
        assert_eq!(error, "points 3 exceeds the limit of 2; thin the scan or raise the limit");
        assert_eq!(limited(3, 3), Err(FormatError::TooLarge { what: "faces", found: 4, limit: 3 }));
    }
}
