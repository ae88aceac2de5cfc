import { lost } from "../lib/connection";
import { ApiError, ConnectionError, problemOf } from "./client";

export interface Sending {
    method: "PUT" | "POST" | "PATCH";
    url: string;
    body: Blob | FormData;
    headers?: Record<string, string>;
    onProgress?: (sent: number) => void;
    /** Called before it is sent once more. */
    onRetry?: () => void;
    signal?: AbortSignal;
}

/** So often a transfer may break off while the server answers otherwise: then it is the transfer that is at fault. */
export const mostBreaks = 5;
export const busy = new Set([408, 429, 503]);

interface Answer {
    status: number;
    body: unknown;
    retryAfter: number;
}

/** Sends, and sends again after a lost connection or when the server is busy, until it is answered or stopped. */
export async function send<T>(sending: Sending): Promise<T> {
    for (let breaks = 0; ;) {
        sending.signal?.throwIfAborted();
        const answer = await once(sending);
        if (answer === undefined) {
            breaks += 1;
            if (breaks >= mostBreaks) throw new ConnectionError(`the transfer broke off ${breaks} times`);
            sending.onRetry?.();
            await lost();
        } else if (busy.has(answer.status)) {
            sending.onRetry?.();
            await new Promise((resolve) => setTimeout(resolve, answer.retryAfter * 1000));
        } else if (answer.status >= 400) {
            throw new ApiError(problemOf(answer.body, answer.status));
        } else {
            return answer.body as T;
        }
    }
}

/** One attempt; `undefined` when the connection was lost. fetch tells nothing of how much was sent, so this is older. */
export function once({ method, url, body, headers, onProgress, signal }: Sending): Promise<Answer | undefined> {
    return new Promise((resolve, reject) => {
        const request = new XMLHttpRequest();
        request.open(method, url);
        for (const [name, value] of Object.entries(headers ?? {})) request.setRequestHeader(name, value);
        request.upload.addEventListener("progress", (event) => onProgress?.(event.loaded));
        request.addEventListener("load", () => {
            const retryAfter = Number(request.getResponseHeader("retry-after") ?? 2) || 2;
            resolve({ status: request.status, body: parsed(request.responseText), retryAfter });
        });
        request.addEventListener("error", () => resolve(undefined));
        request.addEventListener("abort", () => reject(signal?.reason ?? new Error("stopped")));
        signal?.addEventListener("abort", () => request.abort(), { once: true });
        request.send(body);
    });
}

function parsed(text: string): unknown {
    try {
        return text === "" ? undefined : JSON.parse(text);
    } catch {
        return undefined;
    }
}
