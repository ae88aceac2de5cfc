import { expect, test } from "vitest";

import { choose, poseOf, startingPoses } from "./places";
import type { Alternatives, Matrix } from "./sources";

const at = (x: number, y: number, z: number): Matrix => [
    [1, 0, 0, x],
    [0, 1, 0, y],
    [0, 0, 1, z],
    [0, 0, 0, 1],
];

const row = (name: string, ...xs: number[]): Alternatives => ({
    name,
    poses: xs.map((x) => ({ pose: at(x, 0, 0), score: 1 })),
});

test("a job starts from what was found and what was chosen", () => {
    const rows = [row("b", 1, 2), row("c", 3, 4)];
    const poses = startingPoses({ a: at(0, 0, 0), b: null, d: null }, rows, { c: { index: 1, degrees: 0 } });
    expect(poses).toEqual({ a: at(0, 0, 0), b: at(1, 0, 0), c: at(4, 0, 0) });
});

test("scans that hang together are chosen together, others are left", () => {
    const rows = [row("a", 1, 2), row("b", 3, 4), row("c", 5, 6), row("d", 7)];
    const views = [
        { name: "a", placed: false, group: 1 },
        { name: "b", placed: false, group: 1 },
        { name: "c", placed: false, group: 2 },
        { name: "d", placed: false, group: 1 },
    ];
    const choice = { index: 1, degrees: 0 };
    expect(choose(rows, views, {}, "a", choice)).toEqual({ a: choice, b: choice });
    // scans of no group have nothing in common
    const loose = views.map((view) => ({ ...view, group: null }));
    expect(choose(rows, loose, {}, "a", choice)).toEqual({ a: choice });
});

test("a scan is turned about its axis where it lies", () => {
    const vase = { ...row("a", 3), axis: { point: [1, 0, 0], direction: [0, 0, 2] } };
    const pose = poseOf(vase, { index: 0, degrees: 90 });
    const rounded = pose.map((line) => line.map((value) => Math.round(value * 1e9) / 1e9 + 0));
    // two to the right of the axis becomes two above it
    expect(rounded).toEqual([
        [0, -1, 0, 1],
        [1, 0, 0, 2],
        [0, 0, 1, 0],
        [0, 0, 0, 1],
    ]);
});
