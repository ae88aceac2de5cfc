import type { Schema } from "../api/client";
import type { Place } from "../viewer/marker-types";
import type { Surface } from "../viewer/surface";

export type RegionHint = Schema["RegionHint"];

/** What a region is: a ball about a picked place, or all on one side of it along an axis. */
export type Shape = "ball" | "+x" | "-x" | "+y" | "-y" | "+z" | "-z";
export const shapes: readonly Shape[] = ["ball", "-x", "+x", "-y", "+y", "-z", "+z"];

export interface Box {
    min: Place;
    max: Place;
}

/** The corners of what holds all points. */
export function boxOf({ origin, positions }: Surface): Box {
    const [min, max] = [[0, 1, 2].map(() => Infinity), [0, 1, 2].map(() => -Infinity)];
    positions.forEach((value, index) => {
        const axis = index % 3;
        const at = value + (origin[axis] as number);
        min[axis] = Math.min(min[axis] as number, at);
        max[axis] = Math.max(max[axis] as number, at);
    });
    return { min: min as unknown as Place, max: max as unknown as Place };
}

export function diagonal({ min, max }: Box): number {
    return Math.hypot(...[0, 1, 2].map((axis) => (max[axis] as number) - (min[axis] as number)));
}

/** The region about a place, or beside it; a side reaches beyond all points of the scan. */
export function regionAt(shape: Shape, place: Place, radius: number, box: Box): Schema["Region"] {
    if (shape === "ball") return { sphere: { center: [...place], radius } };
    const beyond = diagonal(box);
    const [min, max] = [box.min.map((value) => value - beyond), box.max.map((value) => value + beyond)];
    const axis = "xyz".indexOf(shape[1] as string);
    if (shape.startsWith("+")) min[axis] = place[axis] as number;
    else max[axis] = place[axis] as number;
    return { box: { min, max } };
}

/** Whether a place of the scan is left out, as the server has it: in a region to leave, or in none of those to use. */
export function isDroppedBy(hints: readonly RegionHint[]): (x: number, y: number, z: number) => boolean {
    const of = (kind: "use" | "leave") => hints.flatMap((hint) => hint[kind] ?? []);
    const [used, left] = [of("use"), of("leave")];
    return (x, y, z) => {
        const isIn = (region: Schema["Region"]) => holds(region, [x, y, z]);
        return left.some(isIn) || (used.length > 0 && !used.some(isIn));
    };
}

function holds({ box, sphere }: Schema["Region"], place: Place): boolean {
    const at = (values: readonly number[], axis: number) => values[axis] ?? NaN;
    if (box) return place.every((value, axis) => at(box.min, axis) <= value && value <= at(box.max, axis));
    if (!sphere) return false;
    return Math.hypot(...place.map((value, axis) => value - at(sphere.center, axis))) <= sphere.radius;
}

/** The share of the points that is left out. */
export function droppedShare(
    { origin, positions }: Surface,
    isDropped: (x: number, y: number, z: number) => boolean,
): number {
    let dropped = 0;
    for (let at = 0; at < positions.length; at += 3) {
        const [x, y, z] = [positions[at] as number, positions[at + 1] as number, positions[at + 2] as number];
        if (isDropped(x + origin[0], y + origin[1], z + origin[2])) dropped += 1;
    }
    return positions.length > 0 ? (dropped * 3) / positions.length : 0;
}
