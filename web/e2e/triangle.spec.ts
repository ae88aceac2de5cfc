import { expect, expectAccessible, expectSurface, test } from "./fixture";
import { addedModel } from "./seed";

test("models are found by three points that are picked on one of them", async ({ page, server }) => {
    const head = await addedModel(server, "head", "face");
    const jug = await addedModel(server, "jug", "thing");
    await page.goto(`/#/models/${head}`);
    await expectSurface(page);
    await page.getByRole("button", { name: "Pick three points" }).click();
    const canvas = page.locator(".viewer canvas");
    await canvas.scrollIntoViewIfNeeded();
    const box = (await canvas.boundingBox())!;
    for (const [dx, dy] of [
        [-40, -30],
        [40, -30],
    ] as const)
        await canvas.click({ position: { x: box.width / 2 + dx, y: box.height / 2 + dy } });
    await expect(page.getByText("One more is needed.")).toBeVisible();
    // the last one with the keyboard, under the cross
    await canvas.focus();
    await page.keyboard.press("Enter");
    await expectAccessible(page);
    await page.getByRole("link", { name: "Find models with this triangle" }).click();
    const cards = page.locator(".card");
    await expect(cards.first()).toContainText(/matching error of the triangle [\d.]+\smm/);
    await expect(page.getByLabel("Question")).toHaveValue(/^triangle=/);
    await expectAccessible(page);
    // the answer is of the address: it can be handed on
    await page.reload();
    await expect(cards.first()).toContainText("matching error of the triangle");
    await page.getByRole("link", { name: "Show all" }).click();
    await expect(cards).toHaveCount(2);
    // what was typed by hand asks nothing, and breaks nothing
    await page.goto("/#/gallery?triangle=1,2,3&outward=x");
    await expect(cards).toHaveCount(2);
    for (const id of [head, jug]) await fetch(`${server.url}/v1/models/${id}`, { method: "DELETE" });
});

test("the server searches names and labels, in any letters", async ({ page, server }) => {
    const head = await addedModel(server, "head", "Großes Gesicht");
    const jug = await addedModel(server, "jug", "100%_thing");
    await page.goto("/#/gallery");
    const cards = page.locator(".card");
    await expect(cards).toHaveCount(2);
    const asked = page.waitForRequest(
        (request) => request.url().includes("/v1/models?") && request.url().includes("text="),
    );
    await page.getByLabel("Name or label").fill("GROSSES gesicht");
    await asked;
    await expect(page.getByText("No model fits.")).toBeVisible();
    await page.getByLabel("Name or label").fill("GROßES gesicht");
    await expect(cards).toHaveCount(1);
    await page.getByLabel("Name or label").fill("0%_");
    await expect(cards).toHaveCount(1);
    await expect(page.getByRole("link", { name: "jug", exact: true })).toBeVisible();
    await page.getByLabel("Name or label").fill("%");
    await expect(cards).toHaveCount(1);
    for (const id of [head, jug]) await fetch(`${server.url}/v1/models/${id}`, { method: "DELETE" });
});
