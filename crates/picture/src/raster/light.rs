//! Light: a sky, the ground below it, a lamp at the left shoulder of who looks, and a faint one from the right.

use rayon::prelude::*;

use super::Paint;
use super::occlusion::open_sky;
use super::surface::{Pixel, Seen};
use super::vector::dot;
use crate::camera::Camera;
use crate::color::Tables;
use crate::image::{Image, Rgb};
use crate::size::Size;

/// To the lamps, of length 1.
const KEY: [f32; 3] = [-0.462, 0.616, 0.638];
const FILL: [f32; 3] = [0.772, -0.117, 0.625];
/// How bright they are, the sky, and what the ground gives back.
const KEY_LIGHT: f32 = 0.78;
const FILL_LIGHT: f32 = 0.14;
const SKY: f32 = 0.44;
const EARTH: f32 = 0.20;
/// Light of the inner side, and how much bluer it is.
const INSIDE: [f32; 3] = [0.42, 0.48, 0.62];

/// The picture of what is seen.
pub(super) fn lit(seen: &Seen, camera: &Camera, size: Size, paint: Paint, ground: Rgb) -> Image {
    let sky = if paint == Paint::Flat { Vec::new() } else { open_sky(seen, camera) };
    let tables = Tables::new();
    let ground_light = tables.light(ground);
    let color = |(index, pixel): (usize, &Pixel)| {
        if pixel.covered == 0 {
            return ground;
        }
        let open = sky.get(index).map_or(1.0, |open| f32::from(*open) / 255.0);
        let strength = strength(pixel, open, paint);
        let (light, inside) = (pixel.light(), f32::from(pixel.inside) / 255.0);
        let covered = f32::from(pixel.covered) / 255.0;
        let is_turned = paint == Paint::Material;
        let mixed = |k: usize| {
            let tint = if is_turned { 1.0 + inside * (INSIDE[k] - 1.0) } else { 1.0 };
            covered * light[k] * strength * tint + (1.0 - covered) * ground_light[k]
        };
        tables.color([mixed(0), mixed(1), mixed(2)])
    };
    let pixels = seen.pixels.par_iter().enumerate().with_min_len(1 << 14).map(color).collect();
    Image::of_pixels(size, pixels)
}

/// How much light a pixel gets.
#[inline]
fn strength(pixel: &Pixel, open: f32, paint: Paint) -> f32 {
    let normal = pixel.normal();
    let lamps = KEY_LIGHT * dot(normal, KEY).max(0.0) + FILL_LIGHT * dot(normal, FILL).max(0.0);
    let sky = EARTH + (SKY - EARTH) * (0.5 + 0.5 * normal[1]);
    // lamps are hidden less than the sky
    let full = sky * open + lamps * (0.45 + 0.55 * open);
    match paint {
        Paint::Material => full * 1.05,
        // colours stay readable: from a half to all of the light
        Paint::Figure => 0.50 + 0.52 * full.min(1.0),
        Paint::Flat => 1.0,
    }
}
