import type { Surface } from "./surface";

/** The first three rows of a motion; nothing where it is not known. */
export type Motions = readonly (readonly (readonly number[])[] | null | undefined)[];

/** The surface with the points of each scan moved by its own motion, in the frame of the model. */
export function movedByView(surface: Surface, motions: Motions): Surface {
    const { views, origin } = surface;
    if (!views) return surface;
    const positions = new Float32Array(surface.positions);
    const normals = surface.normals && new Float32Array(surface.normals);
    for (let index = 0; index < views.length; index += 1) {
        const motion = motions[views[index] as number];
        if (!motion) continue;
        const place = [0, 1, 2].map((axis) => (positions[3 * index + axis] as number) + (origin[axis] as number));
        const normal = normals && [0, 1, 2].map((axis) => normals[3 * index + axis] as number);
        for (let axis = 0; axis < 3; axis += 1) {
            const [x, y, z, shift] = motion[axis] as readonly [number, number, number, number];
            const turned = ([a, b, c]: number[]) => x * (a as number) + y * (b as number) + z * (c as number);
            positions[3 * index + axis] = turned(place) + shift - (origin[axis] as number);
            if (normals && normal) normals[3 * index + axis] = turned(normal);
        }
    }
    return { ...surface, positions, ...(normals && { normals }) };
}
