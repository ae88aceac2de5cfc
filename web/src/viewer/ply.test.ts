import { expect, test } from "vitest";

import { Unreadable } from "./ply-header";
import { readPly } from "./ply";
import { readXyz } from "./xyz";
import { shuffled } from "./surface";

const text = (content: string) => new TextEncoder().encode(content).buffer as ArrayBuffer;

const square = `ply
format ascii 1.0
comment made by hand
element vertex 4
property double x
property double y
property double z
property uchar red
property uchar green
property uchar blue
property ushort view
element face 1
property list uchar int vertex_indices
end_header
1000000.5 0 0 255 0 0 0
1000001.5 0 0 0 255 0 1
1000001.5 1 0 0 0 255 1
1000000.5 1 0 9 9 9 2
4 0 1 2 3
`;

test("text is read, and a square becomes two triangles", () => {
    const surface = readPly(text(square));
    expect(surface.origin).toEqual([1000000.5, 0, 0]);
    expect([...surface.positions]).toEqual([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0]);
    expect([...(surface.triangles ?? [])]).toEqual([0, 1, 2, 0, 2, 3]);
    expect([...(surface.views ?? [])]).toEqual([0, 1, 1, 2]);
    expect(surface.colors?.[4]).toBe(255);
});

function binary(isLittle: boolean, declared = 2): ArrayBuffer {
    const name = isLittle ? "little" : "big";
    const head = new TextEncoder().encode(
        `ply\nformat binary_${name}_endian 1.0\nelement vertex ${declared}\nproperty float x\nproperty float y\nproperty float z\nproperty float support\nend_header\n`,
    );
    const bytes = new Uint8Array(head.length + 32);
    bytes.set(head);
    const view = new DataView(bytes.buffer);
    [1, 2, 3, 0, 1.5, 2, NaN, 7].forEach((value, index) => view.setFloat32(head.length + index * 4, value, isLittle));
    return bytes.buffer;
}

test("both orders of bytes are read, and what is no place is left out", () => {
    for (const isLittle of [true, false]) {
        const surface = readPly(binary(isLittle));
        expect([...surface.positions]).toEqual([0, 0, 0]);
        expect([...(surface.support ?? [])]).toEqual([0]);
    }
});

test("a file that promises more than it holds is refused before anything is made of it", () => {
    expect(() => readPly(binary(true, 4_000_000_000))).toThrow(Unreadable);
    expect(() => readPly(binary(true, 3))).toThrow(Unreadable);
    expect(() => readPly(text("solid stl"))).toThrow(Unreadable);
    expect(() => readPly(text(square.replace("4 0 1 2 3", "4 0 1")))).toThrow(Unreadable);
});

test("triangles of vertices that are not there are left out", () => {
    const surface = readPly(text(square.replace("4 0 1 2 3", "4 0 1 2 9")));
    expect([...(surface.triangles ?? [])]).toEqual([0, 1, 2]);
});

test("a vertex without a place takes its triangles along, and no others", () => {
    const surface = readPly(
        text(square.replace("1000000.5 0 0 255 0 0 0", "nan 0 0 255 0 0 0").replace("4 0 1 2 3", "3 1 2 3")),
    );
    expect(surface.positions.length).toBe(9);
    expect([...(surface.triangles ?? [])]).toEqual([0, 1, 2]);
    expect(surface.colors?.[1]).toBe(255);
});

test("rows of numbers are points", () => {
    const surface = readXyz(text("x y z\n1 2 3\n2,2,3\nnan 1 2\n"));
    expect(surface.origin).toEqual([1, 2, 3]);
    expect([...surface.positions]).toEqual([0, 0, 0, 1, 0, 0]);
});

test("an order of points has each of them once, and is the same each time", () => {
    const order = shuffled(1000);
    expect(new Set(order).size).toBe(1000);
    expect([...order]).toEqual([...shuffled(1000)]);
    const firstTenth = [...order.slice(0, 100)].filter((index) => index < 500).length;
    expect(firstTenth).toBeGreaterThan(30);
    expect(firstTenth).toBeLessThan(70);
});

test("figures of vertices are read by their names, and go with their vertices", () => {
    const head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
    const more = "property float deviation\nproperty float saliency\nelement face 0\n";
    const body = "property list uchar int vertex_indices\nend_header\n0 0 0 -1.5 0.25\nnan 0 0 9 9\n1 0 0 nan 0.5\n";
    const surface = readPly(text(head + more + body));
    expect([...(surface.deviation ?? [])]).toEqual([-1.5, NaN]);
    expect([...(surface.saliency ?? [])]).toEqual([0.25, 0.5]);
    expect(surface.support).toBeUndefined();
});
