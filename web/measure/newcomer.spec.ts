import { expect, expectSurface, test } from "../e2e/fixture";
import { scansOfHead } from "../e2e/server";

// Figures, no limits: they are for docs/BESIDE_OTHERS.md.
test("from scans in a folder to a model that has been turned", async ({ page }) => {
    let begin = performance.now();
    const step = (name: string) => {
        console.log(`${name}: ${((performance.now() - begin) / 1000).toFixed(1)} s`);
        begin = performance.now();
    };
    const scans = scansOfHead();
    begin = performance.now();
    await page.goto("/");
    await expect(page.getByRole("heading", { name: "Scan sets" })).toBeVisible();
    step("the page is on the screen");
    await page.getByTestId("files").setInputFiles(scans);
    await page.getByLabel("Unit", { exact: true }).selectOption("mm");
    await page.getByRole("button", { name: "Store 8 files" }).click();
    await expect(page.getByRole("row", { name: /scan_0\d\.ply/ })).toHaveCount(8, { timeout: 120_000 });
    step("8 scans without poses are stored");
    await page.getByRole("button", { name: "Register these scans" }).click();
    await page.getByRole("link", { name: "Open the model" }).click({ timeout: 300_000 });
    step("they are registered, from their surfaces alone");
    await expectSurface(page);
    const canvas = page.locator(".viewer canvas");
    const before = await canvas.getAttribute("data-eye");
    await canvas.focus();
    await page.keyboard.press("ArrowLeft");
    await expect.poll(() => canvas.getAttribute("data-eye")).not.toBe(before);
    step("the model is on the screen, and turned");
});
