//! A floor of a building: furnished rooms in a row, doors between them and onto a corridor, and a way through all of it that
//! ends where it began.

use std::f64::consts::{PI, TAU};

use super::super::shapes::Dice;
use super::super::solids::{append, cuboid, moved, post, sheet, together};
use super::furniture::{chair, laid_table, shelf, sofa};
use super::{CELL_MM, Layout, Scenery, placed, placed_all};
use visage_geometry::{Mesh, Motion, Point3};

/// Half of the corridor's width, metres.
const CORRIDOR: f64 = 0.95;
const WALL: f64 = 0.12;
const DOOR_WIDTH: f64 = 0.95;
const DOOR_HEIGHT: f64 = 2.05;
/// Who looks about in a room stands so far from its middle.
const ASIDE: f64 = 0.9;

/// Where somebody stands on a way, and which way he looks: from above, radians from z towards x.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stop {
    /// Along the rooms.
    pub x: f64,
    /// From the corridor's middle into the rooms.
    pub z: f64,
    /// Turns are counted on, not from 0 again.
    pub heading: f64,
}

/// A building, and a way through it.
#[derive(Debug, Clone)]
pub struct Building {
    /// What can be seen.
    pub scene: Scenery,
    /// Room by room, looking about in each, back along the corridor, and to the first stop again; straight in between.
    pub way: Vec<Stop>,
}

/// A room of the row.
struct Room {
    /// Between these walls along x,
    x: [f64; 2],
    /// and from the corridor's wall to here.
    depth: f64,
    /// Where its doors are: to the next room along z, and to the corridor along x.
    next_door: f64,
    corridor_door: f64,
}

impl Room {
    fn middle(&self) -> [f64; 2] {
        [(self.x[0] + self.x[1]) / 2.0, CORRIDOR + WALL + self.depth / 2.0]
    }
}

impl Building {
    /// The building `seed` with so many rooms.
    pub fn new(rooms: usize, seed: u64) -> Self {
        let dice = &mut Dice::new(seed ^ 0xb01d, CELL_MM);
        let high = dice.between(2.5, 2.9);
        let rooms = row(rooms.max(1), dice);
        let (first, last) = (rooms[0].x[0], rooms[rooms.len() - 1].x[1]);
        let deepest = rooms.iter().map(|room| room.depth).fold(0.0, f64::max);
        let far = CORRIDOR + WALL + deepest;
        let mut parts = vec![
            sheet([[first, 0.0, far], [last, 0.0, far], [last, 0.0, -CORRIDOR], [first, 0.0, -CORRIDOR]]),
            sheet([[first, high, far], [first, high, -CORRIDOR], [last, high, -CORRIDOR], [last, high, far]]),
            // the corridor's far side and the ends
            cuboid([first, 0.0, -CORRIDOR - WALL], [last, high, -CORRIDOR]),
            cuboid([first - WALL, 0.0, -CORRIDOR - WALL], [first, high, far]),
            cuboid([last, 0.0, -CORRIDOR - WALL], [last + WALL, high, far]),
        ];
        let doors: Vec<f64> = rooms.iter().map(|room| room.corridor_door).collect();
        let lengthwise =
            |from: f64, to: f64, low: f64, top: f64| cuboid([from, low, CORRIDOR], [to, top, CORRIDOR + WALL]);
        parts.extend(wall([first, last], high, &doors, lengthwise));
        for (k, room) in rooms.iter().enumerate() {
            let z = [CORRIDOR + WALL, CORRIDOR + WALL + room.depth];
            parts.push(cuboid([room.x[0], 0.0, z[1]], [room.x[1], high, z[1] + WALL]));
            if k + 1 < rooms.len() {
                let across = |from: f64, to: f64, low: f64, top: f64| {
                    cuboid([room.x[1], low, from], [room.x[1] + WALL, top, to])
                };
                parts.extend(wall([z[0], far + WALL], high, &[room.next_door], across));
            }
            parts.push(furnished(room, k, high, dice));
        }
        parts.push(corridor([first, last], high, &doors, dice));
        let mesh = together(parts);
        let center = Point3::new((first + last) / 2.0, 1.4, far / 2.0);
        let half_length = (last - first) / 2.0;
        let scene = Scenery { mesh, still: None, layout: Layout::Inside, extent: 3.0, center, half_length };
        Building { scene, way: way(&rooms) }
    }
}

/// The rooms along x, their sizes and doors.
fn row(count: usize, dice: &mut Dice) -> Vec<Room> {
    let mut x = 0.0;
    let mut room = || {
        let (width, depth) = (dice.between(4.0, 5.0), dice.between(3.9, 4.8));
        let own = [x, x + width];
        x += width + WALL;
        let next_door = CORRIDOR + WALL + depth / 2.0 + dice.between(-0.4, 0.4);
        Room { x: own, depth, next_door, corridor_door: own[0] + dice.between(0.35, 0.65) * width }
    };
    (0..count).map(|_| room()).collect()
}

/// A wall with door openings and their frames, made of pieces by from where to where they go and stand.
fn wall([from, to]: [f64; 2], high: f64, doors: &[f64], piece: impl Fn(f64, f64, f64, f64) -> Mesh) -> Vec<Mesh> {
    let mut parts = Vec::new();
    let mut at = from;
    for door in doors {
        let (left, right) = (door - DOOR_WIDTH / 2.0, door + DOOR_WIDTH / 2.0);
        parts.push(piece(at, left, 0.0, high));
        parts.push(piece(left, right, DOOR_HEIGHT, high));
        at = right;
    }
    parts.push(piece(at, to, 0.0, high));
    parts
}

/// What stands in a room: no two rooms have the same.
fn furnished(room: &Room, number: usize, high: f64, dice: &mut Dice) -> Mesh {
    let [x, z] = room.middle();
    let half = [(room.x[1] - room.x[0]) / 2.0, room.depth / 2.0];
    let back = z + half[1];
    let mut parts = vec![
        placed(
            &laid_table(dice),
            dice.between(0.0, TAU),
            [x + dice.between(-0.3, 0.3), 0.0, z + dice.between(-0.3, 0.3)],
        ),
        placed_all(shelf(dice), PI, [x + dice.between(-0.4, 0.4) * half[0], 0.0, back - 0.2]),
        // a chimney breast, a beam, a radiator
        cuboid([room.x[1] - 0.3, 0.0, back - dice.about(1.0)], [room.x[1], high, back - dice.between(0.1, 0.3)]),
        cuboid([room.x[0], high - dice.about(0.2), z + dice.between(-0.8, 0.2)], [room.x[1], high, z + 0.35]),
        cuboid([room.x[0], 0.1, back - 1.5], [room.x[0] + 0.1, dice.about(0.7), back - dice.between(0.4, 0.7)]),
    ];
    for _ in 0..2 + dice.number() % 3 {
        let (way, far) = (dice.between(0.0, TAU), dice.between(0.9, 1.4));
        parts.push(placed_all(chair(dice), dice.between(0.0, TAU), [x + far * way.cos(), 0.0, z + far * way.sin()]));
    }
    let corner = [room.x[0] + 0.4, back - 0.4];
    match number % 3 {
        0 => parts.push(placed_all(sofa(dice), PI, [x - 0.3, 0.0, back - dice.about(0.9)])),
        1 => parts.push(placed_all(shelf(dice), PI / 2.0, [room.x[0] + 0.2, 0.0, back - dice.about(1.2)])),
        _ => {
            parts.push(cuboid(
                [corner[0] - 0.4, 0.0, corner[1] - 0.6],
                [corner[0] + 0.3, dice.about(1.5), corner[1] + 0.4],
            ));
        }
    }
    let lamp = [room.x[1] - 0.35, 0.0, CORRIDOR + WALL + 0.4];
    parts.push(post(lamp, dice.about(1.5), 0.03, 0.03));
    parts.push(post([lamp[0], dice.about(1.4), lamp[2]], 0.35, 0.24, 0.13));
    for _ in 0..3 {
        let (at, low) = (x + dice.between(-0.8, 0.6) * half[0], dice.between(1.0, 1.6));
        let (wide, tall) = (dice.between(0.3, 0.8), dice.between(0.3, 0.7));
        parts.push(cuboid([at, low, back - 0.05], [at + wide, low + tall, back]));
    }
    together(parts)
}

/// What hangs and stands in a corridor: on its far side closed doors, pictures, cupboards and benches at irregular places.
fn corridor([first, last]: [f64; 2], high: f64, doors: &[f64], dice: &mut Dice) -> Mesh {
    let mut mesh = Mesh { vertices: Vec::new(), faces: Vec::new() };
    let side = -CORRIDOR;
    let mut x = first + dice.between(0.2, 0.6);
    while x < last - 1.2 {
        let wide = dice.between(0.3, 1.0);
        let [low, tall, deep] = match dice.number() % 5 {
            0 => [0.0, DOOR_HEIGHT, 0.06],
            1 => [dice.between(1.1, 1.6), dice.between(0.3, 0.8), 0.05],
            2 => [0.0, dice.between(0.8, 1.9), dice.between(0.2, 0.35)],
            3 => [0.0, dice.about(0.45), 0.35],
            _ => [0.1, dice.about(0.6), 0.12],
        };
        append(&mut mesh, &cuboid([x, low, side], [x + wide, low + tall, side + deep]));
        x += wide + dice.between(0.15, 0.9);
    }
    let mut x = first + dice.between(0.4, 1.2);
    while x < last - 0.5 {
        let (thick, low) = (dice.between(0.08, 0.3), high - dice.between(0.08, 0.25));
        append(&mut mesh, &cuboid([x, low, -CORRIDOR], [x + thick, high, CORRIDOR]));
        x += dice.between(1.0, 2.6);
    }
    for door in doors {
        let (jamb, out) = (DOOR_WIDTH / 2.0, dice.between(0.03, 0.09));
        for end in [door - jamb - 0.1, door + jamb] {
            append(&mut mesh, &cuboid([end, 0.0, CORRIDOR - out], [end + 0.1, DOOR_HEIGHT, CORRIDOR]));
        }
        let shelf_at = door + jamb + dice.between(0.4, 0.9);
        let low = dice.between(0.9, 1.6);
        let board = cuboid([0.0, low, -0.2], [dice.between(0.3, 0.8), low + dice.between(0.04, 0.5), 0.0]);
        append(&mut mesh, &moved(&board, &Motion::translation(shelf_at, 0.0, CORRIDOR)));
    }
    mesh
}

/// Through the doors from room to room, back along the corridor.
fn way(rooms: &[Room]) -> Vec<Stop> {
    let eastward = PI / 2.0;
    let start = rooms[0].middle();
    let mut way = Vec::new();
    for (k, room) in rooms.iter().enumerate() {
        let [x, z] = room.middle();
        // once around, from the west side looking east, and in the last room on until the corridor's door lies ahead
        let quarters = if k + 1 < rooms.len() { 4 } else { 5 };
        for step in 0..=6 * quarters {
            let heading = eastward + f64::from(step) * TAU / 24.0;
            way.push(Stop { x: x - ASIDE * heading.sin(), z: z - ASIDE * heading.cos(), heading });
        }
        if k + 1 < rooms.len() {
            way.push(Stop { x: room.x[1] - 0.5, z: room.next_door, heading: eastward + TAU });
            way.push(Stop { x: room.x[1] + 0.6, z: room.next_door, heading: eastward + TAU });
            // the next room turns on from here
            way.iter_mut().for_each(|stop| stop.heading -= TAU);
        }
    }
    let southward = PI;
    let westward = 1.5 * PI;
    let last = &rooms[rooms.len() - 1];
    let turned = way.last().map_or(0.0, |stop| ((stop.heading - southward) / TAU).round() * TAU);
    let mut walk = |x: f64, z: f64, heading: f64| way.push(Stop { x, z, heading: heading + turned });
    walk(last.corridor_door, CORRIDOR + WALL + 0.6, southward);
    walk(last.corridor_door, 0.1, southward + 0.4);
    let (from, to) = (last.corridor_door - 0.4, rooms[0].corridor_door);
    let swings = ((from - to) / 1.3).ceil().max(1.0) as usize;
    for swing in 0..=swings {
        let aside = if swing % 2 == 0 { 0.45 } else { -0.45 };
        let along = from + (to - from) * swing as f64 / swings as f64;
        walk(along, 0.25 * aside, westward + aside);
    }
    walk(to, CORRIDOR + 0.4, TAU);
    walk(to, CORRIDOR + WALL + 0.8, TAU);
    walk(start[0] - ASIDE, start[1], TAU + eastward);
    way
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_ends_where_it_began_and_never_leaps() {
        for (rooms, seed) in [(1, 1), (2, 2), (4, 3)] {
            let building = Building::new(rooms, seed);
            let (first, last) = (building.way[0], building.way[building.way.len() - 1]);
            assert!((first.x - last.x).hypot(first.z - last.z) < 1e-9);
            assert!((((last.heading - first.heading) / TAU + 0.5).rem_euclid(1.0) - 0.5).abs() < 1e-9);
            for pair in building.way.windows(2) {
                let (far, turn) =
                    ((pair[1].x - pair[0].x).hypot(pair[1].z - pair[0].z), pair[1].heading - pair[0].heading);
                assert!(far < 3.5 && turn.abs() < 2.1, "{pair:?}");
            }
            assert_eq!(building.scene.mesh, Building::new(rooms, seed).scene.mesh);
            assert_ne!(building.scene.mesh, Building::new(rooms, seed + 1).scene.mesh);
        }
    }
}
