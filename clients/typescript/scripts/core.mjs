// tsc passes over files that hold declarations alone.
import { copyFile } from "node:fs/promises";

const here = new URL("../", import.meta.url);
await copyFile(new URL("src/core.d.ts", here), new URL("dist/core.d.ts", here));
