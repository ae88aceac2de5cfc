// How long a thumbnail takes that is not in memory, and one that is: `npm run thumbnails`.
// The program is VISAGE_BIN or target/release/visage; models are code-made ones of many sizes, those of `visage demo`, and files that are
// named.
import { spawn, spawnSync } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { basename, join } from "node:path";
import { createInterface } from "node:readline";

import { ball, obj, ply, stl, xyz } from "./shapes.mjs";

const program = process.env.VISAGE_BIN ?? new URL("../../target/release/visage", import.meta.url).pathname;
/** How often the server is started anew: nothing that it has drawn is in its memory then. */
const starts = Number(process.env.STARTS ?? 5);
const rounds = Number(process.env.ROUNDS ?? 10);
const demo = process.env.VISAGE_DEMO ?? join(tmpdir(), "visage-page-demo");
/** Of the kernel's clock, a second. */
const ticks = 100;

if (!existsSync(join(demo, "head"))) spawnSync(program, ["demo", "--out", demo], { stdio: "inherit" });
const folder = mkdtempSync(join(tmpdir(), "visage-thumbnails-"));
let server;
let url;

try {
    await start();
    const models = [await registered("head"), ...(await added())];
    const times = models.map(() => ({ cold: [], cached: [], other: [], cpu: 0 }));
    for (let turn = 0; turn < starts; turn += 1) {
        await stop();
        await start();
        for (const [index, [, id]] of models.entries()) {
            const of = times[index];
            of.cold.push(await timed(() => picture(id, "")));
            for (let round = 0; round < rounds; round += 1) of.cached.push(await timed(() => picture(id, "")));
        }
    }
    for (const [index, [, id]] of models.entries()) {
        const of = times[index];
        const before = cpu();
        // a picture of another width is another picture: nothing of it is known
        for (let round = 0; round < rounds; round += 1)
            of.other.push(await timed(() => picture(id, `?size=${200 + round}x192`)));
        of.cpu = (cpu() - before) / rounds;
    }
    console.log("| model | cold, p50 and p95 ms | cached | of another size | server's CPU for that |");
    console.log("| --- | ---: | ---: | ---: | ---: |");
    for (const [index, [name]] of models.entries()) {
        const { cold, cached, other, cpu } = times[index];
        console.log(`| ${name} | ${both(cold)} | ${both(cached)} | ${both(other)} | ${cpu.toFixed(0)} |`);
    }
    const all = (kind) => both(times.flatMap((of) => of[kind]));
    console.log(`| all | ${all("cold")} | ${all("cached")} | ${all("other")} | |`);
} finally {
    await stop();
    rmSync(folder, { recursive: true, force: true });
}

async function start() {
    server = spawn(program, ["serve", "--addr", "127.0.0.1:0", "--data", folder, "--log", "warn"], {
        stdio: ["ignore", "pipe", "inherit"],
    });
    url = await new Promise((resolve) => {
        createInterface({ input: server.stdout }).on("line", (line) => resolve(line.replace("listening on ", "")));
    });
}

async function stop() {
    const ended = new Promise((resolve) => server.once("exit", resolve));
    server.kill("SIGTERM");
    await ended;
}

async function picture(id, query) {
    const response = await fetch(`${url}/v1/models/${id}/pictures/thumbnail${query}`);
    if (!response.ok) throw new Error(await response.text());
    await response.arrayBuffer();
}

async function timed(work) {
    const begin = performance.now();
    await work();
    return performance.now() - begin;
}

/** The median, and what 95 of 100 stay below. */
function both(times) {
    const sorted = [...times].sort((a, b) => a - b);
    const at = (share) => sorted[Math.min(sorted.length - 1, Math.ceil(sorted.length * share) - 1)];
    return `${at(0.5).toFixed(1)}, ${at(0.95).toFixed(1)}`;
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

/** Files of many sizes and kinds, named by what they hold. */
function* made() {
    for (const count of [2_000, 20_000, 100_000, 250_000, 500_000]) yield [`mesh-${count}.ply`, ply(ball(count, true))];
    yield ["mesh-500000.obj", obj(ball(500_000, true))];
    yield ["mesh-500000.stl", stl(ball(500_000, true))];
    for (const count of [10_000, 100_000, 300_000, 1_000_000]) yield [`cloud-${count}.ply`, ply(ball(count, false))];
    yield ["cloud-1000000.xyz", xyz(ball(1_000_000, false))];
}

/** Finished models as they are uploaded. */
async function added() {
    const paths = [join(demo, "head_cloud.ply"), join(demo, "jug_cloud.ply"), ...process.argv.slice(2)];
    const models = [];
    const add = async (name, content) => {
        const form = new FormData();
        form.append("model", content, name);
        const before = cpu();
        const { id, points } = await answered(fetch(`${url}/v1/models`, { method: "POST", body: form }));
        console.error(`${name}: stored, ${cpu() - before} ms of CPU`);
        models.push([`${name}, ${points} points`, id]);
    };
    for (const path of paths) await add(basename(path), file(path));
    for (const [name, bytes] of made()) await add(name, new Blob([bytes]));
    return models;
}
