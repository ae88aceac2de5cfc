import { expect, test } from "vitest";

import { boundsOf, joined } from "./surface";

test("bounds are in the frame of the model, and those of two hold both", () => {
    const surface = {
        origin: [10, 0, -5] as [number, number, number],
        positions: new Float32Array([0, 1, 2, -1, 3, 0]),
    };
    const bounds = boundsOf(surface);
    expect(bounds).toEqual([
        [9, 1, -5],
        [10, 3, -3],
    ]);
    expect(
        joined(bounds, [
            [9.5, -1, -9],
            [9.6, 9, -4],
        ]),
    ).toEqual([
        [9, -1, -9],
        [10, 9, -3],
    ]);
});
