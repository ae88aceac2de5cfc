import { expect, test } from "vitest";

import { CameraLink, type Linked, type View } from "./link";

function member(center: [number, number, number], radius: number): Linked & { seen: View[] } {
    const seen: View[] = [];
    return { seen, ball: () => ({ center, radius }), view: () => first, lookFrom: (view) => void seen.push(view) };
}

const first: View = { eye: [0, 0, 3], target: [0, 0, 0] };
const view: View = { eye: [0, 0, 10], target: [0, 0, 0] };

test("in one frame all look from the same place", () => {
    const link = new CameraLink(true);
    const [a, b] = [member([0, 0, 0], 1), member([5, 0, 0], 2)];
    link.join(a);
    link.join(b);
    link.moved(a, view);
    // whoever comes second takes the view that there is
    expect(b.seen).toEqual([first, view]);
    expect(a.seen).toEqual([]);
    link.leave(b);
    link.moved(a, view);
    expect(b.seen).toHaveLength(2);
});

test("in frames of their own each looks at its model, in its size", () => {
    const link = new CameraLink(false);
    const [a, b] = [member([0, 0, 0], 1), member([5, 0, 0], 2)];
    link.join(a);
    link.join(b);
    link.moved(a, view);
    expect(b.seen.at(-1)).toEqual({ eye: [5, 0, 20], target: [5, 0, 0] });
});

test("who follows is not followed", () => {
    const link = new CameraLink(true);
    const a = member([0, 0, 0], 1);
    const b = member([0, 0, 0], 1);
    const answering: Linked = { ...b, lookFrom: (seen) => link.moved(answering, seen) };
    link.join(a);
    link.join(answering);
    link.moved(a, view);
    expect(a.seen).toEqual([]);
});
