import { expect, test } from "vitest";

import { ofFace } from "./facing";

test("a face is looked at from its front, the right eye on the left", () => {
    // it looks along z, y is up: its right is at negative x for who looks at it
    const facing = ofFace({ eye_r_inner: [-16, 0, 0], eye_l_inner: [16, 0, 0], nose_tip: [0, -45, 20] });
    expect(facing?.front[2]).toBeGreaterThan(0.8);
    expect(facing?.up[1]).toBeGreaterThan(0.8);
    expect(facing?.axis).toBe(1);
    // the chin tells better what is upright than the tip of the nose
    const withChin = ofFace({
        eye_r_inner: [-16, 0, 0],
        eye_l_inner: [16, 0, 0],
        nose_tip: [0, -45, 20],
        chin: [0, -110, 2],
    });
    expect(withChin?.up[1]).toBeGreaterThan(0.99);
    // turned around
    expect(
        ofFace({ eye_r_inner: [16, 0, 0], eye_l_inner: [-16, 0, 0], nose_tip: [0, -45, -20] })?.front[2],
    ).toBeLessThan(-0.8);
});

test("without these places, or with all in one, nothing is said", () => {
    expect(ofFace({ nose_tip: [0, 0, 0] })).toBeUndefined();
    expect(ofFace({ eye_r_inner: [0, 0, 0], eye_l_inner: [0, 0, 0], nose_tip: [0, 0, 0] })).toBeUndefined();
});
