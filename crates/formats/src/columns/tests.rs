use super::*;
use visage_geometry::{Cloud, Point3};

fn read_as(format: Format, text: &str) -> Result<Reading, FormatError> {
    match format.reader {
        Reader::Surface(read) => read(text.as_bytes(), &ReadLimits::default()),
        _ => panic!("{format:?} is read as a surface"),
    }
}

fn read_text(text: &str) -> Result<Reading, FormatError> {
    read_as(XYZ, text)
}

fn message(text: &str) -> String {
    read_text(text).expect_err(text).to_string()
}

fn points(reading: &Reading) -> Vec<[f64; 3]> {
    reading.surface.cloud.points.iter().map(|p| [p.x, p.y, p.z]).collect()
}

const TWO: [[f64; 3]; 2] = [[1.5, 2.0, -3.25], [4.0, 5.5, 600000.125]];

#[test]
fn values_may_be_parted_and_written_in_many_ways() {
    for text in [
        "1.5 2 -3.25\n4 5.5 600000.125\n",
        "1.5\t2\t-3.25\r\n4\t5.5\t6.00000125e5\r\n",
        "1.5,2,-3.25\r4,5.5,600000.125",
        "  1.5, 2 , -3.25\n\n4, 5.5, 600000.125\n",
        "1,5;2;-3,25\n4;5,5;600000,125\n",
        "1,5 2 -3,25\n4 5,5 600000,125\n",
        "2\n1.5 2 -3.25\n4 5.5 600000.125\n",
        "\u{feff}# a comment\n// another, 1 2 3\nx y z\n1.5 2 -3.25\n; more\n4 5.5 600000.125\n",
        "\"x\",\"y\",\"z\"\n\"1.5\",\"2\",\"-3.25\"\n\"4\",\"5.5\",\"600000.125\"\n",
        "z;x;y\n-3,25;1,5;2\n600000,125;4;5,5\n",
    ] {
        let reading = read_text(text).expect(text);
        assert_eq!(points(&reading), TWO, "{text}");
        assert!(reading.dropped.is_empty(), "{text}: {}", reading.dropped);
    }
}

#[test]
fn names_say_what_columns_are() {
    let text = "//X Y Z R G B Nx Ny Nz Scalar_Intensity Time\n1 2 3 255 0 9 0 0 2 0.5 noon\n4 5 6 1 2 3 1 0 0 7 late\n";
    let cloud = read_text(text).expect("named").surface.cloud;
    assert_eq!(cloud.colors, Some(vec![[255, 0, 9], [1, 2, 3]]));
    assert_eq!(cloud.normals, Some(vec![nalgebra::Vector3::z(), nalgebra::Vector3::x()]));
    assert_eq!(cloud.intensities, Some(vec![0.5, 7.0]));
    let table = "id,label,x[mm],y[mm],z[mm],r,g,b\n7,door,1,2,3,0.5,0,1.0\n9,,4,5,6,,,\n";
    let reading = read_text(table).expect("a table");
    assert_eq!(points(&reading), [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
    assert_eq!(reading.unit.and_then(crate::DeclaredUnit::unit), Some(visage_geometry::Unit::Mm));
    assert_eq!((reading.surface.cloud.colors, reading.dropped.colors), (Some(vec![[128, 0, 255], [0; 3]]), 1));
    // dark, but whole numbers
    let dark = read_text("x y z r g b\n0 0 0 1 0 0\n1 1 1 0 1 1\n").expect("dark").surface.cloud;
    assert_eq!(dark.colors, Some(vec![[1, 0, 0], [0, 1, 1]]));
}

#[test]
fn columns_without_names_are_what_they_look_like_or_nothing() {
    let row = |tail: &str| format!("0.5 1 2 {tail}\n3 4 5 {tail}\n");
    let color = read_text(&row("200 0 17")).expect("a colour");
    assert_eq!((color.surface.cloud.colors, color.dropped.notes.len()), (Some(vec![[200, 0, 17]; 2]), 0));
    let both = read_text(&row("200 0 17 0.6 0 -0.8")).expect("both").surface.cloud;
    assert_eq!((both.colors, both.normals.map(|normals| normals[1].z)), (Some(vec![[200, 0, 17]; 2]), Some(-0.8)));
    for doubtful in ["9", "0.5 0.5 0.5", "0 0 1", "1 2 3 4", "1 2 3 4 5 6", "door", "300 0 0"] {
        let reading = read_text(&row(doubtful)).expect(doubtful);
        let Cloud { normals, colors, intensities, points } = reading.surface.cloud;
        assert_eq!((normals, colors, intensities, points.len()), (None, None, None, 2), "{doubtful}");
        let note = &reading.dropped.notes[0];
        assert!(note.contains("column 4") && note.contains("not used: nothing says for sure"), "{note}");
    }
}

#[test]
fn what_the_first_rows_seem_to_be_must_hold_to_the_last() {
    let mut text = "0.5 1 2 200 0 17\n".repeat(5000);
    text.push_str("3 4 5 201.5 0 17\n");
    let reading = read_text(&text).expect("points");
    assert_eq!((reading.surface.cloud.len(), reading.surface.cloud.colors), (5001, None));
    assert_eq!(reading.dropped.notes, ["columns 4 to 6 are not used: they look like colours, but not in line 5001"]);
}

#[test]
fn a_column_that_counts_is_no_x() {
    let rows = |count: usize| (0..count).map(|k| format!("{} 0.5 {k} 7\n", k + 100)).collect::<String>();
    let reading = read_text(&rows(20)).expect("counted");
    assert_eq!(points(&reading)[3], [0.5, 3.0, 7.0]);
    assert_eq!(reading.dropped.notes, ["column 1 is passed over: it counts the points"]);
    let broken = rows(2000) + "5 0.5 1 7\n";
    let error = message(&broken);
    assert!(
        error.starts_with("line 2001: the first column counts the points in the lines before, but not here"),
        "{error}"
    );
}

#[test]
fn the_ending_says_what_six_columns_are() {
    let text = "0 0 0 0 0 1\n1 1 1 0 1 0\n";
    let normals = read_as(XYZN, text).expect("normals").surface.cloud;
    assert_eq!((normals.normals, normals.colors), (Some(vec![nalgebra::Vector3::z(), nalgebra::Vector3::y()]), None));
    let colors = read_as(XYZRGB, &text.replace("0 0 1", "0.0 0.0 1.0")).expect("colours").surface.cloud;
    assert_eq!((colors.normals, colors.colors), (None, Some(vec![[0, 0, 255], [0, 255, 0]])));
}

#[test]
fn pts_has_counts_intensities_and_colours() {
    let block = "2\n0.5 0 0 -1402 255 0 9\n1 1 1 17 0 0 0\n";
    let cloud = read_as(PTS, &block.repeat(2)).expect("two blocks").surface.cloud;
    assert_eq!(cloud.intensities, Some(vec![-1402.0, 17.0, -1402.0, 17.0]));
    assert_eq!(cloud.colors.expect("colours")[..2], [[255, 0, 9], [0; 3]]);
    assert_eq!(read_as(PTS, "1\n1 2 3 4\n").expect("four").surface.cloud.intensities, Some(vec![4.0]));
    assert_eq!(read_as(PTS, "1\n1 2 3 40 50 60\n").expect("six").surface.cloud.colors, Some(vec![[40, 50, 60]]));
    let cut = read_as(PTS, "3\n0.5 0 0 1\n0.5 0 0 1\n").expect_err("cut").to_string();
    assert!(cut.starts_with("the file is cut short: it declares 3 points but ends within point 2"), "{cut}");
    let cut = read_as(PTS, "99999999999\n0.5 0 0 1\n").expect_err("cut").to_string();
    assert!(
        cut.starts_with("the file is cut short: it declares 99999999999 points but ends within the 11 bytes"),
        "{cut}"
    );
    let more = read_as(PTS, "1\n1 2 3 4\n1 2 3 4\n").expect("more").dropped.notes;
    assert_eq!(more, ["1 points are declared, there are 2: all are read"]);
}

#[test]
fn what_is_wrong_is_named_by_line() {
    let cases = [
        ("1 2 3\n4 5\n", "line 2: it has 2 values, but line 1 has 3; repair"),
        ("1 2 3\n4 5 6 7\n", "line 2: it has 4 values, but line 1 has 3; repair"),
        ("1 2 3\n4 five 6\n", "line 2: \"five\" is no number; repair"),
        ("1;2;3\n1,5;2;3,000.5\n", "line 2: \"3,000.5\" is no number; repair"),
        ("1 2 3\n7\n4 5 6\n", "line 2: one number, 7, stands where a point is expected; repair"),
        ("lat,lon,alt\n1,2,3\n", "line 1: the header names no x, y and z: \"lat,lon,alt\"; name the columns"),
        ("x y z i\n1 2 3\n", "line 1: the header names 4 columns, but the rows have 3; name the columns"),
        ("C 0 0 0\n", "line 1: column 1 is \"C\", where a coordinate is expected; name the columns"),
        ("x[m] y[m] z[mm]\n1 2 3\n", "line 1: the axes have different units"),
        ("1 2 1e20\n", "line 1: z is 1e20, which is too large to be a coordinate"),
        ("ncols 4\nnrows 2\n1 2 3 4\n", "line 1: this is a grid of heights (Esri ASCII), no list of points"),
        ("a letter\nto you\n", "the whole file: no line holds a point, three numbers or more; line 1 is \"a letter\""),
        ("", "the whole file: no line holds a point, three numbers or more; the file is empty; send one point a line"),
        ("1 2\0 3\n", "byte 0: this is no text"),
        ("nan nan nan\n", "the whole file: there are no points"),
    ];
    for (text, start) in cases {
        let error = message(text);
        assert!(error.starts_with(start), "{error}");
    }
    let limits = ReadLimits { max_points: 1, ..ReadLimits::default() };
    assert_eq!(read(b"1 2 3\n4 5 6\n", &limits), Err(FormatError::TooLarge { what: "points", found: 2, limit: 1 }));
}

#[test]
fn points_without_a_return_and_titles_cost_nothing_else() {
    let reading = read_text("Scan of a door\n1 2 3\nnan nan nan\n-1.#IND 0 0\n4 5 6\n").expect("two");
    assert_eq!((points(&reading).len(), reading.dropped.no_return), (2, 2));
    assert_eq!(reading.dropped.notes, ["line 1 is passed over: \"Scan of a door\""]);
}

#[test]
fn what_is_written_comes_back_with_all_attributes() {
    let cloud = Cloud {
        points: vec![Point3::new(1.0 / 3.0, -1e-9, 4.5e6 + 0.001), Point3::new(0.0, 1.0, 2.0)],
        normals: Some(vec![nalgebra::Vector3::x(), nalgebra::Vector3::new(0.6, 0.0, 0.8)]),
        colors: Some(vec![[1, 0, 1], [0, 1, 0]]),
        intensities: Some(vec![0.1, -7.0]),
    };
    let text = write_cloud(&cloud);
    assert!(text.starts_with(b"# x y z nx ny nz red green blue intensity\n"));
    assert_eq!(read(&text, &ReadLimits::default()).expect("own files").surface.cloud, cloud);
}

#[test]
fn a_line_without_end_takes_no_memory_of_its_own() {
    let error = message(&"1 ".repeat(100_000));
    assert!(error.starts_with("columns 257 exceeds the limit of 256"), "{error}");
}
