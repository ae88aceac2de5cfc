import { expect, test } from "vitest";

import { secondsLeft } from "./time-left";

test("the rest is told from what was done, once that says something", () => {
    expect(secondsLeft(0.25, 10)).toBe(30);
    expect(secondsLeft(0.01, 10)).toBeUndefined();
    expect(secondsLeft(1, 10)).toBeUndefined();
    expect(secondsLeft(0.5, 0)).toBeUndefined();
});
