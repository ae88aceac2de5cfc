//! Columns of text, and PTX.

use visage_formats::columns;

use super::{Seed, cloud, rows};

pub fn xyz() -> Vec<Seed> {
    let count = |tail: &str| (0..20).map(|k| format!("{} 0.5 {k} {tail}\n", k + 100)).collect::<String>();
    vec![
        Seed::plain("cloud.xyz", columns::write_cloud(&cloud())),
        Seed::plain("table.csv", format!("id;X[mm];Y[mm];Z[mm];R;G;B\n{}", "1;0,5;1;2;255;0;9\n".repeat(20))),
        Seed::plain("bare.txt", rows(|p| format!("{} {} {} 0.6 0 -0.8 200 3 4\n", p.x, p.y, p.z))),
        Seed::plain("commas.asc", rows(|p| format!("{},{},{},door\n", p.x, p.y, p.z))),
        Seed::plain("counted.xyz", count("7")),
        Seed::plain("quoted.csv", "\"x\",\"y\",\"z\"\n\"1.5\",\"2\",\"-3.25\"\n\"4\",\"5.5\",\"600000.125\"\n"),
    ]
}

pub fn xyzn() -> Vec<Seed> {
    vec![Seed::plain("bare.xyzn", rows(|p| format!("{} {} {} 0 0 1\n", p.x, p.y, p.z)))]
}

pub fn xyzrgb() -> Vec<Seed> {
    vec![Seed::plain("bare.xyzrgb", rows(|p| format!("{} {} {} 0.1 0.2 1.0\n", p.x, p.y, p.z)))]
}

pub fn pts() -> Vec<Seed> {
    let block = format!("20\n{}", rows(|p| format!("{} {} {} -12 9 9 9\n", p.x, p.y, p.z)));
    vec![
        Seed::plain("leica.pts", block.repeat(2)),
        Seed::plain("bare.pts", rows(|p| format!("{} {} {} 4\n", p.x, p.y, p.z))),
    ]
}

pub fn uos() -> Vec<Seed> {
    let xyz = rows(|p| format!("{} {} {}\n", p.x, p.y, p.z));
    vec![Seed::plain("scan000.3d", format!("5 x 4\n{xyz}")), Seed::plain("scan001.3d", xyz)]
}

pub fn ptx() -> Vec<Seed> {
    const PLACE: &str = "1 2 3\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n1 2 3 1\n";
    let one = |row: &str| format!("5\n4\n{PLACE}{}", rows(|p| format!("{} {} {} {row}\n", p.x, p.y, p.z)));
    vec![
        Seed::plain("leica.ptx", one("0.5")),
        Seed::plain("colors.ptx", one("0.5 1 2 3")),
        Seed::plain("two.ptx", one("0.5").repeat(2)),
    ]
}
