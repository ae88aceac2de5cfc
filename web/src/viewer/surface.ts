import type { Place } from "./marker-types";

/** A cloud or a mesh as it is drawn: coordinates are relative to `origin`, since graphics cards know short floats alone. */
export interface Surface {
    origin: [number, number, number];
    positions: Float32Array;
    normals?: Float32Array;
    colors?: Uint8Array;
    /** Of each point the index of the scan that it comes from. */
    views?: Uint16Array;
    /** Of each vertex about how many points it is the mean of. */
    support?: Float32Array;
    /** Of each vertex how far it is from another model; no number where that has nothing. */
    deviation?: Float32Array;
    /** Of each vertex how much it stands out. */
    saliency?: Float32Array;
    triangles?: Uint32Array;
}

/** What is one number a vertex, by the name that it has in files. */
export const figureNames = ["support", "deviation", "saliency"] as const;

/** The lowest and the highest corner, in the frame of the model. */
export type Bounds = readonly [low: Place, high: Place];

export function boundsOf({ origin, positions }: Surface): Bounds {
    const [low, high] = [origin.map(() => Infinity), origin.map(() => -Infinity)];
    for (let at = 0; at < positions.length; at += 1) {
        const value = (positions[at] as number) + (origin[at % 3] as number);
        if (value < (low[at % 3] as number)) low[at % 3] = value;
        if (value > (high[at % 3] as number)) high[at % 3] = value;
    }
    return [low as unknown as Place, high as unknown as Place];
}

/** What both take up together. */
export function joined(a: Bounds, b: Bounds): Bounds {
    const corner = (index: 0 | 1, choose: (x: number, y: number) => number) =>
        a[index].map((x, axis) => choose(x, b[index][axis] as number)) as unknown as Place;
    return [corner(0, Math.min), corner(1, Math.max)];
}

/** The arrays that can be handed over to another thread without a copy. */
export function buffersOf(surface: Surface): ArrayBuffer[] {
    const arrays = [
        surface.positions,
        surface.normals,
        surface.colors,
        surface.views,
        ...figureNames.map((name) => surface[name]),
        surface.triangles,
    ];
    return arrays.flatMap((array) => (array ? [array.buffer as ArrayBuffer] : []));
}

/** Points in an order of which every beginning is an even choice: it can be drawn instead of all while the view moves. */
export function shuffled(count: number): Uint32Array<ArrayBuffer> {
    const order: Uint32Array<ArrayBuffer> = Uint32Array.from({ length: count }, (_, index) => index);
    // a fixed sequence: the same model looks the same each time
    let seed = 0x9e3779b9;
    for (let left = count - 1; left > 0; left -= 1) {
        seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
        const other = Math.floor((seed / 2 ** 32) * (left + 1));
        const kept = order[left] as number;
        order[left] = order[other] as number;
        order[other] = kept;
    }
    return order;
}
