import type { Surface } from "./surface";

export type ColourMode = "plain" | "scan" | "view" | "support" | "height" | "saliency" | "deviation";

const plain: Rgb = [176, 188, 196];
/** What is to be left out. */
const dropped: Rgb = [196, 58, 44];
/** What nothing is known of. */
const unknown: Rgb = [150, 152, 156];
/** What most figures don't exceed: the few beyond it have the colour of the end. */
const most = 0.98;

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
const rising: Rgb[] = [
    [68, 1, 84],
    [65, 68, 135],
    [42, 120, 142],
    [34, 168, 132],
    [122, 209, 81],
    [253, 231, 37],
];
/** Blue inside, pale on the reference, red outside. */
const signed: Rgb[] = [
    [33, 102, 172],
    [103, 169, 207],
    [236, 238, 240],
    [239, 138, 98],
    [178, 24, 43],
];

/** The colours of a scale from its low end to its high one: figures that begin below zero have two sides. */
export function scaleOf([low]: readonly [number, number]): readonly Rgb[] {
    return low < 0 ? signed : rising;
}

export function scaleColour(share: number, scale: readonly Rgb[] = rising): Rgb {
    if (Number.isNaN(share)) return unknown;
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
    if (mode === "scan" && surface.colors) return { colors: surface.colors.slice() };
    if (mode === "view" && surface.views) return { colors: byView(surface.views) };
    if (mode === "support" && surface.support) return byValue(surface.support, rangeOf(surface.support), Math.log1p);
    if ((mode === "saliency" || mode === "deviation") && surface[mode])
        return byValue(surface[mode], usualRange(surface[mode]));
    if (mode === "height") {
        const heights = Float32Array.from({ length: count }, (_, index) => surface.positions[index * 3 + up] as number);
        const [low, high] = rangeOf(heights);
        const origin = surface.origin[up];
        return { ...byValue(heights, [low, high], undefined, rising), range: [low + origin, high + origin] };
    }
    return { colors: filled(count, () => plain) };
}

function filled(count: number, rgb: (index: number) => Rgb): Uint8Array {
    const colors = new Uint8Array(count * 3);
    for (let index = 0; index < count; index += 1) colors.set(rgb(index), index * 3);
    return colors;
}

function byView(views: Uint16Array): Uint8Array {
    const known = new Map<number, Rgb>();
    return filled(views.length, (index) => {
        const view = views[index] as number;
        const rgb = known.get(view) ?? viewColour(view);
        known.set(view, rgb);
        return rgb;
    });
}

function rangeOf(values: Float32Array): [number, number] {
    let [low, high] = [Infinity, -Infinity];
    for (const value of values) {
        low = Math.min(low, value);
        high = Math.max(high, value);
    }
    return [low, high];
}

/** From zero, or as far below it as above, to what most values don't exceed. */
function usualRange(values: Float32Array): [number, number] {
    const sizes = values.filter((value) => !Number.isNaN(value)).map(Math.abs);
    sizes.sort();
    const high = sizes[Math.round((sizes.length - 1) * most)] ?? 0;
    return [values.some((value) => value < 0) ? -high : 0, high];
}

function byValue(
    values: Float32Array,
    [low, high]: [number, number],
    measure: (value: number) => number = (value) => value,
    scale = scaleOf([low, high]),
): Coloured {
    const [from, to] = [measure(low), measure(high)];
    const share = (value: number) =>
        Number.isNaN(value) ? NaN : to > from ? (measure(value) - from) / (to - from) : 0.5;
    const colors = filled(values.length, (index) => scaleColour(share(values[index] as number), scale));
    return { colors, range: [low, high] };
}

/** Marks the points that are to be left out; places are in the frame of the model. */
export function markDropped(
    colors: Uint8Array,
    { origin, positions }: Surface,
    isDropped: (x: number, y: number, z: number) => boolean,
): void {
    for (let at = 0; at < positions.length; at += 3) {
        const [x, y, z] = [positions[at] as number, positions[at + 1] as number, positions[at + 2] as number];
        if (isDropped(x + origin[0], y + origin[1], z + origin[2])) colors.set(dropped, at);
    }
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
