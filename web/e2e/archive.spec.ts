import { readFileSync } from "node:fs";
import { basename } from "node:path";
import { gzipSync } from "node:zlib";

import { expect, test } from "./fixture";
import { scansOfHead } from "./server";

/** A tar archive: for each file a head of 512 bytes and its content in whole blocks, two empty ones at the end. */
function tar(files: { name: string; content: Buffer }[]): Buffer {
    const parts = files.flatMap(({ name, content }) => {
        const head = Buffer.alloc(512);
        head.write(name, 0);
        head.write("0000644\0", 100);
        head.write(`${content.length.toString(8).padStart(11, "0")}\0`, 124);
        head.write("00000000000\0", 136);
        head.write("        0", 148);
        head.write("ustar\u000000", 257);
        head.write(
            `${head
                .reduce((sum, byte) => sum + byte, 0)
                .toString(8)
                .padStart(6, "0")}\0 `,
            148,
        );
        return [head, content, Buffer.alloc((512 - (content.length % 512)) % 512)];
    });
    return Buffer.concat([...parts, Buffer.alloc(1024)]);
}

test("an archive makes a set; what it holds beside scans is said", async ({ page, server, watch }) => {
    const scans = scansOfHead()
        .slice(0, 2)
        .map((path) => ({ name: `captured/${basename(path)}`, content: readFileSync(path) }));
    const archive = gzipSync(tar([...scans, { name: "captured/notes.md", content: Buffer.from("taken on a Sunday") }]));
    await page.goto("/");
    await page
        .getByTestId("files")
        .setInputFiles({ name: "captured.tar.gz", mimeType: "application/gzip", buffer: archive });
    await expect(page.getByLabel("Taken as: captured.tar.gz")).toHaveValue("archive");
    await expect(page.getByLabel("Name (optional)")).toHaveValue("captured");
    // the first attempt does not arrive: the second is the same request
    watch.allow(/ERR_/);
    let attempts = 0;
    await page.route("**/v1/scan-sets/upload", (route) => {
        attempts += 1;
        return attempts === 1 ? route.abort("connectionreset") : route.continue();
    });
    await page.getByRole("button", { name: "Store 1 file" }).click();
    await expect(page.getByRole("heading", { name: "captured" })).toBeVisible();
    await expect(page.getByRole("row", { name: /scan_0\d\.ply/ })).toHaveCount(2);
    await page.getByText("Files that were not kept").click();
    await expect(page.getByText("notes.md", { exact: false })).toBeVisible();
    expect(attempts).toBe(2);
    const id = new URL(page.url()).hash.split("/").at(-1);
    await fetch(`${server.url}/v1/scan-sets/${id}`, { method: "DELETE" });
});
