import { readPly } from "./ply";
import { buffersOf, type Surface } from "./surface";
import { readXyz } from "./xyz";

export interface Task {
    buffer: ArrayBuffer;
    kind: "ply" | "xyz";
}

export type Outcome = { surface: Surface } | { fault: string };

/** Reads files away from the thread that draws. */
addEventListener("message", ({ data }: MessageEvent<Task>) => {
    try {
        const surface = data.kind === "ply" ? readPly(data.buffer) : readXyz(data.buffer);
        postMessage({ surface } satisfies Outcome, { transfer: buffersOf(surface) });
    } catch (error) {
        postMessage({ fault: error instanceof Error ? error.message : String(error) } satisfies Outcome);
    }
});
