import { expect, test } from "vitest";

import { fits } from "./questions";

test("every word has to be there, in the name or the label", () => {
    const model = { name: "Rabbit, left side", label: "animal" };
    expect(fits(model, "")).toBe(true);
    expect(fits(model, "LEFT animal")).toBe(true);
    expect(fits(model, "rabbit right")).toBe(false);
    expect(fits({ name: "Head", label: null }, "null")).toBe(false);
});
