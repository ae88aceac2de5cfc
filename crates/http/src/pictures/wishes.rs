//! What may be wished of a picture.

use serde::Deserialize;
use visage_geometry::names::UnknownName;

use crate::problem::{Code, Problem};
use crate::schemas::{PicturePlane, PictureSide, PictureSize};
use visage_picture::camera::Side;
use visage_picture::size::Size;
use visage_report::{Kind, Wish};

/// What is wished of a picture of a model.
#[derive(Debug, Default, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub struct PictureQuery {
    /// Width and height in pixels. What is usual for the kind if it is not said.
    #[param(value_type = PictureSize, required = false)]
    size: Option<String>,
    /// From which side. Axes: x to the right, y up, z to who looks at the front. `default`, from before it and a little from above, is
    /// from before the face if there is one.
    #[param(value_type = PictureSide, required = false)]
    view: Option<String>,
    /// The plane of a section: an axis, and where on it in the unit of the model.
    #[param(value_type = PicturePlane, required = false)]
    plane: Option<String>,
    /// The model that this one is compared with (`deviation`), in the same frame and unit.
    #[param(format = "uuid", value_type = String, required = false)]
    pub other: Option<String>,
}

/// What is wished of a plot.
#[derive(Debug, Default, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub struct PlotQuery {
    /// Width and height in pixels. What is usual if it is not said.
    #[param(value_type = PictureSize, required = false)]
    pub size: Option<String>,
}

/// What is wished of a picture of a scan.
#[derive(Debug, Default, Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
pub struct ScanPictureQuery {
    /// Width and height in pixels. What is usual if it is not said.
    #[param(value_type = PictureSize, required = false)]
    size: Option<String>,
    /// From which side, in the scan's own axes.
    #[param(value_type = PictureSide, required = false)]
    view: Option<String>,
}

impl ScanPictureQuery {
    /// The size and the side.
    pub fn wish(&self) -> Result<(Size, Side), Problem> {
        Ok((size_of(self.size.as_deref(), Kind::Thumbnail.size())?, side_of(self.view.as_deref())?))
    }
}

/// What is wished of a picture of this kind.
pub fn wish_of(kind: Kind, query: &PictureQuery) -> Result<Wish, Problem> {
    let plane = query.plane.as_deref().map(|text| text.parse().map_err(|hint| refused("plane", &hint)));
    Ok(Wish {
        size: size_of(query.size.as_deref(), kind.size())?,
        side: side_of(query.view.as_deref())?,
        plane: plane.transpose()?,
    })
}

/// The size that is wished.
pub fn size_of(text: Option<&str>, usual: Size) -> Result<Size, Problem> {
    text.map_or(Ok(usual), |text| text.parse().map_err(|hint| refused("size", &hint)))
}

fn side_of(text: Option<&str>) -> Result<Side, Problem> {
    text.map_or(Ok(Side::Default), |text| {
        text.parse().map_err(|error: UnknownName| refused("view", &format!("give {}", error.names())))
    })
}

fn refused(field: &str, hint: &impl std::fmt::Display) -> Problem {
    Problem::new(Code::InvalidField, format!("{field} has a value that is not allowed"), hint.to_string())
}
