// The whole way with openapi-fetch and the types that openapi-typescript has made: upload by form, job, wait, cloud,
// probe, delete.
// usage: tsx openapi-fetch.ts URL FOLDER
import assert from "node:assert/strict";

import createClient from "openapi-fetch";

import type { components, paths } from "./openapi-fetch/types";
import { type Scans, identity, read } from "./scans";

type Job = components["schemas"]["Job"];

const [url, folder] = process.argv.slice(2);
const client = createClient<paths>({ baseUrl: url });

/** A form as its manual shows it: the library itself sends JSON only. */
function form(body: object): FormData {
  const data = new FormData();
  for (const [name, value] of Object.entries(body)) {
    for (const item of Array.isArray(value) ? value : [value]) {
      data.append(name, item instanceof Blob ? item : typeof item === "string" ? item : JSON.stringify(item));
    }
  }
  return data;
}

/** A file as it is. */
const bytes = { bodySerializer: (body: Blob) => body, headers: { "content-type": "application/octet-stream" } };

function ok<T>(answer: { data?: T; error?: unknown }): T {
  assert(answer.data !== undefined, JSON.stringify(answer.error));
  return answer.data;
}

async function finished(job: Job): Promise<Job> {
  while (job.status === "queued" || job.status === "running") {
    job = ok(await client.GET("/v1/jobs/{id}", { params: { path: { id: job.id }, query: { wait: 60 } } }));
  }
  return job;
}

async function remove(id: string) {
  const { response } = await client.DELETE("/v1/scan-sets/{id}", { params: { path: { id } } });
  assert.equal(response.status, 204);
}

async function uploadedRegisteredAndAsked({ scans, poses }: Scans) {
  const uploaded = await client.POST("/v1/scan-sets/upload", {
    body: { scans, poses, name: "head", unit: "mm" },
    bodySerializer: form,
  });
  const set = ok(uploaded);
  assert.deepEqual(set.scans.map((scan) => scan.name), scans.map((scan) => scan.name));
  assert.deepEqual(set.poses?.scans_without_pose, []);

  // nothing that has a default need be said
  const job = await finished(ok(await client.POST("/v1/jobs", { body: { scan_set_id: set.id, label: "face" } })));
  assert.equal(job.status, "succeeded", JSON.stringify(job));
  assert(job.model_id);

  const id = job.model_id;
  const model = ok(await client.GET("/v1/models/{id}", { params: { path: { id } } }));
  const path = { id, file: "cloud.ply" as const };
  const cloud = ok(await client.GET("/v1/models/{id}/{file}", { params: { path }, parseAs: "blob" }));
  assert.equal(await cloud.slice(0, 4).text(), "ply\n");
  assert.equal(model.assets.find((asset) => asset.name === "cloud.ply")?.bytes, cloud.size);
  const motions = ok(await client.GET("/v1/models/{id}/poses.json", { params: { path: { id } } }));
  assert.deepEqual(Object.keys(motions).sort(), scans.map((scan) => scan.name).sort());
  assert.equal(motions[scans[0].name]?.[3][3], 1);

  const probe = new File([cloud], "probe.ply");
  const alike = ok(
    await client.POST("/v1/queries/probe", {
      body: { probe, unit: "mm", limit: 3, explain: true },
      bodySerializer: form,
    }),
  );
  assert.equal(alike.matches[0].model_id, id);
  assert(alike.matches[0].is_match && alike.matches[0].explain?.likeness);
  const faces = ok(await client.POST("/v1/queries", { body: { standard: "face" } }));
  assert(faces.matches.some((match) => match.model_id === id && match.landmarks?.nose_tip.length === 3));

  await remove(set.id);
  const { error } = await client.GET("/v1/jobs/{id}", { params: { path: { id: job.id } } });
  assert.equal(error?.code, "not_found");
}

async function registeredByOneForm({ scans, poses }: Scans) {
  const options = { threads: 1, reference: scans[1].name };
  const body = { scans: scans.slice(0, 2), poses, options, label: "face" };
  const job = ok(await client.POST("/v1/jobs/upload", { body, bodySerializer: form }));
  assert.deepEqual([job.options.threads, job.options.reference], [1, scans[1].name]);
  await client.POST("/v1/jobs/{id}/cancel", { params: { path: { id: job.id } } });
  await finished(job);
  assert(job.scan_set_id);
  await remove(job.scan_set_id);
}

async function storedOneByOne({ scans, poses }: Scans) {
  const { id } = ok(await client.POST("/v1/scan-sets", { body: { name: "one by one" } }));
  for (const scan of scans.slice(0, 2)) {
    const path = { id, name: scan.name };
    const stored = await client.PUT("/v1/scan-sets/{id}/scans/{name}", { params: { path }, body: scan, ...bytes });
    assert.equal(ok(stored).bytes, scan.size);
  }
  const params = { path: { id } };
  const file = ok(await client.PUT("/v1/scan-sets/{id}/pose-file", { params, body: poses, ...bytes }));
  assert.deepEqual(file.scans_without_pose, []);
  const body = { [scans[0].name]: identity, [scans[1].name]: null };
  const put = ok(await client.PUT("/v1/scan-sets/{id}/poses", { params, body }));
  assert.deepEqual(put.scans_without_pose, [scans[1].name]);
  await remove(id);
}

const all = await read(folder);
await uploadedRegisteredAndAsked(all);
await registeredByOneForm(all);
await storedOneByOne(all);
console.log("openapi-fetch: all calls answered as they should");
