import type { Place } from "./marker-types";

/** From where a surface is looked at first, and what is upward. */
export interface Facing {
    /** From the surface to the eye. */
    front: Place;
    up: Place;
    /** How far the eye is aside and above, in parts of its distance: a little shows depth. */
    aside: number;
    above: number;
    /** The axis that heights go along: the one nearest to `up`. */
    axis: 0 | 1 | 2;
}

/** With one of the axes upward. */
export const byAxis: readonly [Facing, Facing, Facing] = [
    { front: [0, 0, 1], up: [1, 0, 0], aside: 0.4, above: 0.3, axis: 0 },
    { front: [0, 0, 1], up: [0, 1, 0], aside: 0.4, above: 0.3, axis: 1 },
    { front: [0, -1, 0], up: [0, 0, 1], aside: 0.4, above: 0.3, axis: 2 },
];

/** What lies below the eyes in a face that stands upright; the tip of the nose sticks out too far to tell it. */
const below = ["chin", "subnasale", "nose_tip"];

/** Where a face looks: from the inner corners of its eyes and a place below them, right and left being its own. */
export function ofFace(landmarks: Record<string, readonly number[]>): Facing | undefined {
    const [right, left] = [landmarks["eye_r_inner"], landmarks["eye_l_inner"]];
    const low = below.map((name) => landmarks[name]).find((place) => place !== undefined);
    if (!right || !left || !low) return undefined;
    const across = difference(left, right);
    const middle = right.map((value, axis) => (value + (left[axis] as number)) / 2);
    const rise = difference(middle, low);
    // who is looked at has the right eye on the left
    const front = unit(cross(across, rise));
    const up = front && unit(cross(front, across));
    if (!front || !up) return undefined;
    const sizes = up.map(Math.abs);
    return { front, up, aside: 0.18, above: 0.05, axis: sizes.indexOf(Math.max(...sizes)) as 0 | 1 | 2 };
}

type Vector = readonly number[];

function difference(a: Vector, b: Vector): number[] {
    return a.map((value, axis) => value - (b[axis] ?? 0));
}

function cross([ax = 0, ay = 0, az = 0]: Vector, [bx = 0, by = 0, bz = 0]: Vector): [number, number, number] {
    return [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx];
}

function unit(vector: [number, number, number]): [number, number, number] | undefined {
    const length = Math.hypot(...vector);
    if (!(length > 0)) return undefined;
    return [vector[0] / length, vector[1] / length, vector[2] / length];
}
