//! Buffers, and the numbers in them.

use base64::Engine;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

use super::REPAIR;
use super::document::{Accessor, Document, SparsePart, at};
use crate::FormatError;
use crate::budget::Budget;

/// Base64 as data URIs have it, padded or not.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &base64::alphabet::STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true),
);

/// The bytes of a data URI; `None` if it is none.
pub(super) fn data_uri(uri: &str, place: &str, budget: &mut Budget) -> Result<Option<Vec<u8>>, FormatError> {
    let Some((head, text)) = uri.strip_prefix("data:").and_then(|rest| rest.split_once(',')) else {
        return Ok(None);
    };
    if !head.ends_with(";base64") {
        return Err(FormatError::malformed(place, "its data URI is not in base64", REPAIR));
    }
    budget.take(text.len() as u64, 1)?;
    let bytes = BASE64.decode(text.as_bytes());
    bytes.map(Some).map_err(|error| FormatError::malformed(place, format!("its data URI: {error}"), REPAIR))
}

/// All buffers of a file.
pub(super) struct Buffers<'a> {
    document: &'a Document<'a>,
    bytes: Vec<Bytes<'a>>,
}

enum Bytes<'a> {
    Here(&'a [u8]),
    Unpacked(Vec<u8>),
}

impl Bytes<'_> {
    fn all(&self) -> &[u8] {
        match self {
            Bytes::Here(bytes) => bytes,
            Bytes::Unpacked(bytes) => bytes,
        }
    }
}

impl<'a> Buffers<'a> {
    pub(super) fn of(
        document: &'a Document<'a>,
        binary: Option<&'a [u8]>,
        budget: &mut Budget,
    ) -> Result<Self, FormatError> {
        let mut all = Vec::with_capacity(document.buffers.len());
        for (index, buffer) in document.buffers.iter().enumerate() {
            let place = format!("buffer {index}");
            let bytes = match (&buffer.uri, binary) {
                (None, Some(binary)) if index == 0 => Bytes::Here(binary),
                // a buffer of compressed geometry may have no bytes of its own
                (None, _) => Bytes::Here(&[]),
                (Some(uri), _) => match data_uri(uri, &place, budget)? {
                    Some(bytes) => Bytes::Unpacked(bytes),
                    None => {
                        let problem = format!("it is in another file, {}", crate::quote(uri.as_bytes()));
                        return Err(FormatError::malformed(place, problem, "export it as one file, as .glb"));
                    }
                },
            };
            let found = bytes.all().len() as u64;
            if buffer.byte_length > found {
                let declared = format!("{} bytes of {place}", buffer.byte_length);
                return Err(FormatError::Truncated { declared, found: format!("the {found} that are there") });
            }
            all.push(bytes);
        }
        Ok(Buffers { document, bytes: all })
    }

    /// The bytes of a view, and its stride.
    pub(super) fn view(&self, index: usize) -> Result<(&[u8], Option<u64>), FormatError> {
        let view = at(&self.document.views, "bufferView", index)?;
        let buffer = at(&self.bytes, "buffer", view.buffer)?.all();
        let start = usize::try_from(view.byte_offset).ok();
        let bytes = start.and_then(|start| buffer.get(start..));
        let bytes = bytes.and_then(|rest| rest.get(..usize::try_from(view.byte_length).ok()?));
        let bytes = bytes.ok_or_else(|| {
            let problem = format!("it goes beyond the {} bytes of buffer {}", buffer.len(), view.buffer);
            FormatError::malformed(format!("bufferView {index}"), problem, REPAIR)
        })?;
        Ok((bytes, view.byte_stride))
    }

    /// The values of an accessor with `N` components; of one with more the first `N`, of one with fewer zeros behind.
    pub(super) fn values<const N: usize>(
        &self,
        index: usize,
        budget: &mut Budget,
    ) -> Result<Vec<[f32; N]>, FormatError> {
        let accessor = at(&self.document.accessors, "accessor", index)?;
        let rows = self.rows(index, accessor)?;
        budget.take(accessor.count, size_of::<[f32; N]>())?;
        let mut values = vec![[0.0; N]; accessor.count as usize];
        if let Some(rows) = &rows {
            values.iter_mut().enumerate().for_each(|(index, value)| rows.get(index, value));
        }
        if let Some(sparse) = &accessor.sparse {
            let kind = sparse.indices.component_type.unwrap_or_default();
            let places = self.part(index, &sparse.indices, kind, 1, false, sparse.count)?;
            let (kind, width) = (accessor.component_type, width(index, accessor)?);
            let changed = self.part(index, &sparse.values, kind, width, accessor.normalized, sparse.count)?;
            for row in 0..sparse.count as usize {
                match values.get_mut(places.index(row) as usize) {
                    Some(value) => changed.get(row, value),
                    None => return Err(wrong(index, format!("it changes a value beyond its {}", accessor.count))),
                }
            }
        }
        Ok(values)
    }

    /// The values of an accessor as indices.
    pub(super) fn indices(&self, index: usize, budget: &mut Budget) -> Result<Vec<u32>, FormatError> {
        let accessor = at(&self.document.accessors, "accessor", index)?;
        if accessor.sparse.is_some() {
            return Err(wrong(index, "indices are sparse".into()));
        }
        let rows = self.rows(index, accessor)?.ok_or_else(|| wrong(index, "indices have no bytes".into()))?;
        if matches!(accessor.component_type, I8 | I16 | F32) {
            return Err(wrong(index, "indices are no whole numbers from 0".into()));
        }
        budget.take(accessor.count, size_of::<u32>())?;
        Ok((0..accessor.count as usize).map(|row| rows.index(row)).collect())
    }

    /// How many values an accessor has.
    pub(super) fn count(&self, index: usize) -> Result<u64, FormatError> {
        at(&self.document.accessors, "accessor", index).map(|accessor| accessor.count)
    }

    /// How many numbers a value of an accessor has.
    pub(super) fn width(&self, index: usize) -> Result<usize, FormatError> {
        width(index, at(&self.document.accessors, "accessor", index)?)
    }

    fn rows(&self, index: usize, accessor: &Accessor) -> Result<Option<Rows<'_>>, FormatError> {
        let width = width(index, accessor)?;
        let Some(view) = accessor.buffer_view else { return Ok(None) };
        let part = SparsePart { buffer_view: view, byte_offset: accessor.byte_offset, component_type: None };
        let kind = accessor.component_type;
        self.part(index, &part, kind, width, accessor.normalized, accessor.count).map(Some)
    }

    /// Rows in a view; their bytes are there.
    fn part(
        &self,
        index: usize,
        part: &SparsePart,
        kind: u32,
        width: usize,
        normalized: bool,
        count: u64,
    ) -> Result<Rows<'_>, FormatError> {
        let size = size_of_component(kind).ok_or_else(|| wrong(index, format!("there is no component type {kind}")))?;
        let (bytes, stride) = self.view(part.buffer_view)?;
        let row = (size * width) as u64;
        let stride = stride.filter(|stride| *stride > 0).unwrap_or(row);
        let needed =
            part.byte_offset.saturating_add(count.saturating_sub(1).saturating_mul(stride)).saturating_add(row);
        if count > 0 && needed > bytes.len() as u64 {
            let declared = format!("{needed} bytes for accessor {index}");
            let found = format!("the {} of bufferView {}", bytes.len(), part.buffer_view);
            return Err(FormatError::Truncated { declared, found });
        }
        let bytes = bytes.get(part.byte_offset as usize..).unwrap_or_default();
        Ok(Rows { bytes, stride: stride as usize, kind, size, width, normalized })
    }
}

fn wrong(index: usize, problem: String) -> FormatError {
    FormatError::malformed(format!("accessor {index}"), problem, REPAIR)
}

fn width(index: usize, accessor: &Accessor) -> Result<usize, FormatError> {
    match accessor.kind.as_str() {
        "SCALAR" => Ok(1),
        "VEC2" => Ok(2),
        "VEC3" => Ok(3),
        "VEC4" => Ok(4),
        _ => Err(wrong(index, format!("its values are {}", crate::quote(accessor.kind.as_bytes())))),
    }
}

const I8: u32 = 5120;
const U8: u32 = 5121;
const I16: u32 = 5122;
const U16: u32 = 5123;
const U32: u32 = 5125;
const F32: u32 = 5126;

fn size_of_component(kind: u32) -> Option<usize> {
    match kind {
        I8 | U8 => Some(1),
        I16 | U16 => Some(2),
        U32 | F32 => Some(4),
        _ => None,
    }
}

/// Rows of numbers of one type in a buffer.
struct Rows<'a> {
    bytes: &'a [u8],
    stride: usize,
    kind: u32,
    size: usize,
    width: usize,
    normalized: bool,
}

impl Rows<'_> {
    /// Fills in as many numbers of a row as it has.
    #[inline]
    fn get<const N: usize>(&self, row: usize, value: &mut [f32; N]) {
        for (component, x) in value.iter_mut().enumerate().take(self.width) {
            *x = self.number(row, component);
        }
    }

    #[inline]
    fn number(&self, row: usize, component: usize) -> f32 {
        let start = row * self.stride + component * self.size;
        let bytes = self.bytes.get(start..start + self.size).unwrap_or_default();
        let part = |full: f32| if self.normalized { full } else { 1.0 };
        match (self.kind, bytes) {
            (F32, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]),
            (U8, &[a]) => f32::from(a) / part(255.0),
            (I8, &[a]) => (f32::from(a as i8) / part(127.0)).max(-128.0 / part(128.0)),
            (U16, &[a, b]) => f32::from(u16::from_le_bytes([a, b])) / part(65535.0),
            (I16, &[a, b]) => (f32::from(i16::from_le_bytes([a, b])) / part(32767.0)).max(-32768.0 / part(32768.0)),
            (U32, &[a, b, c, d]) => u32::from_le_bytes([a, b, c, d]) as f32,
            _ => 0.0,
        }
    }

    #[inline]
    fn index(&self, row: usize) -> u32 {
        let start = row * self.stride;
        match *self.bytes.get(start..start + self.size).unwrap_or_default() {
            [a] => u32::from(a),
            [a, b] => u32::from(u16::from_le_bytes([a, b])),
            [a, b, c, d] => u32::from_le_bytes([a, b, c, d]),
            _ => u32::MAX,
        }
    }
}
