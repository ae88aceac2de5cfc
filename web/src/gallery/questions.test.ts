import { expect, test } from "vitest";

import { filterOf } from "./questions";

test("only what is asked for narrows an answer", () => {
    expect(filterOf({ label: "", text: "" })).toEqual({});
    expect(filterOf({ label: "", text: "left rabbit" })).toEqual({ filter: { text: "left rabbit" } });
    expect(filterOf({ label: "animal", text: "left" })).toEqual({ filter: { labels: ["animal"], text: "left" } });
});
