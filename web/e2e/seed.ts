import { readFileSync } from "node:fs";
import { basename, join } from "node:path";

import { demo, scansOfHead, type Server } from "./server";

async function answered<T>(call: Promise<Response>): Promise<T> {
    const response = await call;
    if (!response.ok) throw new Error(`${response.status}: ${await response.text()}`);
    return response.json() as Promise<T>;
}

const file = (path: string) => new Blob([readFileSync(path)]);

/** Registers scans of the head without the page; answers with its set, job and model. */
export async function registeredHead(
    server: Server,
    name = "Head",
): Promise<{ set: string; job: string; model: string }> {
    const form = new FormData();
    form.append("name", name);
    form.append("unit", "mm");
    form.append("label", "face");
    for (const path of scansOfHead()) form.append("scans", file(path), basename(path));
    form.append("poses", file(join(demo(), "head", "rough.json")), "rough.json");
    const job = await ended(
        server,
        await answered<Job>(fetch(`${server.url}/v1/jobs/upload`, { method: "POST", body: form })),
    );
    return { set: job.scan_set_id, job: job.id, model: job.model_id };
}

/** Registers a set again with other options; answers with the model. */
export async function registeredAgain(server: Server, set: string, options: object): Promise<string> {
    const job = await answered<Job>(
        fetch(`${server.url}/v1/jobs`, {
            method: "POST",
            headers: { "content-type": "application/json" },
            body: JSON.stringify({ scan_set_id: set, options }),
        }),
    );
    return (await ended(server, job)).model_id;
}

interface Job {
    id: string;
    status: string;
    model_id: string;
    scan_set_id: string;
}

async function ended(server: Server, job: Job): Promise<Job> {
    let now = job;
    while (now.status === "queued" || now.status === "running")
        now = await answered(fetch(`${server.url}/v1/jobs/${job.id}?wait=60`));
    if (now.status !== "succeeded") throw new Error(`the job ${now.status}`);
    return now;
}

/** Puts a finished cloud of the demo into the gallery. */
export async function addedModel(server: Server, name: "decoy" | "jug" | "head", label: string): Promise<string> {
    const form = new FormData();
    form.append("model", file(join(demo(), `${name}_cloud.ply`)), `${name}.ply`);
    form.append("name", name);
    form.append("unit", "mm");
    form.append("label", label);
    return (await answered<{ id: string }>(fetch(`${server.url}/v1/models`, { method: "POST", body: form }))).id;
}
