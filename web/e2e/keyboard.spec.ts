import type { Page } from "@playwright/test";

import { drawn, expect, expectSurface, test } from "./fixture";
import { registeredHead } from "./seed";
import { scansOfHead } from "./server";

/** Goes on with the tabulator until something of this name has the focus: what can't be reached so can't be used. */
async function tabTo(page: Page, name: RegExp): Promise<void> {
    for (let steps = 0; steps < 80; steps += 1) {
        await page.keyboard.press("Tab");
        const focused = await page.evaluate(() => {
            const element = document.activeElement;
            const labels =
                element instanceof HTMLInputElement || element instanceof HTMLSelectElement
                    ? [...(element.labels ?? [])].map((label) => label.textContent)
                    : [];
            return [element?.getAttribute("aria-label"), ...labels, element?.textContent].filter(Boolean).join(" ");
        });
        if (name.test(focused)) return;
    }
    throw new Error(`the tabulator does not lead to ${name}`);
}

test("scans are stored and a job is started and stopped with the keyboard alone", async ({ page }) => {
    await page.goto("/");
    await expect(page.getByRole("heading", { name: "Scan sets" })).toBeFocused();
    const choosing = page.waitForEvent("filechooser");
    await tabTo(page, /^Choose files/);
    await page.keyboard.press("Enter");
    await (await choosing).setFiles(scansOfHead());
    await tabTo(page, /^Name/);
    await page.keyboard.type("With keys");
    await tabTo(page, /^Store 8 files/);
    await page.keyboard.press("Enter");
    await expect(page.getByRole("heading", { name: "With keys" })).toBeFocused();
    await tabTo(page, /^Register these scans/);
    await page.keyboard.press("Enter");
    await expect(page.getByRole("heading", { name: "Registration" })).toBeFocused();
    await tabTo(page, /^Stop the job/);
    await page.keyboard.press("Enter");
    await expect(page.getByText("stopped", { exact: true })).toBeVisible();
    await tabTo(page, /^Delete/);
    await page.keyboard.press("Enter");
    // the way out comes first in a dialog that deletes
    await expect(page.getByRole("dialog").getByRole("button", { name: "Cancel" })).toBeFocused();
    await page.keyboard.press("Tab");
    await page.keyboard.press("Enter");
    await expect(page.getByRole("heading", { name: "With keys" })).toBeVisible();
    await tabTo(page, /^Delete$/);
    await page.keyboard.press("Enter");
    await expect(page.getByRole("dialog")).toBeVisible();
    await page.keyboard.press("Escape");
    await expect(page.getByRole("dialog")).toHaveCount(0);
});

test("a model is turned, cut, measured and marked with the keyboard alone", async ({ page, server }) => {
    const { set, model } = await registeredHead(server, "By keyboard");
    await page.goto(`/#/models/${model}`);
    await expectSurface(page);
    await tabTo(page, /^3D view/);
    const canvas = page.locator(".viewer canvas");
    for (const key of ["ArrowLeft", "ArrowUp", "Shift+ArrowRight", "+", "-", "f"]) {
        const before = await drawn(page);
        await page.keyboard.press(key);
        await expect.poll(() => drawn(page), key).toBeGreaterThan(before);
    }
    const whole = await canvas.screenshot();
    await tabTo(page, /^Cut across/);
    await page.keyboard.press("ArrowDown");
    await expect(page.getByLabel("Position of the cut")).toBeVisible();
    await expect.poll(async () => (await canvas.screenshot()).equals(whole)).toBe(false);
    await page.keyboard.press("ArrowUp");
    await tabTo(page, /^Pick landmarks/);
    await page.keyboard.press("Enter");
    await canvas.focus();
    await page.keyboard.press("Enter");
    await expect(page.getByLabel("Landmark 1", { exact: true })).toHaveValue("Landmark 1");
    await expect(page.getByText("2 more are needed.")).toBeVisible();
    await fetch(`${server.url}/v1/scan-sets/${set}`, { method: "DELETE" });
});
