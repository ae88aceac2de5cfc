import { readFileSync } from "node:fs";

import { drawn, expect, expectAccessible, expectSurface, test } from "./fixture";
import { scansOfHead } from "./server";

test("nothing is drawn while nothing changes", async ({ page, server }) => {
    const form = new FormData();
    form.append("model", new Blob([readFileSync(scansOfHead()[0]!)]), "part.ply");
    const answer = await fetch(`${server.url}/v1/models`, { method: "POST", body: form });
    const { id } = (await answer.json()) as { id: string };
    await page.goto(`/#/models/${id}`);
    await expectSurface(page);
    // two frames of the browser's own later as many pictures were drawn as before
    const settled = async () => {
        const before = await drawn(page);
        await page.evaluate(
            () => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve))),
        );
        return (await drawn(page)) === before;
    };
    await expect.poll(settled).toBe(true);
    await expectAccessible(page);
    await fetch(`${server.url}/v1/models/${id}`, { method: "DELETE" });
});
