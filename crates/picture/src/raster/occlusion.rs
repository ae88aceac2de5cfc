//! How much of the sky is hidden at each pixel by what stands about it: what gives hollows their depth.

use rayon::prelude::*;

use super::surface::Seen;
use super::vector::dot;
use crate::camera::Camera;

/// How far it is looked for what hides, in shares of the shorter side of the picture.
const REACH: f32 = 0.045;
/// Places about each pixel that are looked at.
const LOOKS: usize = 10;
/// Pixels in a square take different directions, and their mean.
const TILE: usize = 4;
/// A slope that hides nothing yet, as the sine of its angle: normals and depths are rough.
const BIAS: f32 = 0.12;
/// How much more than the mean is hidden.
const STRENGTH: f32 = 1.9;

/// The share of the sky that is open at each pixel, 0 to 1 in 8 bits.
pub(super) fn open_sky(seen: &Seen, camera: &Camera) -> Vec<u8> {
    let (width, height) = (seen.grid.width, seen.grid.height);
    let reach = (REACH * width.min(height) as f32).max(2.0);
    let directions = directions(reach);
    let rough: Vec<u8> = (0..height)
        .into_par_iter()
        .with_min_len(8)
        .flat_map_iter(|y| {
            let directions = &directions;
            (0..width).map(move |x| {
                let tile = (y % TILE) * TILE + x % TILE;
                let open = 1.0 - hidden(seen, camera, [x, y], &directions[tile], reach);
                (open * 255.0 + 0.5) as u8
            })
        })
        .collect();
    smooth(&rough, seen, camera, reach)
}

/// For each place in the square the steps to what is looked at.
fn directions(reach: f32) -> Vec<[[i32; 2]; LOOKS]> {
    // an order in which neighbours are far from each other
    const ORDER: [usize; TILE * TILE] = [0, 8, 2, 10, 12, 4, 14, 6, 3, 11, 1, 9, 15, 7, 13, 5];
    let golden = std::f32::consts::PI * (3.0 - 5f32.sqrt());
    ORDER
        .iter()
        .map(|order| {
            let turned = *order as f32 / ORDER.len() as f32;
            std::array::from_fn(|look| {
                let angle = golden * look as f32 + turned * std::f32::consts::TAU;
                // areas alike: far ones are as many as there is room
                let distance = reach * ((look as f32 + 0.35 + 0.5 * turned) / LOOKS as f32).sqrt();
                [(distance * angle.cos()).round() as i32, (distance * angle.sin()).round() as i32]
            })
        })
        .collect()
}

/// The share of the sky that is hidden at a pixel.
#[inline]
fn hidden(seen: &Seen, camera: &Camera, [x, y]: [usize; 2], steps: &[[i32; 2]; LOOKS], reach: f32) -> f32 {
    let (width, height) = (seen.grid.width as i32, seen.grid.height as i32);
    let pixel = &seen.pixels[y * seen.grid.width + x];
    if pixel.covered == 0 {
        return 0.0;
    }
    // lengths in pixels at this depth
    let (depth, pixels) = camera.depth_of(pixel.nearness);
    let normal = pixel.normal();
    let mut sum = 0.0;
    for [dx, dy] in steps {
        let (ox, oy) = (x as i32 + dx, y as i32 + dy);
        if ox < 0 || oy < 0 || ox >= width || oy >= height {
            continue;
        }
        let other = &seen.pixels[oy as usize * seen.grid.width + ox as usize];
        if other.covered == 0 {
            continue;
        }
        let (other_depth, _) = camera.depth_of(other.nearness);
        let offset = [*dx as f32, -*dy as f32, (other_depth - depth) * pixels];
        let length2 = dot(offset, offset);
        let near = 1.0 - length2 / (4.0 * reach * reach);
        if near > 0.0 && length2 > 0.0 {
            let sine = dot(normal, offset) / length2.sqrt();
            sum += (sine - BIAS).max(0.0) * near;
        }
    }
    (STRENGTH * sum / LOOKS as f32).min(1.0)
}

/// The mean over squares, of what lies as near.
fn smooth(rough: &[u8], seen: &Seen, camera: &Camera, reach: f32) -> Vec<u8> {
    let (width, height) = (seen.grid.width, seen.grid.height);
    (0..height)
        .into_par_iter()
        .with_min_len(8)
        .flat_map_iter(|y| {
            (0..width).map(move |x| {
                let pixel = &seen.pixels[y * width + x];
                if pixel.covered == 0 {
                    return u8::MAX;
                }
                let (depth, pixels) = camera.depth_of(pixel.nearness);
                let tolerance = 0.5 * reach / pixels;
                let (mut sum, mut count) = (0u32, 0u32);
                let (left, top) = (x.saturating_sub(TILE / 2 - 1), y.saturating_sub(TILE / 2 - 1));
                for oy in top..(y + TILE / 2 + 1).min(height) {
                    for ox in left..(x + TILE / 2 + 1).min(width) {
                        let index = oy * width + ox;
                        let (other, _) = camera.depth_of(seen.pixels[index].nearness);
                        if seen.pixels[index].covered > 0 && (other - depth).abs() <= tolerance {
                            sum += u32::from(rough[index]);
                            count += 1;
                        }
                    }
                }
                sum.checked_div(count).map_or(rough[y * width + x], |mean| mean as u8)
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_directions_are_within_reach_and_differ() {
        let all = directions(40.0);
        for steps in &all {
            assert!(steps.iter().all(|[x, y]| x * x + y * y <= 42 * 42), "{steps:?}");
        }
        assert!(all.windows(2).all(|pair| pair[0] != pair[1]));
    }
}
