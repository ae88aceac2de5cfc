import { expect, test } from "vitest";

import { colour, markDropped, modesOf, scaleColour, scaleOf, viewColour } from "./colours";
import type { Surface } from "./surface";

const surface: Surface = {
    origin: [0, 0, 100],
    positions: Float32Array.from([0, 0, 0, 0, 0, 1, 0, 0, 2]),
    views: Uint16Array.from([0, 1, 0]),
    support: Float32Array.from([0, 3, 9]),
};

test("only what a surface knows can be shown", () => {
    expect(modesOf(surface)).toEqual(["plain", "view", "support", "height"]);
    expect(modesOf({ ...surface, colors: new Uint8Array(9) })).toContain("scan");
});

test("points of one scan have one colour, others another", () => {
    const { colors } = colour(surface, "view", 2);
    expect([...colors.slice(0, 3)]).toEqual([...colors.slice(6, 9)]);
    expect([...colors.slice(0, 3)]).not.toEqual([...colors.slice(3, 6)]);
    expect(new Set(Array.from({ length: 60 }, (_, index) => viewColour(index).join())).size).toBe(60);
});

test("heights are told in the frame of the model", () => {
    const { colors, range } = colour(surface, "height", 2);
    expect(range).toEqual([100, 102]);
    expect([...colors.slice(0, 3)]).toEqual(scaleColour(0));
    expect([...colors.slice(6, 9)]).toEqual(scaleColour(1));
});

test("where all values are equal nothing is divided by nothing", () => {
    const flat = { ...surface, support: Float32Array.from([5, 5, 5]) };
    expect([...colour(flat, "support", 2).colors.slice(0, 3)]).toEqual(scaleColour(0.5));
});

test("distances have the same colours on both sides of the reference, and none where there is nothing", () => {
    const deviation = Float32Array.from([-2, 0, NaN]);
    const { colors, range } = colour({ ...surface, deviation }, "deviation", 2);
    expect(range).toEqual([-2, 2]);
    const scale = scaleOf([-2, 2]);
    expect([...colors.slice(0, 3)]).toEqual(scaleColour(0, scale));
    expect([...colors.slice(3, 6)]).toEqual(scaleColour(0.5, scale));
    expect([...colors.slice(6, 9)]).toEqual(scaleColour(NaN));
    // to a cloud distances have no sign
    const sizes = Float32Array.from([0, 1, 2]);
    expect(colour({ ...surface, deviation: sizes }, "deviation", 2).range).toEqual([0, 2]);
    expect(scaleOf([0, 2])).not.toEqual(scale);
});

test("one figure far beyond all others does not take their colours", () => {
    const saliency = Float32Array.from({ length: 1000 }, (_, index) => (index === 7 ? 1e6 : index / 1000));
    const positions = new Float32Array(3000);
    const { range } = colour({ origin: [0, 0, 0], positions, saliency }, "saliency", 2);
    expect(range?.[0]).toBe(0);
    expect(range?.[1]).toBeLessThan(1);
});

test("what is left out is marked by its place in the frame of the model", () => {
    const colors = new Uint8Array(9);
    markDropped(colors, surface, (_x, _y, z) => z > 101.5);
    expect([...colors.slice(0, 6)]).toEqual([0, 0, 0, 0, 0, 0]);
    expect(colors[6]).toBeGreaterThan(0);
});
