/** A number type of PLY: how many bytes it has, and how it is read. */
export interface Scalar {
    size: number;
    read(view: DataView, at: number, isLittle: boolean): number;
}

const int8: Scalar = { size: 1, read: (view, at) => view.getInt8(at) };
const uint8: Scalar = { size: 1, read: (view, at) => view.getUint8(at) };
const int16: Scalar = { size: 2, read: (view, at, isLittle) => view.getInt16(at, isLittle) };
const uint16: Scalar = { size: 2, read: (view, at, isLittle) => view.getUint16(at, isLittle) };
const int32: Scalar = { size: 4, read: (view, at, isLittle) => view.getInt32(at, isLittle) };
const uint32: Scalar = { size: 4, read: (view, at, isLittle) => view.getUint32(at, isLittle) };
const float32: Scalar = { size: 4, read: (view, at, isLittle) => view.getFloat32(at, isLittle) };
const float64: Scalar = { size: 8, read: (view, at, isLittle) => view.getFloat64(at, isLittle) };

const scalars = new Map<string, Scalar>([
    ["char", int8],
    ["int8", int8],
    ["uchar", uint8],
    ["uint8", uint8],
    ["short", int16],
    ["int16", int16],
    ["ushort", uint16],
    ["uint16", uint16],
    ["int", int32],
    ["int32", int32],
    ["uint", uint32],
    ["uint32", uint32],
    ["float", float32],
    ["float32", float32],
    ["double", float64],
    ["float64", float64],
]);

export interface Property {
    name: string;
    /** How many bytes it has at least: a list may be empty. */
    value: Scalar;
    /** The type of the count, for a list. */
    count?: Scalar;
    /** Whole numbers up to 255 or fractions: what colours are told by. */
    isFraction: boolean;
}

export interface Element {
    name: string;
    count: number;
    properties: Property[];
}

export interface Header {
    format: "ascii" | "binary_little_endian" | "binary_big_endian";
    elements: Element[];
    /** Where the content begins. */
    bodyAt: number;
}

/** What a file holds can't be shown. */
export class Unreadable extends Error {}

const longestHeader = 65536;

/** The head of a PLY file; counts are held against the bytes that are there before anything is made of them. */
export function header(bytes: Uint8Array): Header {
    const text = new TextDecoder("latin1").decode(bytes.subarray(0, longestHeader));
    const end = /^end_header\r?\n/m.exec(text);
    if (!text.startsWith("ply") || !end) throw new Unreadable("this is no PLY file");
    const elements: Element[] = [];
    let format: Header["format"] | undefined;
    for (const line of text.slice(0, end.index).split(/\r?\n/)) {
        const [word, ...rest] = line.trim().split(/\s+/);
        if (word === "format") {
            const name = rest[0];
            if (name !== "ascii" && name !== "binary_little_endian" && name !== "binary_big_endian")
                throw new Unreadable(`PLY of an unknown kind: ${name}`);
            format = name;
        } else if (word === "element") {
            const count = Number(rest[1]);
            if (!Number.isInteger(count) || count < 0) throw new Unreadable(`no count of ${rest[0]}`);
            elements.push({ name: rest[0] ?? "", count, properties: [] });
        } else if (word === "property") {
            const element = elements.at(-1);
            if (!element) throw new Unreadable("a property of nothing");
            element.properties.push(property(rest));
        }
    }
    if (!format) throw new Unreadable("a PLY file that does not say of which kind it is");
    const bodyAt = end.index + end[0].length;
    for (const element of elements) {
        const least = element.properties.reduce(
            (sum, { value, count }) => sum + (format === "ascii" ? 2 : (count ?? value).size),
            0,
        );
        if (element.count * Math.max(1, least) > bytes.length - bodyAt + 1)
            throw new Unreadable(`the file is too short for its ${element.count} of ${element.name}`);
    }
    return { format, elements, bodyAt };
}

function property(words: string[]): Property {
    const scalar = (name: string | undefined) => {
        const found = scalars.get(name ?? "");
        if (!found) throw new Unreadable(`a number of an unknown type: ${name}`);
        return found;
    };
    if (words[0] === "list") {
        return { name: words[3] ?? "", count: scalar(words[1]), value: scalar(words[2]), isFraction: false };
    }
    const value = scalar(words[0]);
    return { name: words[1] ?? "", value, isFraction: value === float32 || value === float64 };
}
