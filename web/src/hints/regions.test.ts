import { expect, test } from "vitest";

import type { Surface } from "../viewer/surface";
import { boxOf, droppedShare, isDroppedBy, regionAt, type RegionHint } from "./regions";

const scan: Surface = {
    origin: [100, 0, 0],
    positions: Float32Array.from([0, 0, 0, 1, 0, 0, 2, 0, 0, 3, 0, 0]),
};
const box = boxOf(scan);

const leave = (shape: Parameters<typeof regionAt>[0], x: number, radius = 0): RegionHint => ({
    scan: "a.ply",
    leave: regionAt(shape, [x, 0, 0], radius, box),
});

test("a ball and a side leave out what lies in them, the border with it", () => {
    expect(box).toEqual({ min: [100, 0, 0], max: [103, 0, 0] });
    expect(droppedShare(scan, isDroppedBy([leave("ball", 101, 1)]))).toBe(0.75);
    expect(droppedShare(scan, isDroppedBy([leave("+x", 102)]))).toBe(0.5);
    expect(droppedShare(scan, isDroppedBy([leave("-x", 102)]))).toBe(0.75);
    // flat scans have no extent across: a side reaches beyond them
    expect(droppedShare(scan, isDroppedBy([leave("+y", 0)]))).toBe(1);
});

test("where something is to be used, everything else is left out; to leave goes before to use", () => {
    const use: RegionHint = { scan: "a.ply", use: regionAt("ball", [101, 0, 0], 1, box) };
    expect(droppedShare(scan, isDroppedBy([use]))).toBe(0.25);
    expect(droppedShare(scan, isDroppedBy([use, leave("-x", 100)]))).toBe(0.5);
    expect(droppedShare(scan, isDroppedBy([]))).toBe(0);
});
