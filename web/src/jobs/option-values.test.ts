import { expect, test } from "vitest";

import { changed, enteredOf, invalid, valueOf, type OptionInfo } from "./option-values";

const overlap: OptionInfo = {
    name: "min_overlap",
    type: "number",
    minimum: 0.05,
    maximum: 0.95,
    default: 0.5,
    help: "",
};
const rounds: OptionInfo = { name: "max_rounds", type: "integer", minimum: 1, maximum: 1000, default: 20, help: "" };
const mesh: OptionInfo = { name: "mesh", type: "boolean", default: true, help: "" };
const fill: OptionInfo = {
    name: "fill",
    type: "string",
    choices: ["small", "none", "all"],
    default: "small",
    help: "",
};
const sensor: OptionInfo = { name: "sensor", type: "array", default: null, help: "" };
const all = [overlap, rounds, mesh, fill, sensor];

test("only what differs is sent", () => {
    expect(changed(all, { min_overlap: "0.5", max_rounds: "30", mesh: "false", fill: "all", sensor: "" })).toEqual({
        max_rounds: 30,
        mesh: false,
        fill: "all",
    });
    expect(changed(all, {})).toEqual({});
});

test("what can't be used is named", () => {
    expect(invalid(all, { min_overlap: "1", max_rounds: "2.5", sensor: "1 2", fill: "small" })).toEqual([
        "min_overlap",
        "max_rounds",
        "sensor",
    ]);
    expect(invalid(all, { min_overlap: "" })).toEqual([]);
});

test("numbers may have a decimal comma, points any separator", () => {
    expect(valueOf(overlap, "0,3")).toBe(0.3);
    expect(valueOf(sensor, "1, 2; -3.5")).toEqual([1, 2, -3.5]);
});

test("a job's options come back as they were entered", () => {
    const values = { min_overlap: 0.3, max_rounds: 20, mesh: true, fill: "none", sensor: [1, 2, 3] };
    expect(enteredOf(all, values)).toEqual({ min_overlap: "0.3", fill: "none", sensor: "1 2 3" });
    expect(changed(all, enteredOf(all, values))).toEqual({ min_overlap: 0.3, fill: "none", sensor: [1, 2, 3] });
});
