// What a browser loads asks for nothing that only Node has.
import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { test } from "node:test";

test("what a browser loads imports nothing of Node", async () => {
    const [seen, found] = [new Set(), new Set()];
    const look = async (url) => {
        if (seen.has(url.href)) return;
        seen.add(url.href);
        const source = await readFile(url, "utf8");
        for (const [, name] of source.matchAll(/(?:from|import)\s*\(?\s*["']([^"']+)["']/g)) {
            if (name.startsWith(".")) await look(new URL(name, url));
            else found.add(name);
        }
        assert.doesNotMatch(source, /\b(process|Buffer|require)\b/, url.href);
    };
    await look(new URL(import.meta.resolve("visage-client")));
    assert.deepEqual([...found], ["openapi-fetch"]);
    assert(seen.size >= 5, "all of it was looked at");
});
