import { expect, test } from "vitest";

import { hasSeveralPoses, needsForm, needsUnit, roles, withoutCommonFolder } from "./files";

const formats = ["ply", "xyz", "txt", "csv", "glb", "e57", "las"];

test("files are told apart by their endings", () => {
    expect(roles(["a.ply", "b.PLY.gz", "rough.json", "readme.md", "set.tar.gz"], formats)).toEqual([
        "scan",
        "scan",
        "poses",
        "skip",
        "archive",
    ]);
    expect(roles([".hidden.ply", "__MACOSX/a.ply"], formats)).toEqual(["skip", "skip"]);
});

test("text is a scan where nothing else is, and poses beside scans", () => {
    expect(roles(["a.txt", "b.txt"], formats)).toEqual(["scan", "scan"]);
    expect(roles(["a.ply", "poses.txt"], formats)).toEqual(["scan", "poses"]);
});

test("of several pose files none is taken unasked", () => {
    const paths = ["a.ply", "rough.json", "truth.json"];
    const taken = roles(paths, formats);
    expect(taken).toEqual(["scan", "skip", "skip"]);
    expect(hasSeveralPoses(paths, taken)).toBe(true);
    expect(hasSeveralPoses(paths.slice(0, 2), roles(paths.slice(0, 2), formats))).toBe(false);
});

test("the unit is asked for only where a file does not say it", () => {
    expect(needsUnit(["a.las", "b.glb"], ["scan", "scan"])).toBe(false);
    expect(needsUnit(["a.las", "b.ply"], ["scan", "scan"])).toBe(true);
    expect(needsUnit(["a.las", "b.ply"], ["scan", "skip"])).toBe(false);
});

test("what the server takes apart goes in a form", () => {
    expect(needsForm(["a.ply", "b.ply"], ["scan", "scan"])).toBe(false);
    expect(needsForm(["a.ply", "room.e57"], ["scan", "scan"])).toBe(true);
    expect(needsForm(["set.zip"], ["archive"])).toBe(true);
});

test("the folder that was dropped is no part of names", () => {
    expect(withoutCommonFolder(["set/a.ply", "set/front/a.ply"])).toEqual(["a.ply", "front/a.ply"]);
    expect(withoutCommonFolder(["a.ply"])).toEqual(["a.ply"]);
    expect(withoutCommonFolder([])).toEqual([]);
});
