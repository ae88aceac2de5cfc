import { header, Unreadable, type Element, type Header } from "./ply-header";
import { figureNames, type Surface } from "./surface";

/** Reads numbers one after the other, whatever the file's kind. */
interface Source {
    next(scalar: { size: number; read(view: DataView, at: number, isLittle: boolean): number }): number;
}

function binary(bytes: Uint8Array, at: number, isLittle: boolean): Source {
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    return {
        next: (scalar) => {
            if (at + scalar.size > view.byteLength) throw new Unreadable("the file ends too early");
            const value = scalar.read(view, at, isLittle);
            at += scalar.size;
            return value;
        },
    };
}

/** Words of text, without a copy of all of it. */
export function ascii(bytes: Uint8Array, at: number): Source {
    const decoder = new TextDecoder("latin1");
    return {
        next: () => {
            while (at < bytes.length && (bytes[at] as number) <= 32) at += 1;
            const begin = at;
            while (at < bytes.length && (bytes[at] as number) > 32) at += 1;
            if (begin === at) throw new Unreadable("the file ends too early");
            return Number(decoder.decode(bytes.subarray(begin, at)));
        },
    };
}

/** Reads a PLY file of any kind, as far as it is drawn. */
export function readPly(buffer: ArrayBuffer): Surface {
    const bytes = new Uint8Array(buffer);
    const head: Header = header(bytes);
    const source =
        head.format === "ascii"
            ? ascii(bytes, head.bodyAt)
            : binary(bytes, head.bodyAt, head.format === "binary_little_endian");
    let surface: Surface | undefined;
    let places: Uint32Array | undefined;
    let triangles: Uint32Array | undefined;
    for (const element of head.elements) {
        if (element.name === "vertex") [surface, places] = vertices(element, source);
        else if (element.name === "face" && element.count > 0) triangles = faces(element, source);
        else pass(element, source);
    }
    if (!surface || surface.positions.length === 0) throw new Unreadable("the file holds no points");
    if (triangles && places) surface.triangles = sound(triangles, places);
    return surface;
}

/** The place of a vertex that was left out. */
const nowhere = 0xffffffff;

/** Triangles by the places that their vertices have now; without those that name a vertex which is not there. */
function sound(triangles: Uint32Array, places: Uint32Array): Uint32Array {
    const moved = triangles.map((index) => places[index] ?? nowhere);
    if (!moved.includes(nowhere)) return moved;
    const kept: number[] = [];
    for (let at = 0; at + 2 < moved.length; at += 3) {
        const corners = moved.subarray(at, at + 3);
        if (!corners.includes(nowhere)) kept.push(...corners);
    }
    return Uint32Array.from(kept);
}

const colorNames = [
    ["red", "green", "blue"],
    ["r", "g", "b"],
    ["diffuse_red", "diffuse_green", "diffuse_blue"],
];

/** What is drawn of the vertices, and which place each has in it. */
function vertices(element: Element, source: Source): [Surface, Uint32Array] {
    const names = element.properties.map((property) => property.name);
    const has = (wanted: readonly string[]) => wanted.every((name) => names.includes(name));
    if (!has(["x", "y", "z"])) throw new Unreadable("points without x, y and z");
    const colorsAs = colorNames.find(has);
    const count = element.count;
    const surface: Surface = { origin: [0, 0, 0], positions: new Float32Array(count * 3) };
    if (has(["nx", "ny", "nz"])) surface.normals = new Float32Array(count * 3);
    if (colorsAs) surface.colors = new Uint8Array(count * 3);
    if (names.includes("view")) surface.views = new Uint16Array(count);
    const figures = figureNames.flatMap((name) => {
        const column = names.indexOf(name);
        if (column < 0) return [];
        const values = (surface[name] = new Float32Array(count));
        return [{ column, values }];
    });
    const axes = ["x", "y", "z"].map((name) => names.indexOf(name));
    const places = new Uint32Array(count).fill(nowhere);
    const row = new Float64Array(names.length);
    const put = (array: Float32Array | Uint8Array | undefined, wanted: readonly string[], factor: number) => {
        const columns = wanted.map((name) => names.indexOf(name));
        return (index: number) => {
            for (let axis = 0; array && axis < 3; axis += 1)
                array[index * 3 + axis] = (row[columns[axis] as number] as number) * factor;
        };
    };
    const isFraction = colorsAs !== undefined && element.properties[names.indexOf(colorsAs[0] ?? "")]?.isFraction;
    const putNormal = put(surface.normals, ["nx", "ny", "nz"], 1);
    const putColor = put(surface.colors, colorsAs ?? [], isFraction ? 255 : 1);
    const view = names.indexOf("view");
    let written = 0;
    for (let index = 0; index < count; index += 1) {
        element.properties.forEach(({ value, count: length }, column) => {
            row[column] = length ? passList(source, length, value) : source.next(value);
        });
        const point = axes.map((column) => row[column] as number);
        // points without a return are no places
        if (!point.every(Number.isFinite)) continue;
        if (written === 0) surface.origin = point as [number, number, number];
        point.forEach(
            (value, axis) => (surface.positions[written * 3 + axis] = value - (surface.origin[axis] as number)),
        );
        putNormal(written);
        putColor(written);
        if (surface.views) surface.views[written] = row[view] as number;
        for (const { column, values } of figures) values[written] = row[column] as number;
        places[index] = written;
        written += 1;
    }
    return [written < count ? withoutGaps(surface, written) : surface, places];
}

function withoutGaps(surface: Surface, count: number): Surface {
    return {
        origin: surface.origin,
        positions: surface.positions.slice(0, count * 3),
        ...(surface.normals && { normals: surface.normals.slice(0, count * 3) }),
        ...(surface.colors && { colors: surface.colors.slice(0, count * 3) }),
        ...(surface.views && { views: surface.views.slice(0, count) }),
        ...Object.fromEntries(
            figureNames.flatMap((name) => {
                const values = surface[name];
                return values ? [[name, values.slice(0, count)]] : [];
            }),
        ),
    };
}

/** Triangles; faces of more corners become fans. */
function faces(element: Element, source: Source): Uint32Array {
    let indices = new Uint32Array(element.count * 3);
    let used = 0;
    const push = (value: number) => {
        if (used === indices.length) {
            const larger = new Uint32Array(Math.max(12, indices.length * 2));
            larger.set(indices);
            indices = larger;
        }
        indices[used] = value;
        used += 1;
    };
    for (let index = 0; index < element.count; index += 1) {
        for (const { name, count, value } of element.properties) {
            if (!count) {
                source.next(value);
            } else if (name === "vertex_indices" || name === "vertex_index") {
                const corners = source.next(count);
                let [first, last] = [0, 0];
                for (let corner = 0; corner < corners; corner += 1) {
                    const vertex = source.next(value);
                    if (corner === 0) first = vertex;
                    if (corner >= 2) [first, last, vertex].forEach(push);
                    last = vertex;
                }
            } else {
                passList(source, count, value);
            }
        }
    }
    return indices.slice(0, used);
}

function passList(
    source: Source,
    count: Element["properties"][number]["value"],
    value: Element["properties"][number]["value"],
): number {
    for (let left = source.next(count); left > 0; left -= 1) source.next(value);
    return 0;
}

function pass(element: Element, source: Source): void {
    for (let index = 0; index < element.count; index += 1) {
        for (const { count, value } of element.properties) {
            if (count) passList(source, count, value);
            else source.next(value);
        }
    }
}
