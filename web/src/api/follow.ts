import { at } from "../lib/address";
import type { Schema } from "./client";

export interface Following {
    onJob(job: Schema["Job"]): void;
    /** The stream is open (again), or was lost and is being opened again. */
    onState(isLive: boolean): void;
    /** The server refuses to tell more: look at the job itself to see why. */
    onRefused(): void;
}

const pause = 2000;

/** Follows a job until it ends. Each event holds the whole job, so nothing is missed when the line breaks. */
export function follow(id: string, following: Following): () => void {
    let source: EventSource | undefined;
    let timer: ReturnType<typeof setTimeout> | undefined;
    let isOver = false;

    const stop = () => {
        isOver = true;
        source?.close();
        clearTimeout(timer);
    };
    const open = () => {
        source = new EventSource(at(`/v1/jobs/${encodeURIComponent(id)}/events`));
        source.addEventListener("open", () => following.onState(true));
        source.addEventListener("progress", (event) => following.onJob(JSON.parse(event.data)));
        source.addEventListener("end", (event) => {
            stop();
            following.onJob(JSON.parse(event.data));
        });
        source.addEventListener("error", () => {
            if (isOver) return;
            following.onState(false);
            // browsers connect again by themselves unless the answer was an error
            if (source?.readyState !== EventSource.CLOSED) return;
            following.onRefused();
            timer = setTimeout(open, pause);
        });
    };
    open();
    return stop;
}
