//! Values whose bounds their Rust types don't tell, as the contract describes them.
//!
//! Generated clients and checkers know of a value what stands here and nothing else: how many numbers a point has, what
//! a scan may be called, that a file is bytes and no list of numbers.

use utoipa::openapi::schema::{AdditionalProperties, ArrayBuilder, ObjectBuilder, SchemaType};
use utoipa::openapi::{KnownFormat, OneOfBuilder, RefOr, Schema, SchemaFormat, Type};
use utoipa::{PartialSchema, ToSchema};

use super::renditions;
use visage_domain::asset::Asset;
use visage_formats::written::Written;
use visage_formats::{surface_endings, surface_names};
use visage_picture::camera::Side;
use visage_report::Kind;

/// A side of a picture, 16 to 4096, as a regular expression.
const SIDE: &str = "(1[6-9]|[2-9][0-9]|[1-9][0-9]{2}|[1-3][0-9]{3}|40[0-8][0-9]|409[0-6])";

macro_rules! schemas {
    ($($(#[doc = $doc:literal])* $name:ident = $schema:expr;)*) => {
        $(
            $(#[doc = $doc])*
            pub struct $name;

            impl PartialSchema for $name {
                fn schema() -> RefOr<Schema> {
                    $schema.description(Some([$($doc.trim()),*].join(" "))).build().into()
                }
            }

            impl ToSchema for $name {}
        )*
    };
}

schemas! {
    /// A file, byte by byte.
    FileContent = file();
    /// A file name whose ending tells the format, or the path of such a file from a folder on (no control characters, no blank at
    /// either end of a part, no hidden folders).
    ScanName = text().pattern(Some(scan_name_pattern())).max_length(Some(255)).examples(["bun045.ply"]);
    /// A name or label: one line, not blank.
    ShortText = text().pattern(Some(short_text_pattern())).min_length(Some(1)).max_length(Some(200));
    /// A file that holds the surface of a model, or its thumbnail.
    SurfaceFile = text().enum_values(Some(file_names())).examples([Asset::Cloud.name()]);
    /// A format that clouds are written in, by its ending.
    CloudFormat = text().enum_values(Some(Written::Cloud.endings()));
    /// A format that meshes are written in, by its ending.
    MeshFormat = text().enum_values(Some(Written::Mesh.endings()));
    /// A format that poses are written in, by its ending, or `matrices`.
    PosesFormat = text().enum_values(Some(renditions::names_of_poses()));
    /// What placed scans are written as, by its ending.
    ScansFormat = text().enum_values(Some(renditions::names_of_scans()));
    /// A kind of picture of a model.
    PictureKind = text().enum_values(Some(Kind::ALL.iter().map(|kind| kind.name())));
    /// A kind of picture that is a plot.
    PlotKind = text().enum_values(Some(Kind::ALL.iter().filter(|kind| kind.is_plot()).map(|kind| kind.name())));
    /// Width x height in pixels, each from 16 to 4096.
    PictureSize = text().pattern(Some(format!("^{SIDE}x{SIDE}$"))).examples(["800x600"]);
    /// From which side a model is seen.
    PictureSide = text().enum_values(Some(Side::ALL.iter().map(|side| side.name())));
    /// An axis, and where on it.
    PicturePlane = text().pattern(Some(r"^[xyz](:-?[0-9]{1,9}(\.[0-9]{1,9})?)?$")).examples(["z:12.5"]);
    /// x, y and z.
    Point = list(number(), 3);
    /// A place in two scans: first in the one, then in the other.
    PickedPair = list(list(number(), 3), 2);
    /// Two scans by name.
    NamedPair = list(text(), 2);
    /// Three points.
    Corners = list(list(number(), 3), 3);
    /// 4x4, row by row.
    Matrix = list(list(number(), 4), 4);
    /// Places by name; right and left are the subject's own.
    Landmarks = map(list(number(), 3));
    /// Units of length by scan name.
    ScanUnits = map(text().enum_values(Some(["mm", "cm", "m", "in"])));
    /// Motions by scan name, 4x4, row-major, each from its scan to the world; null for a scan without a place.
    Poses = map(OneOfBuilder::new().item(list(list(number(), 4), 4)).item(null()));
}

/// The files of models that are sent as they are.
fn file_names() -> Vec<String> {
    Asset::surface_names().into_iter().chain([Asset::Thumbnail.name().into_owned()]).collect()
}

/// One of some words.
pub fn choice(words: Vec<&'static str>, about: &str) -> RefOr<Schema> {
    text().enum_values(Some(words)).description(Some(about)).build().into()
}

/// What may be sent as the part `scans` of a form.
fn about_scans() -> String {
    format!(
        "The scans: {} files, each with a name of its own; E57 and PTX files may hold several. Or archives (.zip, .tar, .tar.gz, \
         .tgz) of a whole set: scans or depth images with their intrinsics, and poses.",
        surface_names()
    )
}

/// The part `scans` of a form that may have none.
pub fn scans() -> Schema {
    ArrayBuilder::new().items(file()).description(Some(about_scans())).build().into()
}

/// The part `scans` of a form that is to be registered.
pub fn scans_to_register() -> Schema {
    let about = format!("{} At least two scans in all.", about_scans());
    ArrayBuilder::new().items(file()).min_items(Some(1)).description(Some(about)).build().into()
}

/// A file with the surface of a model.
pub fn model() -> Schema {
    file().description(Some(format!("A mesh or cloud: {}.", surface_names()))).build().into()
}

/// A file with the surface that a standard is made of.
pub fn model_of_class() -> Schema {
    let about = format!(
        "A mesh or cloud of one model of the class: {}. A mesh that is not closed must be wound outward.",
        surface_names()
    );
    file().description(Some(about)).build().into()
}

fn file() -> ObjectBuilder {
    text().format(Some(SchemaFormat::KnownFormat(KnownFormat::Binary)))
}

pub(super) fn text() -> ObjectBuilder {
    ObjectBuilder::new().schema_type(Type::String)
}

pub(super) fn number() -> ObjectBuilder {
    ObjectBuilder::new().schema_type(Type::Number).format(Some(SchemaFormat::KnownFormat(KnownFormat::Double)))
}

pub(super) fn null() -> ObjectBuilder {
    ObjectBuilder::new().schema_type(Type::Null)
}

pub(super) fn list(item: impl Into<RefOr<Schema>>, length: usize) -> ArrayBuilder {
    ArrayBuilder::new().items(item.into()).min_items(Some(length)).max_items(Some(length))
}

fn map(value: impl Into<RefOr<Schema>>) -> ObjectBuilder {
    ObjectBuilder::new()
        .schema_type(SchemaType::new(Type::Object))
        .additional_properties(Some(AdditionalProperties::RefOr(value.into())))
}

/// `names::scan_name` as a regular expression of ECMA 262; a test holds them against each other.
fn scan_name_pattern() -> String {
    let either = |c: char| format!("[{}{}]", c.to_ascii_lowercase(), c.to_ascii_uppercase());
    let endings: Vec<String> = surface_endings().iter().map(|ending| ending.chars().map(either).collect()).collect();
    let plain = r"/\\\u0000-\u001f\u007f-\u009f";
    let folder = format!(r"[^\s.{plain}]([^{plain}]*[^\s{plain}])?/");
    format!(r"^({folder})*([^\s{plain}][^{plain}]*)?\.({})(\.[gG][zZ])?$", endings.join("|"))
}

/// `names::text` as a regular expression of ECMA 262.
fn short_text_pattern() -> String {
    let control = r"\u0000-\u001f\u007f-\u009f";
    format!("^[^{control}]*[^\\s{control}][^{control}]*$")
}

#[cfg(test)]
mod tests {
    use super::super::names;
    use super::*;

    /// Names at the borders of the rules, and inside.
    const NAMES: [&str; 38] = [
        "a.ply",
        "A.PLY",
        "a.b.pcd",
        "ete\u{301}.obj",
        "\u{e9}.oBj",
        "..ply",
        ".ply",
        "a b.ply",
        "a .ply",
        "a\u{a0}.ply",
        "ply",
        "a.ply.gz",
        "a.PLY.Gz",
        "a.gz",
        "a.ply.gz.gz",
        "a.stl",
        "a.plyx",
        "",
        ".",
        "..",
        "x/a.ply",
        "x y/.z.ply",
        "x/y/.ply",
        "/a.ply",
        "x//a.ply",
        "../a.ply",
        "x/../a.ply",
        ".x/a.ply",
        "x /a.ply",
        " x/a.ply",
        "x\\a.ply",
        " a.ply",
        "\u{2003}a.ply",
        "a.ply ",
        "a\n.ply",
        "a.ply\n",
        "a\u{7f}.ply",
        "\u{85}a.ply",
    ];

    #[test]
    fn scan_names_are_told_as_they_are_checked() {
        let pattern = regex::Regex::new(&scan_name_pattern()).expect("a regular expression");
        for name in NAMES {
            assert_eq!(pattern.is_match(name), names::scan_name(name).is_ok(), "{name:?}");
        }
        assert!(names::scan_name(&format!("{}.ply", "x".repeat(251))).is_ok());
        assert!(names::scan_name(&format!("{}.ply", "x".repeat(252))).is_err());
    }

    #[test]
    fn sizes_and_planes_are_told_as_they_are_checked() {
        let size = regex::Regex::new(&format!("^{SIDE}x{SIDE}$")).expect("a regular expression");
        for side in
            [0, 1, 15, 16, 19, 20, 99, 100, 999, 1000, 3999, 4000, 4089, 4090, 4096, 4097, 4100, 5000, 9999, 16000]
        {
            let text = format!("{side}x800");
            assert_eq!(size.is_match(&text), text.parse::<visage_picture::size::Size>().is_ok(), "{text}");
        }
        assert_eq!(Side::ALL.len(), 7);
    }

    #[test]
    fn names_and_labels_are_told_as_they_are_checked() {
        let pattern = regex::Regex::new(&short_text_pattern()).expect("a regular expression");
        for text in ["face", " a ", "a b", "\u{e9}", "", " ", "\u{2003}", "a\nb", "a\n", "\ta", "\u{80}", "a\u{9f}"] {
            // blanks around a text are taken off, of whatever kind: the contract is stricter with line ends there
            let trims_control = text.trim() != text && text.chars().any(char::is_control);
            let is_sound = names::text("label", text).is_ok() && !trims_control;
            assert_eq!(pattern.is_match(text), is_sound, "{text:?}");
        }
    }
}
