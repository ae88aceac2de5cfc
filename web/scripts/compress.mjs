// Packs every file of dist beforehand, says what a first visit weighs, and tells cargo that there is a new page.
import { readdirSync, readFileSync, statSync, utimesSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { brotliCompressSync, constants, gzipSync } from "node:zlib";

const dist = new URL("../dist/", import.meta.url).pathname;
const mostBeforeAnythingShows = 400_000;

function files(folder) {
    return readdirSync(folder, { withFileTypes: true }).flatMap((entry) => {
        const path = join(folder, entry.name);
        return entry.isDirectory() ? files(path) : [path];
    });
}

const packed = new Map();
for (const file of files(dist).filter((name) => !/\.(gz|br)$/.test(name))) {
    const content = readFileSync(file);
    const parameters = { [constants.BROTLI_PARAM_QUALITY]: 11, [constants.BROTLI_PARAM_SIZE_HINT]: content.length };
    const brotli = brotliCompressSync(content, { params: parameters });
    const gzip = gzipSync(content, { level: 9 });
    packed.set(file, brotli.length);
    // what does not shrink is sent as it is
    if (brotli.length < content.length) writeFileSync(`${file}.br`, brotli);
    if (gzip.length < content.length) writeFileSync(`${file}.gz`, gzip);
}

for (const page of ["index.html", "docs.html"]) {
    const text = readFileSync(join(dist, page), "utf8");
    const named = [...text.matchAll(/(?:src|href)="\.\/([^"]+)"/g)].map((match) => join(dist, match[1]));
    if (named.every((file) => !file.endsWith(".js"))) throw new Error(`${page} names no script: is it weighed whole?`);
    const bytes = [join(dist, page), ...new Set(named)].reduce((sum, file) => sum + (packed.get(file) ?? 0), 0);
    console.log(`${page}: ${bytes} bytes packed until something is shown`);
    if (bytes > mostBeforeAnythingShows) {
        console.error(`that is more than ${mostBeforeAnythingShows}`);
        process.exit(1);
    }
}
const all = [...packed.values()].reduce((sum, bytes) => sum + bytes, 0);
console.log(`everything: ${all} bytes packed in ${packed.size} files`);

// cargo watches the build script of visage-http, since a folder that may not be there can't be watched
const watched = new URL("../../crates/http/build.rs", import.meta.url);
if (statSync(watched, { throwIfNoEntry: false })) utimesSync(watched, new Date(), new Date());
