import { expect, test } from "vitest";

import { href, parse } from "./router";

test("an address comes back as it was made", () => {
    expect(parse(href("scan-sets", "front/a b.ply")).parts).toEqual(["scan-sets", "front/a b.ply"]);
    expect(parse("#/gallery?standard=face").query.get("standard")).toBe("face");
    expect(parse("").parts).toEqual([]);
});

test("what was typed by hand breaks nothing", () => {
    expect(parse("#/models/%E0%A4%A").parts).toEqual(["models", "%E0%A4%A"]);
});
