import { expect, test } from "vitest";

import { at } from "./address";

test("addresses stand below the path at which the page is", () => {
    expect(at("/v1/jobs?limit=1", "/visage/")).toBe("/visage/v1/jobs?limit=1");
    expect(at("/", "/visage/")).toBe("/visage/");
    expect(at("/v1/jobs", "/")).toBe("/v1/jobs");
});
