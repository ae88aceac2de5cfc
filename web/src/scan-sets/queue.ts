import { api, ok, type Schema } from "../api/client";
import { large, sendInPieces } from "../api/pieces";
import { send } from "../api/upload";
import type { Chosen, Role } from "./files";
import { at } from "../lib/address";

export type State = "waiting" | "sending" | "again" | "done" | "failed";

/** A file on its way. */
export interface Item extends Chosen {
    name: string;
    role: Role;
    state: State;
    sent: number;
    error?: unknown;
}

export interface Target {
    name: string;
    unit: Schema["Unit"];
    /** The set that scans are added to; a new one where there is none. */
    id?: string | undefined;
}

type Changed = (index: number, change: Partial<Item>) => void;

/** So many scans are on their way at a time: one alone leaves the line idle while the server reads it. */
const lanes = 3;

/** Stores scans one by one, each of which is sent again by itself; then the poses, which name them. Returns the set. */
export async function sendOneByOne(
    items: readonly Item[],
    target: Target,
    changed: Changed,
    signal: AbortSignal,
): Promise<string> {
    const id =
        target.id ??
        (await ok(api.POST("/v1/scan-sets", { body: { name: target.name || null, unit: target.unit }, signal }))).id;
    const base = at(`/v1/scan-sets/${encodeURIComponent(id)}`);
    const put = async (index: number, url: string) => {
        const item = items[index];
        if (!item) return;
        changed(index, { state: "sending", sent: 0, error: undefined });
        try {
            const onProgress = (sent: number) => changed(index, { state: "sending", sent });
            if (item.role === "scan" && item.file.size > large) {
                const onRetry = () => changed(index, { state: "again" });
                await sendInPieces({ set: id, name: item.name, file: item.file, signal, onProgress, onRetry });
            } else {
                const onRetry = () => changed(index, { state: "again", sent: 0 });
                const headers = { "content-type": "application/octet-stream" };
                await send({ method: "PUT", url, body: item.file, signal, headers, onProgress, onRetry });
            }
            changed(index, { state: "done", sent: item.file.size });
        } catch (error) {
            if (signal.aborted) throw error;
            changed(index, { state: "failed", error });
        }
    };
    const waiting = items
        .map((_, index) => index)
        .filter((index) => items[index]?.role === "scan" && items[index]?.state !== "done");
    const lane = async () => {
        for (let index = waiting.shift(); index !== undefined; index = waiting.shift()) {
            await put(index, `${base}/scans/${encodeURIComponent(items[index]?.name ?? "")}`);
        }
    };
    await Promise.all(Array.from({ length: lanes }, lane));
    for (const [index, item] of items.entries()) {
        if (item.role === "poses") await put(index, `${base}/pose-file`);
    }
    return id;
}

/** Stores everything in one form: the server takes archives and files of several scans apart, all or nothing. */
export async function sendForm(
    items: readonly Item[],
    target: Target,
    changed: Changed,
    signal: AbortSignal,
): Promise<string> {
    const form = new FormData();
    if (target.name) form.append("name", target.name);
    form.append("unit", target.unit);
    const all = items.map((item, index) => ({ item, index })).filter(({ item }) => item.role !== "skip");
    for (const { item } of all) form.append(item.role === "poses" ? "poses" : "scans", item.file, item.name);
    const each = (change: (item: Item, before: number) => Partial<Item>) => {
        let before = 0;
        for (const { item, index } of all) {
            changed(index, change(item, before));
            before += item.file.size;
        }
    };
    each(() => ({ state: "sending", sent: 0, error: undefined }));
    try {
        const set = await send<Schema["ScanSet"]>({
            method: "POST",
            url: at("/v1/scan-sets/upload"),
            body: form,
            signal,
            // the same form sent again after a lost connection makes no second set
            headers: { "idempotency-key": randomKey() },
            onProgress: (sent) =>
                each((item, before) => ({
                    state: "sending",
                    sent: Math.max(0, Math.min(item.file.size, sent - before)),
                })),
            onRetry: () => each(() => ({ state: "again", sent: 0 })),
        });
        each((item) => ({ state: "done", sent: item.file.size }));
        return set.id;
    } catch (error) {
        each(() => ({ state: "waiting", sent: 0 }));
        throw error;
    }
}

/** `randomUUID` is only there where the page came over a safe line or from this machine. */
function randomKey(): string {
    return [...crypto.getRandomValues(new Uint8Array(16))].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}
