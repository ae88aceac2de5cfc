import { expect, expectAccessible, expectSurface, test } from "./fixture";
import { scansOfHead } from "./server";

// One story with the mouse: what comes later stands on what came before.
test("scans are dropped, registered, looked at, found and deleted", async ({ page }) => {
    await page.goto("/");
    await expect(page.getByRole("heading", { name: "Scan sets" })).toBeFocused();
    await expectAccessible(page);

    await test.step("eight scans are dropped", async () => {
        await page.getByTestId("files").setInputFiles(scansOfHead());
        await page.getByLabel("Name (optional)").fill("Head");
        await page.getByLabel("Unit", { exact: true }).selectOption("mm");
        await expect(page.getByRole("button", { name: "Store 8 files" })).toBeEnabled();
        await expectAccessible(page);
        await page.getByRole("button", { name: "Store 8 files" }).click();
        await expect(page.getByRole("heading", { name: "Head", exact: true })).toBeVisible({ timeout: 60_000 });
        await expect(page.getByRole("row", { name: /scan_0\d\.ply/ })).toHaveCount(8);
        await expectAccessible(page);
    });

    await test.step("a job is started and watched", async () => {
        await page.getByText("Options", { exact: false }).first().click();
        await expect(page.getByLabel("min_overlap")).toBeVisible();
        await page.getByLabel("Label (optional)").fill("face");
        await page.getByRole("button", { name: "Register these scans" }).click();
        await expect(page.getByRole("heading", { name: "Registration" })).toBeVisible();
        await expect(page.getByText(/^Now: /)).toBeVisible();
        await expectAccessible(page);
        await expect(page.getByRole("link", { name: "Open the model" })).toBeVisible({ timeout: 170_000 });
        await expectAccessible(page);
    });

    await test.step("the model is opened and turned", async () => {
        await page.getByRole("link", { name: "Open the model" }).click();
        await expectSurface(page);
        await expect(page.getByText("A face was found")).toBeVisible();
        await expect(page.getByText("8 of 8 scans have a place.")).toBeVisible();
        const canvas = page.locator(".viewer canvas");
        const box = (await canvas.boundingBox())!;
        const before = await canvas.screenshot();
        await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
        await page.mouse.down();
        await page.mouse.move(box.x + box.width / 2 + 120, box.y + box.height / 2 + 20, { steps: 5 });
        await page.mouse.up();
        await expect.poll(async () => (await canvas.screenshot()).equals(before)).toBe(false);
        await expectAccessible(page);
    });

    await test.step("it is cut, coloured and measured", async () => {
        const canvas = page.locator(".viewer canvas");
        const whole = await canvas.screenshot();
        await page.getByLabel("Cut across").selectOption("0");
        await expect.poll(async () => (await canvas.screenshot()).equals(whole)).toBe(false);
        await page.getByLabel("Cut across").selectOption("off");
        await page.getByLabel("Show", { exact: true }).selectOption("cloud");
        await expectSurface(page);
        await page.getByLabel("Colour by").selectOption("view");
        const all = await canvas.screenshot();
        await page.getByRole("checkbox", { name: "scan_00.ply" }).uncheck();
        await expect.poll(async () => (await canvas.screenshot()).equals(all)).toBe(false);
        const refined = await canvas.screenshot();
        await page.getByLabel("Scans where they began, before refinement").check();
        await expectSurface(page);
        await expect(page.getByLabel("Colour by")).toHaveValue("view");
        await expect.poll(async () => (await canvas.screenshot()).equals(refined)).toBe(false);
        await page.getByLabel("Show", { exact: true }).selectOption("mesh");
        await expectSurface(page);
        await expect(page.getByLabel("Scans where they began, before refinement")).toHaveCount(0);
        await page.getByRole("button", { name: "Measure" }).click();
        const box = (await canvas.boundingBox())!;
        await page.mouse.click(box.x + box.width / 2 - 30, box.y + box.height / 2);
        await expect(page.getByTestId("distance")).toHaveText("Now the second point.");
        await page.mouse.click(box.x + box.width / 2 + 30, box.y + box.height / 2);
        await expect(page.getByTestId("distance")).toHaveText(/^Distance [\d.]+\smm$/);
        await page.getByRole("button", { name: "Measure" }).click();
    });

    await test.step("landmarks are clicked, and make a standard", async () => {
        await page.getByRole("button", { name: "Pick landmarks" }).click();
        // eye corners and nose are where the server has found them: what is shown there is clicked
        const spots = page.locator(".viewer .spot");
        await page.getByRole("button", { name: "Show all" }).click();
        await expect(spots.first()).toBeVisible();
        const box = (await page.locator(".viewer canvas").boundingBox())!;
        const places = await spots.evaluateAll((all) =>
            all.map((spot) => ({
                text: spot.textContent ?? "",
                x: parseFloat((spot as HTMLElement).style.left),
                y: parseFloat((spot as HTMLElement).style.top),
            })),
        );
        const wanted = places.filter(({ text }) => /nose tip|eye . inner/.test(text)).slice(0, 3);
        expect(wanted, places.map(({ text }) => text).join()).toHaveLength(3);
        for (const [index, { x, y }] of wanted.entries()) {
            await page.mouse.click(box.x + x, box.y + y);
            await expect(page.getByLabel(`Landmark ${index + 1}`, { exact: true })).toBeVisible();
        }
        await page.getByLabel("Name of the standard").fill("my-face");
        await expectAccessible(page);
        await page.getByRole("button", { name: "Make the standard" }).click();
        await expect(page.getByText("The standard “my-face” is made.").first()).toBeVisible({ timeout: 60_000 });
    });

    await test.step("it is found among the models", async () => {
        await page.getByRole("link", { name: "Gallery" }).click();
        await expect(page.getByRole("link", { name: "Head", exact: true })).toBeVisible();
        await page.getByLabel("Question").selectOption({ label: "Which are: face" });
        const card = page.locator(".card", { hasText: "Head" });
        await expect(card.getByText("match", { exact: true })).toBeVisible();
        await expectAccessible(page);
        await page.getByRole("link", { name: "Standards" }).click();
        await expect(page.getByRole("heading", { name: /my-face/ })).toBeVisible();
        await expectAccessible(page);
        await page.getByRole("button", { name: "Delete: my-face" }).click();
        await page.getByRole("dialog").getByRole("button", { name: "Delete" }).click();
        await expect(page.getByRole("heading", { name: /my-face/ })).toHaveCount(0);
    });

    await test.step("everything is deleted", async () => {
        await page.getByRole("link", { name: "Scan sets" }).click();
        await page.getByRole("button", { name: "Delete: Head" }).click();
        const dialog = page.getByRole("dialog");
        await expect(dialog).toBeVisible();
        await expectAccessible(page);
        await dialog.getByRole("button", { name: "Cancel" }).click();
        await expect(dialog).toHaveCount(0);
        await page.getByRole("button", { name: "Delete: Head" }).click();
        await dialog.getByRole("button", { name: "Delete" }).click();
        await expect(page.getByRole("link", { name: "Head", exact: true })).toHaveCount(0);
        await page.getByRole("link", { name: "Gallery" }).click();
        await expect(page.locator(".cards")).toHaveAttribute("aria-busy", "false");
        await expect(page.getByRole("link", { name: "Head", exact: true })).toHaveCount(0);
    });
});
