// Types for openapi-fetch, made by openapi-typescript as its manual shows for files: `format: binary` is a Blob.
// usage: node types.mjs CONTRACT OUT
import { readFile, writeFile } from "node:fs/promises";
import { pathToFileURL } from "node:url";
import openapiTS, { astToString } from "openapi-typescript";
import ts from "typescript";

const [contract, out] = process.argv.slice(2);
const blob = ts.factory.createTypeReferenceNode(ts.factory.createIdentifier("Blob"));
const types = await openapiTS(pathToFileURL(contract), {
  transform: (schema) => (schema.format === "binary" ? blob : undefined),
});
await writeFile(out, astToString(types));
