import { expect, test } from "vitest";

import { movedByView } from "./start";
import type { Surface } from "./surface";

test("each scan goes its own way, and who has none stays", () => {
    const surface: Surface = {
        origin: [100, 0, 0],
        positions: new Float32Array([1, 2, 3, 1, 2, 3]),
        normals: new Float32Array([1, 0, 0, 1, 0, 0]),
        views: new Uint16Array([0, 1]),
    };
    // a quarter of a turn about z, and 5 upwards
    const motion = [
        [0, -1, 0, 0],
        [1, 0, 0, 0],
        [0, 0, 1, 5],
        [0, 0, 0, 1],
    ];
    const moved = movedByView(surface, [undefined, motion]);
    expect([...moved.positions]).toEqual([1, 2, 3, -102, 101, 8]);
    expect([...(moved.normals ?? [])]).toEqual([1, 0, 0, 0, 1, 0]);
    expect([...surface.positions]).toEqual([1, 2, 3, 1, 2, 3]);
});
