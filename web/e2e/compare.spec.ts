import type { Locator, Page } from "@playwright/test";

import { de } from "../src/texts/de";
import { expect, expectAccessible, expectFits, expectSurface, test } from "./fixture";
import { addedModel, registeredAgain, registeredHead } from "./seed";

const eye = (canvas: Locator) => canvas.getAttribute("data-eye");

async function expectBoth(page: Page): Promise<[Locator, Locator]> {
    const canvases = page.locator(".viewer canvas");
    await expect(canvases).toHaveCount(2);
    for (const index of [0, 1]) await expect(canvases.nth(index)).toHaveAttribute("data-ready", "yes");
    return [canvases.nth(0), canvases.nth(1)];
}

test("two runs are seen from the same side, and measured against each other", async ({ page, server, watch }) => {
    // two registrations
    test.slow();
    watch.allow(/status of 404/);
    const { set, model } = await registeredHead(server, "Run twice");
    const other = await registeredAgain(server, set, { method: "ma-icp" });
    await page.goto(`/#/scan-sets/${set}`);
    await page.getByRole("link", { name: "Compare the two newest models" }).click();
    await expect(page.getByRole("heading", { name: "Compare two models" })).toBeFocused();

    await test.step("who turns one turns the other", async () => {
        const [first, second] = await expectBoth(page);
        await expect(page.getByLabel("In one frame")).toBeChecked();
        await expect.poll(async () => (await eye(first)) === (await eye(second))).toBe(true);
        const before = await eye(first);
        await second.scrollIntoViewIfNeeded();
        const box = (await second.boundingBox())!;
        await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
        await page.mouse.down();
        await page.mouse.move(box.x + box.width / 2 + 90, box.y + box.height / 2 + 10, { steps: 4 });
        await page.mouse.up();
        await expect.poll(async () => (await eye(first)) !== before).toBe(true);
        await expect.poll(async () => (await eye(first)) === (await eye(second))).toBe(true);
        // and with the keyboard
        const turned = await eye(second);
        await first.focus();
        await page.keyboard.press("ArrowLeft");
        await expect.poll(async () => (await eye(second)) !== turned).toBe(true);
        await expect.poll(async () => (await eye(first)) === (await eye(second))).toBe(true);
        await expectAccessible(page);
    });

    await test.step("what is known of both stands beside each other", async () => {
        await expect(page.getByRole("row", { name: /8 of 8 scans have a place\..*8 of 8 scans/ })).toBeVisible();
        await page.getByLabel("Colour by").selectOption("deviation");
        await expectBoth(page);
        await expect(page.getByTestId("legend")).toHaveCount(2);
        await expect(page.getByTestId("legend").first()).toHaveText(
            /−[\d.]+\smm to [\d.]+\smm|-[\d.]+\smm to [\d.]+\smm/,
        );
    });

    await test.step("one plane cuts both", async () => {
        const canvases = page.locator(".viewer canvas");
        const whole = [await canvases.nth(0).screenshot(), await canvases.nth(1).screenshot()];
        await page.getByLabel("Cut across").selectOption("Z");
        await page.getByLabel("Position of the cut").fill("0.6");
        await expect(page.getByText(/^Z = -?−?[\d.]+\smm$/)).toBeVisible();
        for (const index of [0, 1])
            await expect.poll(async () => (await canvases.nth(index).screenshot()).equals(whole[index]!)).toBe(false);
        await expectAccessible(page);
        await page.getByLabel("Cut across").selectOption("off");
    });

    await test.step("one is measured to the other", async () => {
        await page.getByRole("link", { name: "Measure how far they are from each other" }).click();
        await expectSurface(page);
        await expect(page.getByLabel("Colour by")).toHaveValue("deviation");
        await expect(page.getByTestId("legend")).toContainText("blue inside of the other model");
        await expect(page.getByRole("row", { name: /^Root mean square [\d.]+\smm [\d.]+\smm$/ })).toBeVisible();
        await expectAccessible(page);
        const canvas = page.locator(".viewer canvas");
        const deviation = await canvas.screenshot();
        await page.getByLabel("Colour by").selectOption("saliency");
        await expectSurface(page);
        await expect.poll(async () => (await canvas.screenshot()).equals(deviation)).toBe(false);
        await expect(page.getByTestId("legend")).toHaveText(/0 to 0\.\d+/);
        await expect(page.getByLabel("Compared with")).toHaveCount(0);
        // back to what the model has itself
        await page.getByLabel("Colour by").selectOption("plain");
        await expectSurface(page);
        await expect(page.getByLabel("Show", { exact: true })).toBeVisible();
        await page.getByLabel("Colour by").selectOption("deviation");
        await page.getByLabel("Compared with").selectOption("");
        await expect(page.getByTestId("legend")).toHaveCount(0);
    });

    await test.step("models of no common frame are looked at each in its size", async () => {
        const jug = await addedModel(server, "jug", "thing");
        await page.goto(`/#/compare?a=${model}`);
        await expect(page.getByText("Choose two models.")).toBeVisible();
        await page.getByLabel("Second model", { exact: true }).selectOption(jug);
        const [first, second] = await expectBoth(page);
        await expect(page.getByLabel("In one frame")).not.toBeChecked();
        const before = await eye(second);
        await first.focus();
        await page.keyboard.press("ArrowUp");
        await expect.poll(async () => (await eye(second)) !== before).toBe(true);
        await expect(page.getByLabel("Colour by").locator("option", { hasText: "Deviation" })).toHaveCount(0);
        await page.setViewportSize({ width: 360, height: 740 });
        await expectFits(page);
        await expectAccessible(page);
        await page.getByLabel("Language").selectOption("de");
        await expect(page.getByRole("heading", { name: de.compare.title })).toBeVisible();
        await expect(page.getByLabel(de.compare.second, { exact: true })).toHaveValue(jug);
        await expectFits(page);
        await page.getByLabel("Sprache").selectOption("en");
        await fetch(`${server.url}/v1/models/${jug}`, { method: "DELETE" });
    });

    await test.step("a model that is gone is said to be", async () => {
        await fetch(`${server.url}/v1/models/${other}`, { method: "DELETE" });
        await page.goto("about:blank");
        await page.goto(`/#/compare?a=${model}&b=${other}`);
        await expect(page.getByText("That did not work:").first()).toBeVisible();
    });
    await fetch(`${server.url}/v1/scan-sets/${set}`, { method: "DELETE" });
});
