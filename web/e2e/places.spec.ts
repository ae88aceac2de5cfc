import { expect, expectAccessible, expectFits, expectSurface, test } from "./fixture";
import { registeredHead } from "./seed";
import { scansOfHead } from "./server";

type Matrix = number[][];

/** Half a turn about the world's y. */
const turned = (pose: Matrix): Matrix =>
    pose.map((row, index) => (index === 0 || index === 2 ? row.map((x) => -x) : row));

test("a person chooses where a scan that fits in several ways belongs", async ({ page, server }) => {
    const { set, model, job } = await registeredHead(server, "Ambiguous");
    const poses = (await (await fetch(`${server.url}/v1/models/${model}/poses.json`)).json()) as Record<string, Matrix>;
    const [three, four] = [poses["scan_03.ply"]!, poses["scan_04.ply"]!];
    // a head does not look the same from several sides: the report of a thing that does is put in its place
    await page.route(`**/v1/models/${model}`, async (route) => {
        const response = await route.fetch();
        const body = (await response.json()) as { report: { result: Record<string, unknown> } };
        body.report.result["alternatives"] = [
            {
                name: "scan_03.ply",
                poses: [
                    { pose: turned(three), score: 1 },
                    { pose: three, score: 0.98 },
                ],
                axis: null,
                along: null,
            },
            {
                name: "scan_04.ply",
                poses: [{ pose: four, score: 1 }],
                axis: { point: [0, 0, 0], direction: [0, 1, 0] },
                along: null,
            },
        ];
        await route.fulfill({ response, json: body });
    });
    await page.goto(`/#/models/${model}`);
    await expectSurface(page);
    const title = page.getByRole("heading", { name: "Scans that fit in several ways" });
    await title.scrollIntoViewIfNeeded();
    const row = page.getByRole("group", { name: "scan_03.ply" });
    await expect(row.getByRole("radio")).toHaveCount(2);
    await expect(row.getByText("Place 2: 98% of what speaks for the best")).toBeVisible();

    await test.step("the scan is shown where it would be", async () => {
        const canvas = page.locator(".viewer canvas").first();
        const without = await canvas.screenshot();
        await row.getByLabel("Choose the file scan_03.ply to show it").setInputFiles(scansOfHead()[3]!);
        await expect(row.getByRole("button", { name: "Show this scan here" })).toHaveAttribute("aria-pressed", "true");
        await expect.poll(async () => (await canvas.screenshot()).equals(without)).toBe(false);
        const first = await canvas.screenshot();
        // with the keyboard
        await row.getByRole("radio").first().focus();
        await page.keyboard.press("ArrowDown");
        await expect(row.getByRole("radio").nth(1)).toBeChecked();
        await expect.poll(async () => (await canvas.screenshot()).equals(first)).toBe(false);
        await page.getByRole("group", { name: "scan_04.ply" }).getByLabel("Turned by", { exact: false }).fill("180");
        await expect(page.getByText("Turned by 180°")).toBeVisible();
        await expectAccessible(page);
    });

    await test.step("the job runs again from the chosen poses", async () => {
        const put = page.waitForRequest((request) => request.method() === "PUT");
        const posted = page.waitForResponse(
            (response) => response.request().method() === "POST" && response.url().endsWith("/v1/jobs"),
        );
        await page.getByRole("button", { name: "Register again with these places" }).click();
        const sent = (await put).postDataJSON() as Record<string, Matrix>;
        expect(Object.keys(sent)).toHaveLength(8);
        expect(sent["scan_03.ply"]).toEqual(three);
        const half = turned(four).flat();
        sent["scan_04.ply"]!.flat().forEach((value, index) => expect(value).toBeCloseTo(half[index]!, 6));
        const response = await posted;
        expect(response.status()).toBe(202);
        const started = (await response.json()) as { id: string };
        await expect(page.getByRole("heading", { name: "Registration" })).toBeVisible();
        expect(started.id).not.toBe(job);
        await fetch(`${server.url}/v1/jobs/${started.id}/cancel`, { method: "POST" });
        await fetch(`${server.url}/v1/jobs/${started.id}?wait=60`);
        const stored = (await (await fetch(`${server.url}/v1/scan-sets/${set}`)).json()) as {
            poses: { count: number };
        };
        expect(stored.poses.count).toBe(8);
    });

    await page.setViewportSize({ width: 360, height: 740 });
    await page.goto(`/#/models/${model}`);
    await expect(title).toBeVisible();
    await expectFits(page);
    await fetch(`${server.url}/v1/scan-sets/${set}`, { method: "DELETE" });
});
