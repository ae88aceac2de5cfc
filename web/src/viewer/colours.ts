import type { Surface } from "./surface";

export type ColourMode = "plain" | "scan" | "view" | "support" | "height";

const plain: Rgb = [176, 188, 196];
type Rgb = [number, number, number];

/** What a surface can be coloured by. */
export function modesOf(surface: Surface): ColourMode[] {
    return [
        "plain",
        ...(surface.colors ? (["scan"] as const) : []),
        ...(surface.views ? (["view"] as const) : []),
        ...(surface.support ? (["support"] as const) : []),
        "height",
    ];
}

/** A colour for each scan: neighbours in the list are far from each other in hue, and no hue comes twice. */
export function viewColour(index: number): Rgb {
    const hue = (index * 0.618033988749895 + 0.55) % 1;
    const lightness = [0.56, 0.42, 0.68][index % 3] as number;
    return hsl(hue, 0.62, lightness);
}

export function css([red, green, blue]: Rgb): string {
    return `rgb(${red} ${green} ${blue})`;
}

function hsl(hue: number, saturation: number, lightness: number): Rgb {
    const reach = saturation * Math.min(lightness, 1 - lightness);
    const channel = (shift: number) => {
        const k = (shift + hue * 12) % 12;
        return Math.round(255 * (lightness - reach * Math.max(-1, Math.min(k - 3, 9 - k, 1))));
    };
    return [channel(0), channel(8), channel(4)];
}

/** Dark to light without a false edge, and told apart by people who see few colours (viridis). */
const scale: Rgb[] = [
    [68, 1, 84],
    [65, 68, 135],
    [42, 120, 142],
    [34, 168, 132],
    [122, 209, 81],
    [253, 231, 37],
];

export function scaleColour(share: number): Rgb {
    const at = Math.max(0, Math.min(1, share)) * (scale.length - 1);
    const below = Math.min(scale.length - 2, Math.floor(at));
    const [from, to] = [scale[below] as Rgb, scale[below + 1] as Rgb];
    const mix = (axis: 0 | 1 | 2) => Math.round(from[axis] + (to[axis] - from[axis]) * (at - below));
    return [mix(0), mix(1), mix(2)];
}

export interface Coloured {
    colors: Uint8Array;
    /** Which values the ends of the scale stand for. */
    range?: [number, number];
}

/** A colour for each point. `up` is the axis that heights go along. */
export function colour(surface: Surface, mode: ColourMode, up: 0 | 1 | 2): Coloured {
    const count = surface.positions.length / 3;
    const colors = new Uint8Array(count * 3);
    const fill = (rgb: (index: number) => Rgb) => {
        for (let index = 0; index < count; index += 1) colors.set(rgb(index), index * 3);
    };
    if (mode === "scan" && surface.colors) return { colors: surface.colors.slice() };
    if (mode === "view" && surface.views) {
        const { views } = surface;
        const known = new Map<number, Rgb>();
        fill((index) => {
            const view = views[index] as number;
            const rgb = known.get(view) ?? viewColour(view);
            known.set(view, rgb);
            return rgb;
        });
        return { colors };
    }
    if (mode === "support" && surface.support) return byValue(colors, surface.support, Math.log1p, fill);
    if (mode === "height") {
        const heights = Float32Array.from({ length: count }, (_, index) => surface.positions[index * 3 + up] as number);
        const { range, ...rest } = byValue(colors, heights, (value) => value, fill);
        const origin = surface.origin[up];
        return range ? { ...rest, range: [range[0] + origin, range[1] + origin] } : rest;
    }
    fill(() => plain);
    return { colors };
}

function byValue(
    colors: Uint8Array,
    values: Float32Array,
    measure: (value: number) => number,
    fill: (rgb: (index: number) => Rgb) => void,
): Coloured {
    let [low, high] = [Infinity, -Infinity];
    for (const value of values) {
        low = Math.min(low, value);
        high = Math.max(high, value);
    }
    const [from, to] = [measure(low), measure(high)];
    fill((index) => scaleColour(to > from ? (measure(values[index] as number) - from) / (to - from) : 0.5));
    return { colors, range: [low, high] };
}

/** Makes a cloud look lit where it has normals: points have no surface of their own that light could fall on. */
export function shade(colors: Uint8Array, normals: Float32Array | undefined): Uint8Array {
    if (!normals) return colors;
    const light = [0.42, 0.64, 0.64];
    for (let index = 0; index < colors.length / 3; index += 1) {
        const at = index * 3;
        const facing =
            (normals[at] as number) * light[0]! +
            (normals[at + 1] as number) * light[1]! +
            (normals[at + 2] as number) * light[2]!;
        const factor = 0.62 + 0.38 * facing;
        for (let axis = 0; axis < 3; axis += 1) colors[at + axis] = (colors[at + axis] as number) * factor;
    }
    return colors;
}
