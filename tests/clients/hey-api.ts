// The whole way with a client that @hey-api/openapi-ts has made: upload by form, job, wait, cloud, probe, delete.
// usage: tsx hey-api.ts URL FOLDER
import assert from "node:assert/strict";

import { client } from "./hey-api/client.gen";
import {
  cancelJob,
  createJob,
  createScanSet,
  deleteScanSet,
  getJob,
  getModel,
  getModelFile,
  getModelPoses,
  putPoseFile,
  putPoses,
  putScan,
  query,
  queryByProbe,
  uploadJob,
  uploadScanSet,
} from "./hey-api/sdk.gen";
import type { Job } from "./hey-api/types.gen";
import { type Scans, identity, read } from "./scans";

async function finished(job: Job): Promise<Job> {
  while (job.status === "queued" || job.status === "running") {
    ({ data: job } = await getJob({ path: { id: job.id }, query: { wait: 60 }, throwOnError: true }));
  }
  return job;
}

async function uploadedRegisteredAndAsked({ scans, poses }: Scans) {
  const body = { scans, poses, name: "head", unit: "mm" as const };
  const { data: set } = await uploadScanSet({ body, throwOnError: true });
  assert.deepEqual(set.scans.map((scan) => scan.name), scans.map((scan) => scan.name));
  assert.deepEqual(set.poses?.scans_without_pose, []);

  const created = await createJob({ body: { scan_set_id: set.id, label: "face" }, throwOnError: true });
  const job = await finished(created.data);
  assert.equal(job.status, "succeeded", JSON.stringify(job));
  assert(job.model_id);

  const { data: model } = await getModel({ path: { id: job.model_id }, throwOnError: true });
  const { data: cloud } = await getModelFile({ path: { id: model.id, file: "cloud.ply" }, throwOnError: true });
  assert.equal(await cloud.slice(0, 4).text(), "ply\n");
  assert.equal(model.assets.find((asset) => asset.name === "cloud.ply")?.bytes, cloud.size);
  const { data: motions } = await getModelPoses({ path: { id: model.id }, throwOnError: true });
  assert.deepEqual(Object.keys(motions).sort(), scans.map((scan) => scan.name).sort());
  assert.equal(motions[scans[0].name]?.[3][3], 1);

  const probe = new File([cloud], "probe.ply");
  const asked = { probe, unit: "mm" as const, limit: 3, explain: true };
  const { data: alike } = await queryByProbe({ body: asked, throwOnError: true });
  assert.equal(alike.matches[0].model_id, model.id);
  assert(alike.matches[0].is_match && alike.matches[0].explain?.likeness);
  const { data: faces } = await query({ body: { standard: "face", only_matches: true }, throwOnError: true });
  assert(faces.matches.some((match) => match.model_id === model.id && match.landmarks?.nose_tip.length === 3));

  const gone = await deleteScanSet({ path: { id: set.id }, throwOnError: true });
  assert.equal(gone.response.status, 204);
  const { error } = await getJob({ path: { id: job.id } });
  assert.equal(error?.code, "not_found");
}

async function registeredByOneForm({ scans, poses }: Scans) {
  const options = { threads: 1, reference: scans[1].name };
  const body = { scans: scans.slice(0, 2), poses, options, label: "face" };
  const { data: job } = await uploadJob({ body, throwOnError: true });
  assert.deepEqual([job.options.threads, job.options.reference], [1, scans[1].name]);
  await cancelJob({ path: { id: job.id } });
  await finished(job);
  assert(job.scan_set_id);
  await deleteScanSet({ path: { id: job.scan_set_id }, throwOnError: true });
}

async function storedOneByOne({ scans, poses }: Scans) {
  const { data: set } = await createScanSet({ body: { name: "one by one" }, throwOnError: true });
  const path = { id: set.id };
  for (const scan of scans.slice(0, 2)) {
    const stored = await putScan({ path: { id: set.id, name: scan.name }, body: scan, throwOnError: true });
    assert.equal(stored.data.bytes, scan.size);
  }
  const file = await putPoseFile({ path, body: poses, throwOnError: true });
  assert.deepEqual(file.data.scans_without_pose, []);
  const put = await putPoses({ path, body: { [scans[0].name]: identity, [scans[1].name]: null }, throwOnError: true });
  assert.deepEqual(put.data.scans_without_pose, [scans[1].name]);
  await deleteScanSet({ path, throwOnError: true });
}

const [url, folder] = process.argv.slice(2);
client.setConfig({ baseUrl: url });
const all = await read(folder);
await uploadedRegisteredAndAsked(all);
await registeredByOneForm(all);
await storedOneByOne(all);
console.log("@hey-api/openapi-ts: all calls answered as they should");
