//! Textures: pictures in the file, and the colours of vertices in them.

use super::accessor::{Buffers, data_uri};
use super::document::{Document, TextureTransform, TextureUse, at};
use crate::FormatError;
use crate::budget::Budget;
use crate::image::Image;

const CLAMP: u32 = 33071;
const MIRROR: u32 = 33648;

/// A texture as a material uses it.
pub(super) struct Texture<'a> {
    picture: Image,
    /// Which of the coordinates of the vertices are meant.
    pub(super) coordinates: String,
    transform: Option<&'a TextureTransform>,
    wraps: [Option<u32>; 2],
}

impl<'a> Texture<'a> {
    /// Reads the picture of a texture; a reason in words if it can't be had, which costs the colours only.
    pub(super) fn read(
        document: &'a Document,
        buffers: &Buffers,
        used: &'a TextureUse,
        budget: &mut Budget,
    ) -> Result<Result<Texture<'a>, String>, FormatError> {
        let texture = at(&document.textures, "texture", used.index)?;
        let Some(source) = texture.source else {
            return Ok(Err(format!("texture {} is in a format that is not read here", used.index)));
        };
        let image = at(&document.images, "image", source)?;
        let unpacked;
        let bytes = match (image.buffer_view, &image.uri) {
            (Some(view), _) => buffers.view(view)?.0,
            (None, Some(uri)) => match data_uri(uri, &format!("image {source}"), budget)? {
                Some(bytes) => {
                    unpacked = bytes;
                    &unpacked
                }
                None => return Ok(Err(format!("texture {} is in another file", crate::quote(uri.as_bytes())))),
            },
            (None, None) => return Ok(Err(format!("image {source} has no bytes"))),
        };
        let picture = match Image::read(bytes, budget)? {
            Ok(picture) => picture,
            Err(problem) => return Ok(Err(format!("image {source} {problem}"))),
        };
        let sampler = texture.sampler.map(|index| at(&document.samplers, "sampler", index)).transpose()?;
        let transform = used.extensions.transform.as_ref();
        let set = transform.and_then(|transform| transform.tex_coord).unwrap_or(used.tex_coord);
        Ok(Ok(Texture {
            picture,
            coordinates: format!("TEXCOORD_{set}"),
            transform,
            wraps: sampler.map_or([None; 2], |sampler| [sampler.wrap_s, sampler.wrap_t]),
        }))
    }

    /// The colour at a vertex; v goes down, as in the picture.
    pub(super) fn color(&self, [u, v]: [f32; 2]) -> Option<[u8; 3]> {
        let mut place = [f64::from(u), f64::from(v)];
        if let Some(TextureTransform { offset, rotation, scale, .. }) = self.transform {
            let [width, height] = scale.unwrap_or([1.0; 2]);
            let [u, v] = [place[0] * width, place[1] * height];
            let (sine, cosine) = rotation.sin_cos();
            place = [offset[0] + cosine * u + sine * v, offset[1] - sine * u + cosine * v];
        }
        let wrapped = |axis: usize| match self.wraps[axis] {
            Some(CLAMP) => place[axis].clamp(0.0, 1.0),
            Some(MIRROR) => 1.0 - (place[axis].rem_euclid(2.0) - 1.0).abs(),
            _ => crate::image::repeated(place[axis]),
        };
        self.picture.color(wrapped(0), wrapped(1))
    }
}
