//! The kinds of pictures of a model.

use visage_geometry::names::UnknownName;
use visage_picture::size::Size;

/// A file of a model that a picture may be made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// A small copy of the mesh.
    Preview,
    /// The mesh.
    Mesh,
    /// The cloud.
    Cloud,
}

/// A kind of picture: one line each. What is shown, of which files (the first that there is), whether it is a plot, its usual size.
macro_rules! kinds {
    ($(
        $(#[doc = $doc:literal])*
        $kind:ident = $name:literal, of: [$($source:ident),*], plot: $plot:literal, size: $width:literal x $height:literal;
    )*) => {
        /// What is shown of a model.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, strum::VariantArray, strum::IntoStaticStr, strum::EnumString, strum::Display)]
        #[strum(parse_err_ty = UnknownName, parse_err_fn = no_kind)]
        pub enum Kind {
            $($(#[doc = $doc])* #[strum(serialize = $name)] $kind,)*
        }

        impl Kind {
            /// All of them.
            pub const ALL: &[Kind] = <Kind as strum::VariantArray>::VARIANTS;

            /// As it is named in the API.
            pub fn name(self) -> &'static str {
                self.into()
            }

            /// What it shows, a sentence.
            pub fn about(self) -> &'static str {
                match self {
                    $(Kind::$kind => concat!($($doc),*).trim(),)*
                }
            }

            /// The files that it may be made of, the best first; none if it is made of the report.
            pub fn sources(self) -> &'static [Source] {
                match self {
                    $(Kind::$kind => &[$(Source::$source),*],)*
                }
            }

            /// Whether it is a plot, which is written as SVG too.
            pub fn is_plot(self) -> bool {
                match self {
                    $(Kind::$kind => $plot,)*
                }
            }

            /// Its size if no other is wished.
            pub fn size(self) -> Size {
                match self {
                    $(Kind::$kind => Size::clamped($width, $height),)*
                }
            }
        }
    };
}

kinds! {
    /// The model at a glance.
    Thumbnail = "thumbnail", of: [Preview, Mesh, Cloud], plot: false, size: 256 x 192;
    /// The surface in light and shadow, from any of six sides.
    Shaded = "shaded", of: [Mesh, Cloud], plot: false, size: 1024 x 768;
    /// The points of each scan in a colour of their own: where colours mingle finely, scans lie on each other.
    Views = "views", of: [Cloud], plot: false, size: 1024 x 768;
    /// The points near a plane, each scan in its colour, with a part magnified: lines that are double are scans that don't agree.
    Section = "section", of: [Cloud, Mesh], plot: false, size: 1024 x 768;
    /// The same section with each scan where it was before its pose was refined.
    Start = "start", of: [Cloud], plot: false, size: 1024 x 768;
    /// How much was measured at each place of the surface; what nobody saw was filled in.
    Support = "support", of: [Mesh], plot: false, size: 1024 x 768;
    /// Where the surface stands out from what is about it.
    Saliency = "saliency", of: [Mesh, Cloud], plot: false, size: 1024 x 768;
    /// The salient regions, and the triangle of eyes and nose that resembles a face most.
    Regions = "regions", of: [Mesh, Cloud], plot: false, size: 1024 x 768;
    /// The places of the face, by name.
    Landmarks = "landmarks", of: [Mesh, Cloud], plot: false, size: 1024 x 768;
    /// How far the surface is from that of another model: red outside of it, blue inside.
    Deviation = "deviation", of: [Mesh, Cloud], plot: false, size: 1024 x 768;
    /// The share of each scan that the others saw too.
    Overlap = "overlap", of: [], plot: true, size: 900 x 760;
    /// Which scans hold which in place; weak links are marked.
    Graph = "graph", of: [], plot: true, size: 900 x 760;
    /// How the poses came to rest.
    Convergence = "convergence", of: [], plot: true, size: 900 x 600;
}

fn no_kind(text: &str) -> UnknownName {
    UnknownName::of::<Kind>("kind of picture", text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_is_found_by_its_name_and_says_what_it_shows() {
        for kind in Kind::ALL {
            assert_eq!(kind.name().parse(), Ok(*kind));
            assert!(kind.about().ends_with('.') && !kind.about().contains("  "), "{}", kind.about());
            assert_eq!(kind.sources().is_empty(), kind.is_plot(), "{kind}");
        }
        assert!("portrait".parse::<Kind>().is_err_and(|error| error.names().contains("thumbnail, shaded")));
    }
}
