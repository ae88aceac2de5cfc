// The core: types of every call, made of the contract. Bodies that are files are Blobs, as openapi-typescript's manual shows.
import { access, writeFile } from "node:fs/promises";
import { pathToFileURL } from "node:url";
import openapiTS, { astToString } from "openapi-typescript";
import ts from "typescript";

// beside a copy of the package, or at the root of the repository
const here = new URL("../", import.meta.url);
const beside = new URL("openapi.yaml", here);
const contract = await access(beside).then(() => beside, () => new URL("../../openapi.yaml", here));
const blob = ts.factory.createTypeReferenceNode(ts.factory.createIdentifier("Blob"));
const types = await openapiTS(pathToFileURL(contract.pathname), {
    transform: (schema) => (schema.format === "binary" ? blob : undefined),
});
await writeFile(new URL("src/core.d.ts", here), astToString(types));
