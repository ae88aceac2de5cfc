//! The files that are kept of models and standards. Their names stand here and nowhere else.

use std::borrow::Cow;

use visage_formats::{Content, Format, poses};

/// Where a model comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// A job made it of scans.
    Registered,
    /// A user sent it as it is.
    Uploaded,
}

/// What a file is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Where each scan is.
    Poses,
    /// What a run found out.
    Report,
    /// Points of a surface.
    Cloud,
    /// Triangles of a surface.
    Mesh,
    /// The surface of a standard, cloud or mesh.
    Standard,
    /// What a model looks like.
    Picture,
}

/// What a file is to its model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Role {
    /// What it is.
    pub kind: Kind,
    /// Whether a run made it or a user sent it.
    pub origin: Origin,
    /// Whether the signature of the model is made anew from it.
    pub makes_signature: bool,
}

impl Role {
    fn new(kind: Kind, origin: Origin, makes_signature: bool) -> Self {
        Role { kind, origin, makes_signature }
    }
}

const JSON: &str = poses::JSON.media_type;

/// The files that a registration makes: one line each, in the order in which they are written. `jobs::artifacts` says
/// what they hold.
macro_rules! assets {
    ($(
        $(#[$doc:meta])*
        $asset:ident = $name:literal, $media_type:expr, $kind:ident, signature: $signature:literal;
    )*) => {
        /// A file of a model or a standard.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Asset {
            $($(#[$doc])* $asset,)*
            /// The mesh that a user sent as a model.
            UploadedMesh(&'static Format),
            /// The cloud that a user sent as a model.
            UploadedCloud(&'static Format),
            /// What an uploaded model looks like at a glance, drawn when it is stored: it need not be read again to be shown.
            Thumbnail,
            /// The surface of a standard, whose landmarks a user named.
            Annotated(&'static Format),
        }

        impl Asset {
            /// What a registration makes, in the order in which it is written.
            pub const RESULTS: &'static [Asset] = &[$(Asset::$asset),*];

            /// Its name, on disk and in the API.
            pub fn name(self) -> Cow<'static, str> {
                match self {
                    $(Asset::$asset => $name.into(),)*
                    Asset::UploadedMesh(format) => format!("mesh.{}", format.ending()).into(),
                    Asset::UploadedCloud(format) => format!("cloud.{}", format.ending()).into(),
                    Asset::Thumbnail => "thumbnail.png".into(),
                    Asset::Annotated(format) => format!("model.{}", format.ending()).into(),
                }
            }

            /// The media type that it is sent as.
            pub fn media_type(self) -> &'static str {
                match self {
                    $(Asset::$asset => $media_type,)*
                    Asset::UploadedMesh(format) | Asset::UploadedCloud(format) | Asset::Annotated(format) => {
                        format.media_type
                    }
                    Asset::Thumbnail => "image/png",
                }
            }

            /// What it is to its model.
            pub fn role(self) -> Role {
                match self {
                    $(Asset::$asset => Role::new(Kind::$kind, Origin::Registered, $signature),)*
                    Asset::UploadedMesh(_) => Role::new(Kind::Mesh, Origin::Uploaded, true),
                    Asset::UploadedCloud(_) => Role::new(Kind::Cloud, Origin::Uploaded, true),
                    Asset::Thumbnail => Role::new(Kind::Picture, Origin::Uploaded, false),
                    Asset::Annotated(_) => Role::new(Kind::Standard, Origin::Uploaded, false),
                }
            }
        }
    };
}

assets! {
    /// Where each scan is: its motion to the world, null for one without a place.
    Poses = "poses.json", JSON, Poses, signature: false;
    /// The same in Stanford's format, where that can hold it.
    PosesConf = "poses.conf", poses::CONF.media_type, Poses, signature: false;
    /// The merged cloud of the placed scans.
    Cloud = "cloud.ply", visage_formats::ply::FORMAT.media_type, Cloud, signature: true;
    /// The surface of that cloud. Signatures are made from the cloud: a mesh of this name describes an upload alone.
    Mesh = "mesh.ply", visage_formats::ply::FORMAT.media_type, Mesh, signature: false;
    /// A copy of that surface that pages can show large: where it has many more triangles.
    Medium = "medium.glb", visage_formats::gltf::GLB.media_type, Mesh, signature: false;
    /// A small copy of that surface.
    Preview = "preview.glb", visage_formats::gltf::GLB.media_type, Mesh, signature: false;
    /// What the registration found out, and what it took.
    Report = "report.json", JSON, Report, signature: false;
}

impl Asset {
    /// The files that a model of this origin may have, the best first of those that describe it.
    pub fn of(origin: Origin) -> Vec<Asset> {
        let holding = |content| Format::surfaces().filter(move |format| format.holds.contains(&content));
        match origin {
            Origin::Registered => Asset::RESULTS.to_vec(),
            Origin::Uploaded => {
                let meshes = holding(Content::Mesh).map(Asset::UploadedMesh);
                let clouds = holding(Content::Points).map(Asset::UploadedCloud);
                meshes.chain(clouds).chain([Asset::Thumbnail]).collect()
            }
        }
    }

    /// Whether it shows less than another file of the same model.
    pub fn is_coarse_copy(self) -> bool {
        matches!(self, Asset::Medium | Asset::Preview)
    }

    /// The names of the files that the signature of a model may be made anew from, the best first.
    pub fn describing(origin: Origin) -> Vec<Cow<'static, str>> {
        Asset::of(origin).into_iter().filter(|asset| asset.role().makes_signature).map(Asset::name).collect()
    }

    /// The file of this name of a model of this origin. A result is never taken for an upload of the same name.
    pub fn named(name: &str, origin: Origin) -> Option<Asset> {
        Asset::of(origin).into_iter().find(|asset| asset.name() == name)
    }

    /// The media type of the file of this name, whatever the origin of its model: no name has two.
    pub fn media_type_of(name: &str) -> Option<&'static str> {
        let asset = Asset::named(name, Origin::Registered).or_else(|| Asset::named(name, Origin::Uploaded));
        asset.map(Asset::media_type)
    }

    /// What a user's file is kept as: under the name that such a file has for every model.
    pub fn uploaded(format: &'static Format, is_mesh: bool) -> Asset {
        if is_mesh { Asset::UploadedMesh(format) } else { Asset::UploadedCloud(format) }
    }

    /// The names of all files of models that hold a surface, each once: clouds, then meshes.
    pub fn surface_names() -> Vec<String> {
        let all = || [Origin::Registered, Origin::Uploaded].into_iter().flat_map(Asset::of);
        let mut names: Vec<String> = Vec::new();
        for kind in [Kind::Cloud, Kind::Mesh] {
            for asset in all().filter(|asset| asset.role().kind == kind) {
                let name = asset.name().into_owned();
                if !names.contains(&name) {
                    names.push(name);
                }
            }
        }
        names
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use visage_formats::Format;

    #[test]
    fn every_name_is_found_again_and_a_result_is_no_upload() {
        for origin in [Origin::Registered, Origin::Uploaded] {
            for asset in Asset::of(origin) {
                assert_eq!(Asset::named(&asset.name(), origin), Some(asset));
                assert_eq!(asset.role().origin, origin);
                assert_eq!(Asset::media_type_of(&asset.name()), Some(asset.media_type()));
            }
        }
        // the mesh of a result is not what its signature is made from
        assert_eq!(Asset::named("mesh.ply", Origin::Registered), Some(Asset::Mesh));
        assert!(!Asset::Mesh.role().makes_signature);
        let uploaded = Asset::named("mesh.ply", Origin::Uploaded).expect("an upload");
        assert!(uploaded.role().makes_signature && uploaded.role().kind == Kind::Mesh);
        let result = Asset::named("cloud.ply", Origin::Registered).expect("a result");
        assert_ne!(Some(result), Asset::named("cloud.ply", Origin::Uploaded));
    }

    #[test]
    fn a_registered_model_is_described_by_its_cloud_and_an_uploaded_one_by_its_file() {
        assert_eq!(Asset::describing(Origin::Registered), ["cloud.ply"]);
        let uploads = Asset::describing(Origin::Uploaded);
        assert_eq!(uploads.len() + 1, Asset::of(Origin::Uploaded).len(), "a thumbnail describes nothing");
        assert_eq!(uploads[0], "mesh.ply", "a mesh before a cloud");
    }

    #[test]
    fn surfaces_are_sent_as_the_table_of_formats_says() {
        for asset in Asset::of(Origin::Uploaded).into_iter().filter(|asset| *asset != Asset::Thumbnail) {
            let format = visage_formats::check_name(&asset.name()).expect("a format that is read");
            assert_eq!(asset.media_type(), format.media_type);
        }
        assert_eq!(Asset::Cloud.media_type(), Asset::UploadedCloud(&visage_formats::pcd::FORMAT).media_type());
        assert_eq!(Asset::Report.media_type(), "application/json");
    }

    #[test]
    fn a_surface_of_any_format_that_is_read_has_a_name() {
        let names = Asset::surface_names();
        assert_eq!(names[0], "cloud.ply");
        // a format whose files end in several ways is stored under the first of them
        for ending in Format::surfaces().map(Format::ending) {
            assert!(names.iter().any(|name| name.ends_with(&format!(".{ending}"))), "{names:?}");
        }
        assert!(!names.contains(&"mesh.pcd".to_owned()), "a PCD has no triangles");
    }
}
