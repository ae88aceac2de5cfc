import { mkdirSync, writeFileSync } from "node:fs";
import { join } from "node:path";

import type { Page } from "@playwright/test";

import { expectSurface, test } from "../e2e/fixture";
import { addedModel, registeredAgain, registeredHead } from "../e2e/seed";
import { scansOfHead } from "../e2e/server";

/** `ALL` names a folder for every view in both sizes and colours, to be looked at; the documents get a few. */
const all = process.env["ALL"];
const documents = new URL("../../docs/pictures/", import.meta.url).pathname;

/** Kinds of pictures that the server draws, as a sheet shows them beside each other. */
const sheets: Record<string, { of: string[]; size: [number, number]; columns: number; hasNames: boolean }> = {
    model: { of: ["views", "start", "section", "landmarks"], size: [480, 340], columns: 2, hasNames: false },
    pictures: {
        of: [
            "thumbnail",
            "shaded",
            "views",
            "start",
            "section",
            "support",
            "saliency",
            "regions",
            "landmarks",
            "deviation",
            "overlap",
            "graph",
            "convergence",
        ],
        size: [400, 300],
        columns: 3,
        hasNames: true,
    },
};

const sizes = { wide: { width: 1280, height: 860 }, narrow: { width: 360, height: 740 } };

interface View {
    name: string;
    place: string;
    prepare?: (page: Page) => Promise<void>;
    /** As what the documents have it, and in which colours. */
    document?: ["light" | "dark", string];
}

const surface = async (page: Page) => {
    await expectSurface(page);
    // what was asked for last is on the screen two frames later
    await page.evaluate(() => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve))));
};

test("pictures of the page", async ({ page, server, watch }) => {
    watch.allow(/status of (404|422)/);
    const { set, job, model } = await registeredHead(server);
    const other = await registeredAgain(server, set, { method: "ma-icp" });
    await addedModel(server, "decoy", "thing");
    await addedModel(server, "jug", "thing");
    await addedModel(server, "head", "face");
    const views: View[] = [
        {
            name: "scan-sets",
            place: "scan-sets",
            prepare: async (page) => void (await page.getByTestId("files").setInputFiles(scansOfHead())),
            document: ["light", "page_scans"],
        },
        {
            name: "scan-set",
            place: `scan-sets/${set}`,
            prepare: (page) => page.getByText("Options", { exact: false }).first().click(),
        },
        { name: "hints", place: `scan-sets/${set}/hints` },
        { name: "jobs", place: "jobs" },
        { name: "job", place: `jobs/${job}` },
        { name: "model", place: `models/${model}`, prepare: surface, document: ["light", "page_model"] },
        {
            name: "model-cloud",
            place: `models/${model}`,
            document: ["dark", "page_cloud"],
            prepare: async (page) => {
                await surface(page);
                await page.getByLabel("Show", { exact: true }).selectOption("cloud");
                await page.getByLabel("Colour by").selectOption("view");
                await page.getByLabel("Cut across").selectOption("0");
                await surface(page);
            },
        },
        {
            name: "model-start",
            place: `models/${model}`,
            prepare: async (page) => {
                await surface(page);
                await page.getByLabel("Show", { exact: true }).selectOption("cloud");
                await surface(page);
                await page.getByLabel("Cut across").selectOption("0");
                await page.getByLabel("Scans where they began, before refinement").check();
                await surface(page);
            },
        },
        {
            name: "saliency",
            place: `models/${model}`,
            prepare: async (page) => {
                await surface(page);
                await page.getByLabel("Colour by").selectOption("saliency");
                await page.getByTestId("legend").waitFor();
                await surface(page);
            },
        },
        {
            name: "compare",
            place: `compare?a=${other}&b=${model}`,
            document: ["light", "page_compare"],
            prepare: async (page) => {
                await surface(page);
                await page.getByLabel("Colour by").selectOption("deviation");
                await page.getByTestId("legend").nth(1).waitFor();
                await page.getByLabel("Cut across").selectOption("0");
                await surface(page);
            },
        },
        {
            name: "triangle",
            place: `models/${model}`,
            prepare: async (page) => {
                await surface(page);
                await page.getByRole("button", { name: "Pick three points" }).click();
                const box = (await page.locator(".viewer canvas").boundingBox())!;
                for (const [x, y] of [
                    [-30, -20],
                    [30, -20],
                    [0, 30],
                ] as const)
                    await page
                        .locator(".viewer canvas")
                        .click({ position: { x: box.width / 2 + x, y: box.height / 2 + y } });
                await surface(page);
            },
        },
        { name: "gallery", place: "gallery?standard=face", document: ["light", "page_gallery"] },
        { name: "standards", place: "standards" },
        {
            name: "evaluation",
            place: "evaluation",
            prepare: async (page) => {
                await page.getByRole("button", { name: "Evaluate" }).click();
                await page.getByText("Area under", { exact: false }).waitFor();
            },
        },
    ];
    if (all) mkdirSync(all, { recursive: true });
    for (const [size, viewport] of Object.entries(sizes)) {
        for (const scheme of ["light", "dark"] as const) {
            await page.setViewportSize(viewport);
            await page.emulateMedia({ colorScheme: scheme });
            for (const { name, place, prepare, document } of views) {
                const isWanted = size === "wide" && document?.[0] === scheme;
                if (!all && !isWanted) continue;
                await page.goto("about:blank");
                await page.goto(`${server.url}/#/${place}`);
                await page.getByRole("heading", { level: 1 }).waitFor();
                await page.waitForLoadState("networkidle");
                await prepare?.(page);
                if (all) await page.screenshot({ path: join(all, `${name}-${size}-${scheme}.png`), fullPage: true });
                if (isWanted && document)
                    await page.screenshot({ path: join(documents, `${document[1]}.jpg`), type: "jpeg", quality: 72 });
            }
            if (!all) continue;
            await page.goto(`${server.url}/docs#info`);
            await page.getByRole("heading", { level: 1 }).waitFor();
            await page.screenshot({ path: join(all, `docs-${size}-${scheme}.png`) });
            await page.goto(`${server.url}/v1/models/${model}/report.html`);
            await page.screenshot({ path: join(all, `report-${size}-${scheme}.png`), fullPage: true });
        }
    }
    await page.emulateMedia({ colorScheme: "light" });
    const drawn = (kind: string, [width, height]: readonly [number, number]) =>
        picture(`${server.url}/v1/models/${model}/pictures/${kind}?size=${width}x${height}&other=${other}`);
    for (const [name, { of, size, columns, hasNames }] of Object.entries(sheets)) {
        const figures = await Promise.all(
            of.map(
                async (kind) =>
                    `<figure><img src="${await drawn(kind, size)}"><figcaption>${kind}</figcaption></figure>`,
            ),
        );
        const style = `body { margin: 0; display: grid; gap: 2px; grid-template-columns: repeat(${columns}, ${size[0]}px); background: #ccc }
            figure { margin: 0; background: #fafaf8; font: 14px sans-serif; text-align: center }
            img { display: block } figcaption { padding: 3px; ${hasNames ? "" : "display: none"} }`;
        await page.setViewportSize({ width: columns * (size[0] + 2) - 2, height: 200 });
        await page.goto("about:blank");
        await page.setContent(`<style>${style}</style>${figures.join("")}`);
        await page.screenshot({ path: join(documents, `${name}.jpg`), type: "jpeg", quality: 80, fullPage: true });
    }
    if (!all) return;
    for (const kind of sheets["pictures"]!.of)
        writeFileSync(
            join(all, `picture-${kind}.png`),
            Buffer.from((await drawn(kind, [1024, 768])).split(",")[1]!, "base64"),
        );
});

/** A picture of the server as the address of itself. */
async function picture(url: string): Promise<string> {
    const answer = await fetch(url);
    if (!answer.ok) throw new Error(`${url}: ${await answer.text()}`);
    return `data:image/png;base64,${Buffer.from(await answer.arrayBuffer()).toString("base64")}`;
}
