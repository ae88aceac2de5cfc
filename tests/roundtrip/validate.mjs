// Holds glTF files against the validator of Khronos: `node validate.mjs FILE...` beside an installed gltf-validator.
import { readFileSync } from "node:fs";
import validator from "gltf-validator";

let failed = false;
for (const path of process.argv.slice(2)) {
  const report = await validator.validateBytes(new Uint8Array(readFileSync(path)));
  const { numErrors, numWarnings, messages } = report.issues;
  console.log(`${path}: ${numErrors} errors, ${numWarnings} warnings, ${report.info.totalVertexCount} vertices`);
  if (numErrors > 0 || numWarnings > 0) {
    console.log(messages);
    failed = true;
  }
}
process.exit(failed ? 1 : 0);
