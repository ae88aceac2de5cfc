import { ApiError, ConnectionError, problemOf } from "../api/client";
import { lost } from "../lib/connection";
import { t } from "../texts";
import { Unreadable } from "./ply-header";
import type { Outcome, Task } from "./read.worker";
import type { Surface } from "./surface";

/** Reads a file in a thread of its own. */
function read(buffer: ArrayBuffer, kind: Task["kind"]): Promise<Surface> {
    const worker = new Worker(new URL("./read.worker.ts", import.meta.url), { type: "module" });
    return new Promise<Surface>((resolve, reject) => {
        worker.addEventListener("message", ({ data }: MessageEvent<Outcome>) => {
            if ("surface" in data) resolve(data.surface);
            else reject(new Unreadable(data.fault));
        });
        worker.addEventListener("error", (event) => reject(new Error(event.message)));
        worker.postMessage({ buffer, kind } satisfies Task, [buffer]);
    }).finally(() => worker.terminate());
}

/** Reads a scan from the reader's own disk. */
export async function readFile(file: File): Promise<Surface> {
    return read(await file.arrayBuffer(), kindOf(file.name));
}

function kindOf(name: string): Task["kind"] {
    if (/\.ply$/i.test(name)) return "ply";
    if (/\.(xyz|xyzn|xyzrgb|txt|asc|csv|pts)$/i.test(name)) return "xyz";
    throw new Error(t.hints.unreadable);
}

/** Fetches a surface of the server; `onShare` is told how much of it has come. */
export async function fetchSurface(
    url: string,
    signal: AbortSignal,
    onShare: (share: number) => void,
): Promise<Surface> {
    let buffer: ArrayBuffer;
    try {
        const response = await fetch(url, { signal });
        if (!response.ok) throw new ApiError(problemOf(await response.json().catch(() => undefined), response.status));
        buffer = await whole(response, onShare);
    } catch (error) {
        if (!(error instanceof TypeError)) throw error;
        void lost();
        throw new ConnectionError(error.message);
    }
    return read(buffer, "ply");
}

async function whole(response: Response, onShare: (share: number) => void): Promise<ArrayBuffer> {
    const length = Number(response.headers.get("content-length") ?? 0);
    if (!response.body || !length) return response.arrayBuffer();
    const parts: Uint8Array[] = [];
    let received = 0;
    const reader = response.body.getReader();
    for (;;) {
        const { done, value } = await reader.read();
        if (done) break;
        parts.push(value);
        received += value.length;
        onShare(Math.min(1, received / length));
    }
    const bytes = new Uint8Array(received);
    let at = 0;
    for (const part of parts) {
        bytes.set(part, at);
        at += part.length;
    }
    return bytes.buffer;
}
