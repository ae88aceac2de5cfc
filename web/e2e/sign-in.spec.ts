import { expect, expectAccessible, alone as test } from "./fixture";

// a key closes the server for good
test("a server with keys is shown to those who have one", async ({ page, server, watch }) => {
    const key = server.key("write");
    watch.allow(/401/);
    await page.goto("/");
    await expect(page.getByRole("heading", { name: "Sign in" })).toBeVisible();
    await expectAccessible(page);
    await page.getByLabel("Key").fill("visage_nobody");
    await page.keyboard.press("Enter");
    await expect(page.getByRole("alert")).toContainText("visage key create");
    await page.getByLabel("Key").fill(key);
    await page.keyboard.press("Enter");
    await expect(page.getByRole("heading", { name: "Scan sets", exact: true })).toBeVisible();
    // a cookie does, and no script reads it
    await page.reload();
    await expect(page.getByRole("heading", { name: "Scan sets", exact: true })).toBeVisible();
    expect(await page.evaluate(() => document.cookie)).toBe("");
    await page.getByRole("button", { name: "Sign out" }).click();
    await expect(page.getByRole("heading", { name: "Sign in" })).toBeVisible();
});
