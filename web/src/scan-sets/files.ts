/** A file that was dropped or chosen, with its path from the folder that was dropped. */
export interface Chosen {
    file: File;
    path: string;
}

export type Role = "scan" | "archive" | "poses" | "skip";

const archives = [".zip", ".tar", ".tar.gz", ".tgz"];
const poseFiles = [".conf", ".json", ".aln", ".mlp", ".log"];
/** Text files that hold points as well as poses: they are scans where nothing else is. */
const doubtful = [".txt", ".csv", ".asc"];
/** What these hold is in a unit that the file declares. */
const declaring = [".glb", ".gltf", ".3mf", ".las", ".laz", ".e57", ".ptx"];
/** Each scan of these becomes one of the set, which only a form does. */
const several = [".e57", ".ptx"];

const endsWith = (path: string, endings: readonly string[]) => {
    const plain = path.toLowerCase().replace(/\.gz$/, "");
    return endings.some((ending) => plain.endsWith(ending.replace(/\.gz$/, "")) || path.toLowerCase().endsWith(ending));
};

/** What each file is taken as before anybody says otherwise. `formats` are the endings that the server reads. */
export function roles(paths: readonly string[], formats: readonly string[]): Role[] {
    const isHidden = (path: string) => path.split("/").some((part) => part.startsWith(".") || part === "__MACOSX");
    const surfaces = formats.map((ending) => (ending.startsWith(".") ? ending : `.${ending}`));
    const clear = surfaces.filter((ending) => !doubtful.includes(ending) && !poseFiles.includes(ending));
    const hasClear = paths.some((path) => !isHidden(path) && endsWith(path, clear));
    const first: Role[] = paths.map((path) => {
        if (isHidden(path)) return "skip";
        if (endsWith(path, archives)) return "archive";
        if (endsWith(path, clear)) return "scan";
        if (endsWith(path, poseFiles)) return "poses";
        if (endsWith(path, doubtful)) return hasClear ? "poses" : "scan";
        return "skip";
    });
    // of several files that may hold poses a person has to choose
    const isUnsure = first.filter((role) => role === "poses").length > 1;
    return first.map((role) => (isUnsure && role === "poses" ? "skip" : role));
}

/** Whether more than one of the files that are left out may hold poses. */
export function hasSeveralPoses(paths: readonly string[], taken: readonly Role[]): boolean {
    return (
        paths.filter((path, index) => taken[index] === "skip" && endsWith(path, [...poseFiles, ...doubtful])).length > 1
    );
}

/** Whether the unit has to be asked for: some scan does not declare one. */
export function needsUnit(paths: readonly string[], taken: readonly Role[]): boolean {
    return paths.some((path, index) => taken[index] === "scan" && !endsWith(path, declaring));
}

/** Whether all have to be sent in one form, since the server takes files apart. */
export function needsForm(paths: readonly string[], taken: readonly Role[]): boolean {
    return paths.some(
        (path, index) => taken[index] === "archive" || (taken[index] === "scan" && endsWith(path, several)),
    );
}

/** The folder that holds all of them is no part of their names. */
export function withoutCommonFolder(paths: readonly string[]): string[] {
    const folders = paths.map((path) => path.split("/").slice(0, -1));
    let depth = 0;
    const head = folders[0] ?? [];
    while (depth < head.length && folders.every((folder) => folder[depth] === head[depth])) depth += 1;
    return paths.map((path) => path.split("/").slice(depth).join("/"));
}

/** Everything that was dropped, folders with all that is in them. */
export async function dropped(transfer: DataTransfer): Promise<Chosen[]> {
    // entries have to be taken before anything is waited for: afterwards the list is empty
    const items = [...transfer.items].filter((item) => item.kind === "file");
    const entries = items.map((item) => ({ entry: item.webkitGetAsEntry(), file: item.getAsFile() }));
    const found = await Promise.all(
        entries.map(({ entry, file }) => (entry ? walk(entry) : file ? [{ file, path: file.name }] : [])),
    );
    return found.flat();
}

async function walk(entry: FileSystemEntry): Promise<Chosen[]> {
    const path = entry.fullPath.replace(/^\//, "");
    if (entry.isFile) {
        const file = await new Promise<File>((resolve, reject) => (entry as FileSystemFileEntry).file(resolve, reject));
        return [{ file, path }];
    }
    const reader = (entry as FileSystemDirectoryEntry).createReader();
    const inside: FileSystemEntry[] = [];
    // a folder is told in parts, the last of which is empty
    for (;;) {
        const part = await new Promise<FileSystemEntry[]>((resolve, reject) => reader.readEntries(resolve, reject));
        if (part.length === 0) break;
        inside.push(...part);
    }
    return (await Promise.all(inside.map(walk))).flat();
}

/** What was chosen by an input. */
export function chosen(list: FileList | null): Chosen[] {
    return [...(list ?? [])].map((file) => ({ file, path: file.webkitRelativePath || file.name }));
}
