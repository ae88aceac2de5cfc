//! What the paper reports, for comparison.

use visage::pipeline::Method;

/// A cell of a table: Obj in mm^2 (by the paper's own, unprinted definition) and wall seconds on its machine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reported {
    /// Mean of Obj.
    pub mean: f64,
    /// Its standard deviation, where there is one.
    pub deviation: Option<f64>,
    /// Mean time.
    pub seconds: f64,
}

/// Table 1: one run of each set.
pub fn table_1(set: &str, method: Method) -> Option<Reported> {
    let (mean, seconds) = match (set, method) {
        ("bunny", Method::LrsL1alm) => (0.6454, 50.2754),
        ("bunny", Method::MaIcp) => (0.8533, 301.998),
        ("bunny", Method::MaAticp) => (0.6434, 40.942),
        ("dragon", Method::LrsL1alm) => (0.4399, 80.9986),
        ("dragon", Method::MaIcp) => (0.5152, 251.916),
        ("dragon", Method::MaAticp) => (0.4106, 29.697),
        ("happy", Method::LrsL1alm) => (0.137, 321.4806),
        ("happy", Method::MaIcp) => (0.1821, 1540.374),
        ("happy", Method::MaAticp) => (0.1363, 128.634),
        _ => return None,
    };
    Some(Reported { mean, deviation: None, seconds })
}

/// Table 2: the bunny at the three levels of noise.
pub fn table_2(set: &str, noise: usize, method: Method) -> Option<Reported> {
    let rows = match (set, method) {
        ("bunny", Method::LrsL1alm) => [(0.6500, 0.0048, 94.635), (0.6514, 0.3445, 104.857), (1.0227, 1.0071, 209.742)],
        ("bunny", Method::MaIcp) => [(0.8532, 0.0002, 324.3), (0.9164, 0.4474, 312.582), (1.4980, 1.6478, 302.994)],
        ("bunny", Method::MaAticp) => [(0.6464, 0.0029, 20.149), (0.6505, 0.0067, 21.696), (0.6992, 0.0793, 25.477)],
        _ => return None,
    };
    let (mean, deviation, seconds) = *rows.get(noise)?;
    Some(Reported { mean, deviation: Some(deviation), seconds })
}
