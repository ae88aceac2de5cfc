//! Vectors in the axes of the picture, in single precision: a few operations that are called for every sample.

#[inline]
pub(super) fn minus(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline]
pub(super) fn times(a: [f32; 3], factor: f32) -> [f32; 3] {
    a.map(|x| x * factor)
}

#[inline]
pub(super) fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline]
pub(super) fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The same direction with length 1; `None` if it has none.
#[inline]
pub(super) fn unit(a: [f32; 3]) -> Option<[f32; 3]> {
    let length2 = dot(a, a);
    let is_sound = length2 > f32::MIN_POSITIVE && length2.is_finite();
    is_sound.then(|| times(a, 1.0 / length2.sqrt()))
}
