// The whole way against a live service: VISAGE_SERVER, and in VISAGE_SCANS what `visage demo --out` leaves of the head.
import assert from "node:assert/strict";
import { createServer } from "node:http";
import { join } from "node:path";
import { test } from "node:test";

import { Client, NoConnection, NotRegistered, Refused, given } from "visage-client";
import { file, folder } from "visage-client/node";

const { VISAGE_SERVER: url, VISAGE_SCANS: scans } = process.env;
assert(url && scans, "VISAGE_SERVER and VISAGE_SCANS say where");
const client = new Client(url);

async function chosen() {
    const all = (await folder(scans)).filter((scan) => scan.name.endsWith(".ply")).slice(0, 4);
    return { all, poses: await file(join(scans, "rough.json")) };
}

test("a folder becomes a model, which is found and gone again", async () => {
    const { all, poses } = await chosen();
    const told = [];
    const result = await client.register(all, {
        poses,
        unit: "mm",
        name: "head",
        label: "face",
        options: { threads: 1 },
        progress: (what, done) => told.push([what, done]),
    });
    assert.equal(result.job.status, "succeeded");
    assert(["good", "doubtful", "failed"].includes(result.quality), result.quality);
    assert.deepEqual(Object.keys(result.poses).sort(), all.map((scan) => scan.name).sort());
    const shares = told.map(([, done]) => done);
    assert.deepEqual(shares, [...shares].sort((a, b) => a - b), "it only ever grows");
    assert.deepEqual(told.at(-1), ["succeeded", 1]);
    assert(told.some(([what]) => what === `sending ${all[0].name}`));
    const cloud = await result.cloud();
    assert.equal(await cloud.slice(0, 4).text(), "ply\n");

    const alike = await client.like(new File([cloud], "probe.ply"), { unit: "mm", limit: 3 });
    assert.equal(alike[0].model_id, result.model.id);
    assert((await client.matching("face", { onlyMatches: false })).some((match) => match.model_id === result.model.id));
    const again = await client.wait(result.job.id);
    assert.deepEqual(again.poses, result.poses);
    const path = { id: result.job.scan_set_id };
    await given(client.core.DELETE("/v1/scan-sets/{id}", { params: { path } }));
    await assert.rejects(client.wait(result.job.id), (error) => error instanceof Refused && error.code === "not_found");
});

test("lists are gone through page by page", async () => {
    const ball = (x) => new File([`v ${x} 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n`], "triangle.obj");
    const made = [];
    for (let index = 1; index <= 3; index++) {
        const { id } = await client.upload([ball(index)], { name: `page ${index}` });
        made.push(id);
    }
    const seen = [];
    const { everyItem } = await import("visage-client");
    const page = (cursor) =>
        given(client.core.GET("/v1/scan-sets", { params: { query: { limit: 1, ...(cursor && { cursor }) } } }));
    for await (const set of everyItem(page)) seen.push(set.id);
    for (const id of made) {
        assert(seen.includes(id));
        await given(client.core.DELETE("/v1/scan-sets/{id}", { params: { path: { id } } }));
    }
    for await (const model of client.models()) assert(model.id);
});

test("a large scan goes piece by piece and arrives as it was", async () => {
    const points = 500_000;
    const head = `ply\nformat binary_little_endian 1.0\nelement vertex ${points}\nproperty float x\nproperty float y\nproperty float z\nend_header\n`;
    const values = Float32Array.from({ length: 3 * points }, (_, index) => Math.sin(index) * 50);
    const large = new File([head, values], "large.ply");
    assert(large.size > 5e6);
    const told = [];
    const set = await client.upload([large], { progress: (what, done) => told.push(done) });
    assert.deepEqual([set.scans.length, set.scans[0].bytes, set.scans[0].points], [1, large.size, points]);
    await given(client.core.DELETE("/v1/scan-sets/{id}", { params: { path: { id: set.id } } }));
});

test("what the service refuses is told with code, hint and scan", async () => {
    const broken = new File(["ply\n"], "broken.ply");
    await assert.rejects(client.upload([broken]), (error) => {
        assert(error instanceof Refused);
        assert.deepEqual([error.status, error.code, error.scan], [422, "unreadable_scan", "broken.ply"]);
        return error.hint.length > 0;
    });
    const { all } = await chosen();
    const set = await client.upload(all.slice(0, 2));
    const body = { scan_set_id: set.id, options: { threads: 1 } };
    const job = await given(client.core.POST("/v1/jobs", { body }));
    await given(client.core.POST("/v1/jobs/{id}/cancel", { params: { path: { id: job.id } } }));
    await assert.rejects(client.wait(job.id), (error) => error instanceof NotRegistered && error.job.status === "canceled");
    await given(client.core.DELETE("/v1/scan-sets/{id}", { params: { path: { id: set.id } } }));
});

test("a busy service is asked again, one that is gone is named", async () => {
    let asked = 0;
    const busy = createServer((request, response) => {
        asked += 1;
        response.writeHead(asked < 3 ? 503 : 200, { "content-type": "application/json" });
        response.end(asked < 3 ? "{}" : '{"items":[],"next_cursor":null}');
    });
    await new Promise((resolve) => busy.listen(0, "127.0.0.1", resolve));
    const patience = { pause: 1 };
    const late = new Client(`http://127.0.0.1:${busy.address().port}/`, { patience });
    for await (const job of late.jobs()) assert.fail(job.id);
    assert.equal(asked, 3);
    busy.closeAllConnections();
    await new Promise((resolve) => busy.close(resolve));
    await assert.rejects(late.info(), NoConnection);
});
