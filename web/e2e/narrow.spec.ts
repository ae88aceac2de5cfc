import { devices } from "@playwright/test";

import { expect, expectAccessible, expectFits, expectSurface, test } from "./fixture";
import { addedModel, registeredHead } from "./seed";

test.use({
    viewport: { width: 360, height: 740 },
    hasTouch: true,
    isMobile: true,
    userAgent: devices["Pixel 5"].userAgent,
});

test("every page fits on a phone, in light and dark, and can be touched", async ({ page, server }) => {
    const { set, job, model } = await registeredHead(server, "On a phone");
    const jug = await addedModel(server, "jug", "thing");
    const places = [
        "",
        "scan-sets",
        `scan-sets/${set}`,
        `scan-sets/${set}/hints`,
        "jobs",
        `jobs/${job}`,
        `models/${model}`,
        `models/${model}?reference=${jug}`,
        `compare?a=${model}&b=${jug}`,
        "gallery",
        "gallery?standard=face",
        "evaluation",
        "standards",
        "bin",
    ];
    for (const scheme of ["light", "dark"] as const) {
        await page.emulateMedia({ colorScheme: scheme });
        for (const place of places) {
            await test.step(`${scheme}: ${place}`, async () => {
                await page.goto(`/#/${place}`);
                await expect(page.getByRole("heading", { level: 1 })).toBeVisible();
                await expect(page.getByText("Loading …")).toHaveCount(0);
                await expectFits(page);
                await expectAccessible(page);
            });
        }
    }
    await page.goto(`/#/models/${model}`);
    await expectSurface(page);
    await page.getByRole("button", { name: "Measure" }).tap();
    const canvas = page.locator(".viewer canvas");
    await canvas.scrollIntoViewIfNeeded();
    const box = (await canvas.boundingBox())!;
    await page.touchscreen.tap(box.x + box.width / 2, box.y + box.height / 2);
    await expect(page.getByTestId("distance")).toHaveText("Now the second point.");
    await page.goto("/docs");
    await expect(page.getByRole("heading", { name: "API reference" })).toBeVisible();
    await expect(page.locator("article").first()).toBeVisible();
    await expectFits(page);
    await expectAccessible(page);
    await fetch(`${server.url}/v1/scan-sets/${set}`, { method: "DELETE" });
    await fetch(`${server.url}/v1/models/${jug}`, { method: "DELETE" });
});
