import { expect, test } from "vitest";

import { Budget, leastWhileMoving, mostWhileMoving } from "./budget";

/** A machine that draws so many points a millisecond. */
function settled(speed: number, least = 0): { milliseconds: number; points: number } {
    const budget = new Budget();
    const cost = () => least + budget.points / speed;
    for (let picture = 0; picture < 60; picture += 1) budget.waited(cost());
    return { milliseconds: cost(), points: budget.points };
}

test("a fast machine draws as many as there may be", () => {
    expect(settled(30_000).points).toBe(mostWhileMoving);
});

test("a slow one draws what it can draw ten times a second, and no less than it could", () => {
    const { milliseconds, points } = settled(1_000);
    expect(milliseconds).toBeLessThan(100);
    expect(points).toBeGreaterThan(35_000);
});

test("one that is too slow for anything still shows something", () => {
    expect(settled(1_000, 500).points).toBe(leastWhileMoving);
});
