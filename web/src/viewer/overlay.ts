import { BufferGeometry, Color, Float32BufferAttribute, Points, PointsMaterial, type Vector3 } from "three";

import type { Place } from "./marker-types";
import { shuffled, type Surface } from "./surface";

/** A scan that is shown where a pose puts it, in one colour. */
export interface Overlay {
    surface: Surface;
    /** Scan to model, 4x4. */
    pose: readonly (readonly number[])[];
    colour: string;
}

/** So many of its points are shown: enough to see where it lies. */
const most = 60_000;

export function overlayPoints(
    { surface, pose, colour }: Overlay,
    local: (place: Place) => Vector3,
    size: number,
): Points {
    const { positions, origin } = surface;
    const shown = shuffled(positions.length / 3).subarray(0, most);
    const places = new Float32Array(shown.length * 3);
    shown.forEach((index, place) => {
        const point = [0, 1, 2].map((axis) => (positions[index * 3 + axis] as number) + (origin[axis] as number));
        local(moved(pose, point)).toArray(places, place * 3);
    });
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new Float32BufferAttribute(places, 3));
    return new Points(geometry, new PointsMaterial({ color: new Color(colour), sizeAttenuation: false, size }));
}

function moved(pose: Overlay["pose"], [x = 0, y = 0, z = 0]: readonly number[]): Place {
    const row = (axis: number) => {
        const [a = 0, b = 0, c = 0, d = 0] = pose[axis] ?? [];
        return a * x + b * y + c * z + d;
    };
    return [row(0), row(1), row(2)];
}
