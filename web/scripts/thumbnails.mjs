// How long a thumbnail takes that was never drawn, and one that was: `npm run thumbnails`.
// The program is VISAGE_BIN or target/release/visage; models are code-made ones of `visage demo`, and files that are named.
import { spawn, spawnSync } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { basename, join } from "node:path";
import { createInterface } from "node:readline";

const program = process.env.VISAGE_BIN ?? new URL("../../target/release/visage", import.meta.url).pathname;
const rounds = Number(process.env.ROUNDS ?? 40);
const demo = process.env.VISAGE_DEMO ?? join(tmpdir(), "visage-page-demo");
/** Of the kernel's clock, a second. */
const ticks = 100;

if (!existsSync(join(demo, "head"))) spawnSync(program, ["demo", "--out", demo], { stdio: "inherit" });
const folder = mkdtempSync(join(tmpdir(), "visage-thumbnails-"));
const server = spawn(program, ["serve", "--addr", "127.0.0.1:0", "--data", folder, "--log", "warn"], {
    stdio: ["ignore", "pipe", "inherit"],
});
const url = await new Promise((resolve) => {
    createInterface({ input: server.stdout }).on("line", (line) => resolve(line.replace("listening on ", "")));
});

try {
    const models = [await registered("head"), ...(await added())];
    console.log("| model | cold, p50 ms | cold, p95 ms | server's CPU, ms | cached, p50 ms | cached, p95 ms |");
    console.log("| --- | ---: | ---: | ---: | ---: | ---: |");
    for (const [name, id] of models) {
        const cold = await timed((round) => picture(id, 256 + round));
        const cached = await timed(() => picture(id, 256));
        const cells = [
            at(cold.times, 0.5),
            at(cold.times, 0.95),
            cold.cpu,
            at(cached.times, 0.5),
            at(cached.times, 0.95),
        ];
        console.log(`| ${name} | ${cells.map((value) => value.toFixed(1)).join(" | ")} |`);
    }
} finally {
    const ended = new Promise((resolve) => server.once("exit", resolve));
    server.kill("SIGTERM");
    await ended;
    rmSync(folder, { recursive: true, force: true });
}

/** A picture of another width is another picture: nothing of it is known. */
async function picture(id, width) {
    const response = await fetch(`${url}/v1/models/${id}/pictures/thumbnail?size=${width}x192`);
    if (!response.ok) throw new Error(await response.text());
    await response.arrayBuffer();
}

async function timed(ask) {
    const times = [];
    const before = cpu();
    for (let round = 0; round < rounds; round += 1) {
        const begin = performance.now();
        await ask(round);
        times.push(performance.now() - begin);
    }
    return { times: times.sort((a, b) => a - b), cpu: (cpu() - before) / rounds };
}

function at(sorted, share) {
    return sorted[Math.min(sorted.length - 1, Math.ceil(sorted.length * share) - 1)];
}

/** Milliseconds that the server has computed. */
function cpu() {
    const fields = readFileSync(`/proc/${server.pid}/stat`, "utf8").split(") ")[1].split(" ");
    return ((Number(fields[11]) + Number(fields[12])) / ticks) * 1000;
}

async function answered(call) {
    const response = await call;
    if (!response.ok) throw new Error(`${response.status}: ${await response.text()}`);
    return response.json();
}

function file(path) {
    return new Blob([readFileSync(path)]);
}

/** A model with its preview, as every registration leaves one. */
async function registered(name) {
    const form = new FormData();
    form.append("unit", "mm");
    for (let index = 0; index < 8; index += 1) {
        const scan = `scan_0${index}.ply`;
        form.append("scans", file(join(demo, name, scan)), scan);
    }
    form.append("poses", file(join(demo, name, "rough.json")), "rough.json");
    let job = await answered(fetch(`${url}/v1/jobs/upload`, { method: "POST", body: form }));
    while (!job.finished_at) job = await answered(fetch(`${url}/v1/jobs/${job.id}?wait=60`));
    return [`${name}, registered`, job.model_id];
}

/** Finished models without a preview. */
async function added() {
    const given = process.argv.slice(2);
    const paths = [join(demo, "head_cloud.ply"), join(demo, "jug_cloud.ply"), ...given];
    const models = [];
    for (const path of paths) {
        const form = new FormData();
        form.append("model", file(path), basename(path));
        const { id, points } = await answered(fetch(`${url}/v1/models`, { method: "POST", body: form }));
        models.push([`${basename(path)}, ${points} points`, id]);
    }
    return models;
}
