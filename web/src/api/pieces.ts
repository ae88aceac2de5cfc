import { lost } from "../lib/connection";
import { ApiError, ConnectionError, problemOf } from "./client";
import { busy, mostBreaks, once } from "./upload";

/** Smaller files are sent whole: that is one request instead of three. */
export const large = 4 << 20;

export interface Pieces {
    set: string;
    name: string;
    file: File;
    onProgress?: (sent: number) => void;
    /** Called before it goes on. */
    onRetry?: () => void;
    signal?: AbortSignal;
}

const tus = { "tus-resumable": "1.0.0" };

/**
 * Sends a scan piece by piece (tus 1.0): after a lost connection it goes on with what the server has not got, and so does
 * whoever chooses the same file for the same set again after the page was closed.
 */
export async function sendInPieces({ set, name, file, onProgress, onRetry, signal }: Pieces): Promise<void> {
    const memory = `upload/${set}/${name}/${file.size}/${file.lastModified}`;
    let url = remembered(memory);
    let reached = 0;
    const again = async (breaks: number) => {
        if (breaks >= mostBreaks) throw new ConnectionError(`the transfer broke off ${breaks} times`);
        onRetry?.();
        await lost();
    };
    for (let breaks = 0; ;) {
        signal?.throwIfAborted();
        try {
            url ??= await begin(set, name, file.size, signal);
            remember(memory, url);
            const offset = await offsetOf(url, signal);
            if (offset === undefined) {
                // given up meanwhile: begun anew
                url = undefined;
                forget(memory);
                breaks += 1;
                if (breaks >= mostBreaks) throw new ConnectionError(`the upload was gone ${breaks} times`);
                continue;
            }
            if (offset === file.size) break;
            if (offset > reached) breaks = 0;
            reached = offset;
            const answer = await once({
                method: "PATCH",
                url,
                body: file.slice(offset),
                headers: {
                    ...tus,
                    "upload-offset": String(offset),
                    "content-type": "application/offset+octet-stream",
                },
                onProgress: (sent) => onProgress?.(offset + sent),
                ...(signal && { signal }),
            });
            if (answer === undefined) {
                await again(++breaks);
            } else if (busy.has(answer.status) || answer.status === 409) {
                // at 409 the server has got more than it had told, or a job needs the set
                if (++breaks >= mostBreaks) throw new ApiError(problemOf(answer.body, answer.status));
                onRetry?.();
                await new Promise((resolve) => setTimeout(resolve, answer.retryAfter * 1000));
            } else if (answer.status >= 400) {
                forget(memory);
                throw new ApiError(problemOf(answer.body, answer.status));
            } else {
                break;
            }
        } catch (error) {
            // fetch rejects with a TypeError when there is no answer at all
            if (!(error instanceof TypeError)) throw error;
            await again(++breaks);
        }
    }
    forget(memory);
}

async function begin(set: string, name: string, size: number, signal?: AbortSignal): Promise<string> {
    const filename = btoa(String.fromCharCode(...new TextEncoder().encode(name)));
    const answer = await fetch(`/v1/scan-sets/${encodeURIComponent(set)}/uploads`, {
        method: "POST",
        headers: { ...tus, "upload-length": String(size), "upload-metadata": `filename ${filename}` },
        ...(signal && { signal }),
    });
    const body: unknown = await answer.json().catch(() => undefined);
    if (!answer.ok) throw new ApiError(problemOf(body, answer.status));
    return answer.headers.get("location") ?? "";
}

/** Bytes that the server has got; `undefined` where the upload is gone. */
async function offsetOf(url: string, signal?: AbortSignal): Promise<number | undefined> {
    const answer = await fetch(url, { method: "HEAD", headers: tus, ...(signal && { signal }) });
    if (answer.status === 404) return undefined;
    if (!answer.ok) throw new ApiError(problemOf(undefined, answer.status));
    return Number(answer.headers.get("upload-offset") ?? 0);
}

// storage may be forbidden: then an upload is remembered by this page alone

function remembered(key: string): string | undefined {
    try {
        return localStorage.getItem(key) ?? undefined;
    } catch {
        return undefined;
    }
}

function remember(key: string, url: string): void {
    try {
        localStorage.setItem(key, url);
    } catch {
        // as above
    }
}

function forget(key: string): void {
    try {
        localStorage.removeItem(key);
    } catch {
        // as above
    }
}
