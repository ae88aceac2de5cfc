import { readFileSync } from "node:fs";
import { basename } from "node:path";

import { de } from "../src/texts/de";
import { expect, expectAccessible, test } from "./fixture";
import { scansOfHead } from "./server";

test("a folder that is dropped makes a set of its name; its poses are known", async ({ page, server }) => {
    await page.goto("/");
    const files = scansOfHead()
        .slice(0, 2)
        .map((path) => ({ name: basename(path), content: readFileSync(path).toString("base64") }));
    // a drop with real entries can only be made by hand of files: folders have their own test of names
    const transfer = await page.evaluateHandle((given) => {
        const transfer = new DataTransfer();
        for (const { name, content } of given)
            transfer.items.add(new File([Uint8Array.from(atob(content), (sign) => sign.charCodeAt(0))], name));
        transfer.items.add(new File(["[]"], "notes.md"));
        return transfer;
    }, files);
    await page.dispatchEvent(".drop", "drop", { dataTransfer: transfer });
    await expect(page.getByRole("row", { name: /scan_0\d\.ply/ })).toHaveCount(2);
    await expect(page.getByLabel("Taken as: notes.md")).toHaveValue("skip");
    await page.getByRole("button", { name: "Store 2 files" }).click();
    await expect(page.getByText("2 scans", { exact: false })).toBeVisible();
    const id = page.url().split("/").at(-1);
    await fetch(`${server.url}/v1/scan-sets/${id}`, { method: "DELETE" });
});

test("a file that can't be read is named with its remedy, the others are kept", async ({ page, server, watch }) => {
    watch.allow(/status of 422/);
    await page.goto("/");
    const whole = { name: "a.ply", mimeType: "application/octet-stream", buffer: readFileSync(scansOfHead()[0]!) };
    const broken = { name: "b.ply", mimeType: "application/octet-stream", buffer: Buffer.from("ply\nnonsense") };
    await page.getByTestId("files").setInputFiles([whole, broken]);
    await page.getByRole("button", { name: "Store 2 files" }).click();
    await expect(page.getByText("1 file was refused.", { exact: false }).first()).toBeVisible();
    await expect(page.getByText("What to do:").first()).toBeVisible();
    await expect(page.getByText("stored", { exact: true })).toBeVisible();
    await expectAccessible(page);
    await page.getByRole("button", { name: "Open the scan set" }).click();
    const id = new URL(page.url()).hash.split("/").at(-1);
    // nothing more is asked for of what goes
    await page.goto("about:blank");
    await fetch(`${server.url}/v1/scan-sets/${id}`, { method: "DELETE" });
});

test("a lost server is said, and the page goes on when it is back", async ({ page, server, watch }) => {
    await page.goto("/#/jobs");
    await expect(page.getByText("No jobs yet.", { exact: false })).toBeVisible();
    watch.allow(/ERR_/);
    await server.stop();
    await page.getByRole("link", { name: "Gallery" }).click();
    await expect(page.getByText("The server does not answer. Trying again …")).toBeVisible();
    await server.start();
    await expect(page.getByText("The server does not answer. Trying again …")).toHaveCount(0);
    await expect(page.getByText("No models yet.", { exact: false })).toBeVisible();
});

test("scans that were being sent when the server went away are sent again", async ({ page, server, watch }) => {
    await page.goto("/");
    await page.getByTestId("files").setInputFiles(scansOfHead().slice(0, 2));
    watch.allow(/ERR_/);
    // the second scan is held back until the server is gone
    let release = () => {};
    const isGone = new Promise<void>((resolve) => (release = resolve));
    let held = 0;
    await page.route("**/scans/scan_01.ply", async (route) => {
        held += 1;
        if (held === 1) await isGone;
        await route.continue();
    });
    await page.getByRole("button", { name: "Store 2 files" }).click();
    await expect(page.getByRole("row", { name: /scan_00\.ply/ }).getByText("stored")).toBeVisible();
    await server.stop();
    release();
    await expect(page.getByText("is sent again")).toBeVisible();
    await server.start();
    await expect(page.getByRole("row", { name: /scan_0\d\.ply/ })).toHaveCount(2);
    await expect(page.getByRole("button", { name: "Register these scans" })).toBeVisible();
    const id = new URL(page.url()).hash.split("/").at(-1);
    await fetch(`${server.url}/v1/scan-sets/${id}`, { method: "DELETE" });
});

test("all is told in German, too", async ({ page }) => {
    await page.goto("/");
    await page.getByLabel("Language").selectOption("de");
    await expect(page.getByText(de.upload.drop)).toBeVisible();
    await expect(page.locator("html")).toHaveAttribute("lang", "de");
    for (const [link, title] of [
        ["Aufträge", "Aufträge"],
        ["Galerie", "Galerie"],
        ["Muster", "Muster"],
    ] as const) {
        await page.getByRole("navigation").getByRole("link", { name: link }).click();
        await expect(page.getByRole("heading", { name: title, level: 1 })).toBeVisible();
        await expectAccessible(page);
    }
    await page.reload();
    await expect(page.getByRole("heading", { name: "Muster", level: 1 })).toBeVisible();
    await page.getByLabel("Sprache").selectOption("en");
});

test("the reference shows every operation, and runs its examples", async ({ page, server }) => {
    const contract = (await (await fetch(`${server.url}/openapi.json`)).json()) as { paths: Record<string, object> };
    const operations = Object.values(contract.paths).flatMap((item) => Object.keys(item));
    await page.goto("/docs");
    await expect(page.locator("article")).toHaveCount(operations.length);
    await expectAccessible(page);
    const info = page.locator("#info");
    await info.getByText("Run · Answers").click();
    await expect(info.getByText(`curl ${server.url}/v1/info`)).toBeVisible();
    await info.getByRole("button", { name: "Run: info" }).click();
    await expect(info.getByText('"job_options"')).toBeVisible();
    const query = page.locator("#query");
    await query.getByText("Run · Answers").click();
    await query.getByRole("button", { name: "Run: query" }).click();
    await expect(query.getByText('"searched"')).toBeVisible();
    await expectAccessible(page);
    await page.getByLabel("Find an operation").fill("/cancel");
    await expect(page.locator("article")).toHaveCount(1);
});

test("hints are made by picking the same places in two scans", async ({ page, server, watch }) => {
    watch.allow(/status of (400|404)/);
    await page.goto("/");
    await page.getByTestId("files").setInputFiles(scansOfHead().slice(0, 2));
    await page.getByRole("button", { name: "Store 2 files" }).click();
    await page.getByRole("link", { name: "Help with hints" }).click();
    const canvases = page.locator(".viewer canvas");
    await expect(canvases).toHaveCount(2);
    for (const index of [0, 1]) await expect(canvases.nth(index)).toHaveAttribute("data-ready", "yes");
    for (const [dx, dy] of [
        [0, 0],
        [25, 5],
        [-5, 30],
    ] as const) {
        for (const index of [0, 1]) {
            const canvas = canvases.nth(index);
            const box = (await canvas.boundingBox())!;
            await canvas.click({ position: { x: box.width / 2 + dx, y: box.height / 2 + dy } });
        }
    }
    await expect(page.getByRole("button", { name: "Remove pair 3" })).toBeVisible();
    await expectAccessible(page);
    await page.getByRole("button", { name: "Keep these pairs" }).click();
    await page.getByRole("button", { name: "These two overlap" }).click();
    await expect(page.getByText("3 pairs of points in scan_00.ply and scan_01.ply")).toBeVisible();
    await expect(page.getByText("scan_00.ply and scan_01.ply overlap")).toBeVisible();
    // what the page makes of it is what the server takes, word by word
    const sent = page.waitForRequest((request) => request.method() === "POST" && request.url().endsWith("/v1/jobs"));
    // no registration is needed to see what is sent
    await page.route("**/v1/jobs", (route) =>
        route.request().method() === "POST" ? route.fulfill({ status: 202, json: { id: "none" } }) : route.continue(),
    );
    await page.getByRole("button", { name: "Start a job with these hints" }).click();
    const body = (await sent).postDataJSON() as { hints: { points: { pairs: unknown[][][] }[]; overlaps: string[][] } };
    expect(body.hints.overlaps).toEqual([["scan_00.ply", "scan_01.ply"]]);
    expect(body.hints.points[0]?.pairs).toHaveLength(3);
    expect(body.hints.points[0]?.pairs.flat()).toHaveLength(6);
    const id = new URL(page.url()).hash.split("/").at(2);
    await page.unrouteAll();
    await fetch(`${server.url}/v1/scan-sets/${id}`, { method: "DELETE" });
});
