//! The pixels of an organised scan: `range_grid`.

use super::body::{Body, Fault};
use super::header::{Element, Header, Kind, Property, ScalarType};
use super::reader::{for_each_row, skip_element};
use crate::FormatError;
use crate::budget::Budget;
use crate::points::NONE;
use visage_geometry::RangeGrid;

/// The grid of a file, or why it is not used. The points are there without it.
#[derive(Debug, Default)]
pub(super) struct Grid {
    pub(super) grid: Option<RangeGrid>,
    pub(super) note: Option<String>,
}

impl Grid {
    /// Reads the element; a grid that can't be right is left out.
    pub(super) fn read(
        &mut self,
        header: &Header,
        element: &Element,
        vertices: u64,
        budget: &mut Budget,
        body: &mut impl Body,
    ) -> Result<(), FormatError> {
        let [Property { kind: Kind::List { count, item }, .. }] = element.properties[..] else {
            return skip_element(element, body);
        };
        let size = match (header.grid_columns, header.grid_rows) {
            (Some(columns), Some(rows)) if columns.checked_mul(rows) == Some(element.count) => (columns, rows),
            (Some(columns), Some(rows)) => {
                let pixels = element.count;
                self.refuse(format!("num_cols {columns} x num_rows {rows} does not give its {pixels} pixels"));
                return skip_element(element, body);
            }
            _ => return skip_element(element, body),
        };
        budget.take(element.count, size_of::<u32>())?;
        let mut pixels = Vec::with_capacity(element.count as usize);
        for_each_row(element, body, |body| {
            pixels.push(self.read_pixel(pixels.len(), vertices, (count, item), body)?);
            Ok(())
        })?;
        if self.note.is_none() {
            // both are factors of a count that was checked against the file's size
            self.grid = Some(RangeGrid { columns: size.0 as usize, rows: size.1 as usize, pixels });
        }
        Ok(())
    }

    fn read_pixel(
        &mut self,
        pixel: usize,
        vertices: u64,
        (count, item): (ScalarType, ScalarType),
        body: &mut impl Body,
    ) -> Result<u32, Fault> {
        body.begin_row()?;
        let length = body.list_length(count)?;
        let mut seen = NONE;
        for _ in 0..length {
            let index = body.integer(item)?;
            match u64::try_from(index) {
                Ok(vertex) if vertex < vertices => seen = vertex as u32,
                _ => self.refuse(format!("its pixel {pixel} names vertex {index} of {vertices}")),
            }
        }
        if length > 1 {
            self.refuse(format!("its pixel {pixel} sees {length} vertices, more than one"));
        }
        body.end_row()?;
        Ok(seen)
    }

    /// Notes the first reason not to use the grid.
    fn refuse(&mut self, reason: String) {
        self.note.get_or_insert_with(|| format!("the range grid is not used: {reason}"));
    }
}
