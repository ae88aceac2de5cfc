import { expect, test } from "vitest";

import { colour, modesOf, scaleColour, viewColour } from "./colours";
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
