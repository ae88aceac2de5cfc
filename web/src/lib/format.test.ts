import { beforeEach, expect, test } from "vitest";

import { language } from "../texts";
import { bytes, duration, figure, length, number } from "./format";

beforeEach(() => language.set("en"));

test("figures keep what tells something", () => {
    expect(figure(0.0123456)).toBe("0.0123");
    expect(number(244070)).toBe("244,070");
    expect(length(12.3456, "mm")).toBe("12.3\u00a0mm");
    expect(length(12.3456, "unknown")).toBe("12.3");
});

test("sizes and times are read at a glance", () => {
    expect(bytes(999)).toBe("999\u00a0B");
    expect(bytes(2_018_433)).toBe("2\u00a0MB");
    expect(bytes(1_540_000)).toBe("1.5\u00a0MB");
    expect(duration(0.25)).toBe("0.3\u00a0s");
    expect(duration(75)).toBe("1\u00a0min 15\u00a0s");
    expect(duration(3700)).toBe("1\u00a0h 1\u00a0min");
});

test("numbers follow the language", () => {
    language.set("de");
    expect(number(244070)).toBe("244.070");
    expect(figure(0.0123)).toBe("0,0123");
});
