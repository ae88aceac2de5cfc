import { readdirSync, readFileSync } from "node:fs";

import { expect, test } from "../e2e/fixture";
import type { Server } from "../e2e/server";
import { ball, ply } from "../scripts/shapes.mjs";

const rounds = 5;
/** How long a view is turned. */
const turningMs = 3000;

async function added(server: Server, name: string, content: Uint8Array<ArrayBuffer>): Promise<string> {
    const form = new FormData();
    form.append("model", new Blob([content]), name);
    const answer = await fetch(`${server.url}/v1/models`, { method: "POST", body: form });
    return ((await answer.json()) as { id: string }).id;
}

// Figures, no limits: they are for docs/PAGE.md.
test("what a first visit weighs, how long a first view takes, and how fast it turns", async ({ page, server }) => {
    const models = [
        ["mesh of 500 000 triangles", await added(server, "mesh.ply", ply(ball(500_000, true)))],
        ["cloud of 1 000 000 points", await added(server, "cloud.ply", ply(ball(1_000_000, false)))],
    ] as const;
    const { bytes, files } = await weight(async () => {
        await page.goto("/");
        await page.getByRole("heading", { level: 1 }).waitFor();
    });
    console.log(`until something is shown: ${bytes} bytes in ${files} files`);
    for (const [name, id] of models) {
        const times: number[] = [];
        for (let round = 0; round < rounds; round += 1) {
            await page.goto("about:blank");
            await page.goto(`${server.url}/#/gallery`);
            await expect(page.locator(".card")).toHaveCount(models.length);
            await page.waitForLoadState("networkidle");
            times.push(await page.evaluate(clicked, `a[href$="models/${id}"]`));
        }
        // the first turn finds out how much this machine can draw
        await page.evaluate(turning, turningMs);
        const before = browserMs();
        const turned = await page.evaluate(turning, turningMs);
        const each = (browserMs() - before) / ((turned * turningMs) / 1000);
        const shown = times.map((time) => (time / 1000).toFixed(2)).join(", ");
        console.log(
            `${name}: from click to picture ${shown} s; turned ${turned.toFixed(1)} times a second, ` +
                `${each.toFixed(0)} ms of CPU for each`,
        );
    }

    /** What comes over the wire meanwhile. */
    async function weight(visit: () => Promise<void>): Promise<{ bytes: number; files: number }> {
        const sizes: Promise<number>[] = [];
        page.on("requestfinished", (request) => {
            if (!/\/v1\//.test(request.url()))
                sizes.push(request.sizes().then(({ responseBodySize }) => responseBodySize));
        });
        await visit();
        const all = await Promise.all(sizes);
        return { bytes: all.reduce((sum, size) => sum + size, 0), files: all.length };
    }
});

/** Milliseconds that the browser has computed, all of its processes. */
function browserMs(): number {
    const stats = readdirSync("/proc")
        .filter((name) => /^\d+$/.test(name))
        .flatMap((pid) => {
            try {
                return [readFileSync(`/proc/${pid}/stat`, "utf8")];
            } catch {
                return [];
            }
        })
        .map((stat) => {
            const [head, tail] = stat.split(/\) (?!.*\) )/) as [string, string];
            const fields = tail.split(" ");
            const pid = Number(head.split(" ")[0]);
            return { pid, name: head, parent: Number(fields[1]), ticks: Number(fields[11]) + Number(fields[12]) };
        });
    const own = new Set([process.pid]);
    for (let size = 0; size !== own.size;) {
        size = own.size;
        for (const { pid, parent } of stats) if (own.has(parent)) own.add(pid);
    }
    const isBrowser = ({ pid, name }: { pid: number; name: string }) => own.has(pid) && /chrom|headless/.test(name);
    // a tick of the kernel's clock is 10 ms
    return stats.filter(isBrowser).reduce((sum, { ticks }) => sum + 10 * ticks, 0);
}

/** Milliseconds from a click on a link until a surface is drawn; runs in the page. */
function clicked(link: string): Promise<number> {
    const begin = performance.now();
    (document.querySelector(link) as HTMLElement).click();
    return new Promise((resolve) => {
        const look = () => {
            const canvas = document.querySelector<HTMLElement>(".viewer canvas[data-ready=yes]");
            if (Number(canvas?.dataset["drawn"] ?? 0) > 0) resolve(performance.now() - begin);
            else requestAnimationFrame(look);
        };
        look();
    });
}

/** How often a second the view is drawn while a key is held down; runs in the page. */
function turning(milliseconds: number): Promise<number> {
    const canvas = document.querySelector<HTMLElement>(".viewer canvas")!;
    const drawn = () => Number(canvas.dataset["drawn"]);
    const [begin, before] = [performance.now(), drawn()];
    return new Promise((resolve) => {
        const press = () => {
            const spent = performance.now() - begin;
            if (spent > milliseconds) return resolve(((drawn() - before) / spent) * 1000);
            canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft", bubbles: true }));
            requestAnimationFrame(press);
        };
        press();
    });
}
