import { expect, expectAccessible, expectFits, test } from "./fixture";
import { scansOfHead } from "./server";

test("parts of a scan are marked as to be left out, and the job gets them", async ({ page, server, watch }) => {
    watch.allow(/status of (400|404)/);
    await page.goto("/");
    await page.getByTestId("files").setInputFiles(scansOfHead().slice(0, 2));
    await page.getByRole("button", { name: "Store 2 files" }).click();
    await page.getByRole("link", { name: "Help with hints" }).click();
    await page.getByText("Parts to use or to leave out").click();
    const part = page.getByRole("region", { name: "Parts to use or to leave out" });
    const canvas = part.locator("canvas");
    await expect(canvas).toHaveAttribute("data-ready", "yes");
    await expect(part.getByTestId("dropped")).toHaveText("Pick a place in the scan.");
    await expect(part.getByRole("button", { name: "Keep this part" })).toBeDisabled();
    const plain = await canvas.screenshot();

    // with the keyboard: what lies under the cross
    await canvas.focus();
    await page.keyboard.press("Enter");
    const share = part.getByTestId("dropped");
    await expect(share).toHaveText(/^[\d.]+% of the points of this scan are left out\.$/);
    await expect.poll(async () => (await canvas.screenshot()).equals(plain)).toBe(false);
    const small = await share.textContent();
    await part.getByLabel("Radius", { exact: false }).fill("0.4");
    await expect(share).not.toHaveText(small ?? "");
    await part.getByRole("button", { name: "Keep this part" }).click();
    await expect(page.getByText(/Part 1: scan_00\.ply, ball of radius [\d.]+, Leave it out/)).toBeVisible();

    await part.getByLabel("What to do with it").selectOption("use");
    await part.getByLabel("The part is").selectOption("+y");
    const box = (await canvas.boundingBox())!;
    await canvas.click({ position: { x: box.width / 2, y: box.height / 2 + 10 } });
    await part.getByRole("button", { name: "Keep this part" }).click();
    await expect(page.getByText("Part 2: scan_00.ply, all on one side, Use nothing else")).toBeVisible();
    await expectAccessible(page);
    await page.setViewportSize({ width: 360, height: 740 });
    await expectFits(page);

    // what the page makes of it is what the server takes, word by word
    const answered = page.waitForResponse(
        (response) => response.request().method() === "POST" && response.url().endsWith("/v1/jobs"),
    );
    await page.getByRole("button", { name: "Start a job with these hints" }).click();
    const response = await answered;
    expect(response.status()).toBe(202);
    const job = (await response.json()) as {
        id: string;
        hints: { regions: { leave?: { sphere?: { radius: number } }; use?: object }[] };
    };
    expect(job.hints.regions[0]?.leave?.sphere?.radius).toBeGreaterThan(0);
    expect(job.hints.regions[1]?.use).toBeDefined();
    await fetch(`${server.url}/v1/jobs/${job.id}/cancel`, { method: "POST" });
    await fetch(`${server.url}/v1/jobs/${job.id}?wait=60`);
});
