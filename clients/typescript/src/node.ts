// What needs a file system: everything else works in browsers, too.
import { openAsBlob } from "node:fs";
import { readdir } from "node:fs/promises";
import { basename, join } from "node:path";

/** A file; read when it is sent. */
export async function file(path: string): Promise<File> {
    return new File([await openAsBlob(path)], basename(path));
}

/** The files of a folder, in the order of their names, numbers by their value; those of folders in it are left out. */
export async function folder(path: string): Promise<File[]> {
    const entries = await readdir(path, { withFileTypes: true });
    const names = entries.filter((entry) => entry.isFile()).map((entry) => entry.name);
    names.sort(new Intl.Collator("en", { numeric: true }).compare);
    return Promise.all(names.map((name) => file(join(path, name))));
}
