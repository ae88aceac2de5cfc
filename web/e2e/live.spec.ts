import { expect, test } from "./fixture";
import { scansOfHead } from "./server";

test("a job is followed through a crash of the server, and run with other options", async ({ page, server, watch }) => {
    await page.goto("/");
    await page.getByTestId("files").setInputFiles(scansOfHead());
    await page.getByRole("button", { name: "Store 8 files" }).click();
    await page.getByRole("button", { name: "Register these scans" }).click();
    await expect(page.getByText(/^Now: /)).toBeVisible();
    await expect(page.getByText("live", { exact: true })).toBeVisible();
    watch.allow(/ERR_/);
    await server.stop("SIGKILL");
    await expect(page.getByText("connecting again …")).toBeVisible();
    await server.start();
    await expect(page.getByText("Started 2 times", { exact: false })).toBeVisible();
    await expect(page.getByRole("link", { name: "Open the model" })).toBeVisible({ timeout: 170_000 });

    await page.getByText("Run with other options").click();
    await page.getByLabel("min_overlap").fill("2");
    await expect(page.getByText("Some options are outside of their range.")).toBeVisible();
    await page.getByLabel("min_overlap").fill("0.4");
    await page.getByLabel("mesh", { exact: true }).selectOption("false");
    const sent = page.waitForRequest((request) => request.method() === "POST" && request.url().endsWith("/v1/jobs"));
    await page.getByRole("button", { name: "Start the job" }).click();
    expect((await sent).postDataJSON()).toMatchObject({ options: { min_overlap: 0.4, mesh: false } });
    await page.getByRole("button", { name: "Stop the job" }).click();
    await expect(page.getByText("stopped", { exact: true })).toBeVisible();
    await page.getByRole("button", { name: "Run again" }).click();
    await page.getByRole("button", { name: "Stop the job" }).click();
    await expect(page.getByText("stopped", { exact: true })).toBeVisible();
    await page.getByRole("link", { name: "To the scan set" }).click();
    await expect(page.getByRole("heading", { name: "Jobs of this set" })).toBeVisible();
    const id = new URL(page.url()).hash.split("/").at(-1);
    await fetch(`${server.url}/v1/scan-sets/${id}`, { method: "DELETE" });
});
