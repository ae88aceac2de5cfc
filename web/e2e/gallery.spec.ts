import { join } from "node:path";

import { expect, expectAccessible, test } from "./fixture";
import { addedModel } from "./seed";
import { demo } from "./server";

test("the gallery is filled, searched in every way, and evaluated", async ({ page, server }) => {
    const decoy = await addedModel(server, "decoy", "thing");
    const jug = await addedModel(server, "jug", "thing");
    await page.goto("/#/gallery");
    const cards = page.locator(".card");
    await expect(cards).toHaveCount(2);

    await test.step("a model is added", async () => {
        await page.getByText("Add a model").first().click();
        await page.getByLabel("File of the model").setInputFiles(join(demo(), "head_cloud.ply"));
        await page.getByLabel("Name (optional)").fill("A head");
        await page.getByLabel("Label (optional)").fill("face");
        await page.getByLabel("Unit", { exact: true }).selectOption("mm");
        await page.getByRole("button", { name: "Add a model" }).click();
        await expect(page.getByText("“A head” is added.").first()).toBeVisible({ timeout: 60_000 });
        await expect(cards).toHaveCount(3);
        await page.getByText("Add a model").first().click();
    });

    await test.step("by text and by label", async () => {
        await page.getByLabel("Name or label").fill("jug thing");
        await expect(cards).toHaveCount(1);
        await page.getByLabel("Name or label").fill("");
        await page.getByLabel("Label", { exact: true }).fill("face");
        await expect(cards).toHaveCount(1);
        await expect(page.getByRole("link", { name: "A head", exact: true })).toBeVisible();
        await page.getByLabel("Label", { exact: true }).fill("");
        await expect(cards).toHaveCount(3);
    });

    await test.step("by standard", async () => {
        await page.getByLabel("Question").first().selectOption({ label: "Which are: face" });
        await expect(page.locator(".card", { hasText: "A head" }).getByText("match", { exact: true })).toBeVisible();
        await expect(page.getByText("no match", { exact: true })).toHaveCount(2);
        await page.getByLabel("Matches only").check();
        await expect(cards).toHaveCount(1);
        await page.getByLabel("Matches only").uncheck();
        await expect(cards).toHaveCount(3);
        // the server answers with those that have the words
        const narrowed = page.waitForRequest(
            (request) =>
                request.url().endsWith("/v1/queries") && (request.postData() ?? "").includes('"text":"JUG thing"'),
        );
        await page.getByLabel("Name or label").fill("JUG thing");
        await narrowed;
        await expect(cards).toHaveCount(1);
        await expect(cards.first()).toContainText("no match");
        await page.getByLabel("Name or label").fill("");
        await expect(cards).toHaveCount(3);
    });

    await test.step("like one of them", async () => {
        await page.getByRole("link", { name: "Like this: A head" }).click();
        await expect(page.getByRole("link", { name: "Like “A head”" })).toBeVisible();
        await expect(cards).toHaveCount(2);
        await expectAccessible(page);
    });

    await test.step("like a file, and whether that is a face", async () => {
        await page.getByLabel("Question").first().selectOption({ label: "Models like a file of mine" });
        await page.getByLabel("File", { exact: true }).setInputFiles(join(demo(), "head_cloud.ply"));
        await page.getByLabel("Unit", { exact: true }).last().selectOption("mm");
        await page.getByRole("button", { name: "Ask", exact: true }).click();
        await expect(cards.first()).toContainText("A head", { timeout: 60_000 });
        await expect(cards).toHaveCount(3);
        await page.getByLabel("Name or label").fill("dec");
        await expect(cards).toHaveCount(1, { timeout: 60_000 });
        await expect(cards.first()).toContainText("decoy");
        await page.getByLabel("Name or label").fill("");
        await expect(cards).toHaveCount(3, { timeout: 60_000 });
        await page.getByLabel("Question").last().selectOption({ label: "Is it: face?" });
        await page.getByRole("button", { name: "Ask", exact: true }).click();
        await expect(page.getByText("Your file is one.")).toBeVisible({ timeout: 60_000 });
        await expectAccessible(page);
    });

    await test.step("by the labels", async () => {
        await page.getByRole("link", { name: "Evaluation" }).click();
        await page.getByRole("button", { name: "Evaluate" }).click();
        await expect(page.getByRole("heading", { name: "Rankings by likeness" })).toBeVisible({ timeout: 60_000 });
        const picture = page.getByRole("img", { name: "Picture of the ROC curve", exact: false });
        await expect
            .poll(() => picture.evaluate((image) => (image as HTMLImageElement).naturalWidth))
            .toBeGreaterThan(0);
        await expectAccessible(page);
    });

    await page.goto("/#/gallery");
    await page.getByRole("button", { name: "Delete: A head" }).click();
    await expect(page.getByRole("dialog")).toContainText("For 7 days it can be put back");
    await page.getByRole("dialog").getByRole("button", { name: "Delete" }).click();
    await expect(cards).toHaveCount(2);

    await test.step("what was deleted is put back", async () => {
        await page.getByRole("link", { name: "Recycle bin" }).click();
        await expect(page.getByRole("row", { name: "A head" })).toBeVisible();
        await expectAccessible(page);
        await page.getByRole("button", { name: "Put back: A head" }).click();
        await expect(page.getByRole("row", { name: "A head" })).toHaveCount(0);
        await page.goto("/#/gallery");
        await expect(cards).toHaveCount(3);
        await page.getByRole("button", { name: "Delete: A head" }).click();
        await page.getByRole("dialog").getByRole("button", { name: "Delete" }).click();
        await expect(cards).toHaveCount(2);
    });
    for (const id of [decoy, jug]) await fetch(`${server.url}/v1/models/${id}`, { method: "DELETE" });
});
