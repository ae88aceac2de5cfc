import { afterEach, beforeEach, expect, test, vi } from "vitest";

import { ApiError } from "./client";
import { sendInPieces } from "./pieces";
import type { Sending } from "./upload";

/** A server that keeps what arrives of one file, and breaks off or refuses where it is told to. */
const server = {
    length: 0,
    kept: 0,
    begun: 0,
    pieces: [] as number[],
    /** What becomes of each piece: bytes that arrive before the line breaks, a status, or all of it. */
    fates: [] as (number | { status: number })[],
    isGone: false,
};

vi.mock("../lib/connection", () => ({ lost: () => Promise.resolve() }));
vi.mock("./upload", async (actual) => ({
    ...(await actual<object>()),
    once: async ({ url, body, headers }: Sending) => {
        expect(url).toBe("/v1/uploads/u");
        expect(headers?.["upload-offset"]).toBe(String(server.kept));
        server.pieces.push(server.kept);
        const fate = server.fates.shift();
        if (typeof fate === "number") {
            server.kept += fate;
            return undefined;
        }
        if (fate) return { status: fate.status, body: { code: "c", detail: "d" }, retryAfter: 0 };
        server.kept += (body as Blob).size;
        return { status: 204, body: undefined, retryAfter: 0 };
    },
}));

beforeEach(() => {
    Object.assign(server, { length: 0, kept: 0, begun: 0, pieces: [], fates: [], isGone: false });
    const kept = new Map<string, string>();
    vi.stubGlobal("localStorage", {
        getItem: (key: string) => kept.get(key) ?? null,
        setItem: (key: string, value: string) => kept.set(key, value),
        removeItem: (key: string) => kept.delete(key),
    });
    vi.stubGlobal("fetch", async (url: string, { method, headers }: { method: string; headers: object }) => {
        if (method === "POST") {
            expect(url).toBe("/v1/scan-sets/s/uploads");
            expect(headers).toMatchObject({ "upload-length": "100", "upload-metadata": "filename w6QucGx5" });
            server.begun += 1;
            server.kept = 0;
            server.isGone = false;
            return new Response("{}", { status: 201, headers: { location: "/v1/uploads/u" } });
        }
        if (server.isGone) return new Response(null, { status: 404 });
        return new Response(null, { status: 200, headers: { "upload-offset": String(server.kept) } });
    });
});
afterEach(() => vi.unstubAllGlobals());

const file = new File([new Uint8Array(100)], "ä.ply", { lastModified: 1 });
const pieces = { set: "s", name: "ä.ply", file };

test("after a lost connection it goes on with what the server has not got", async () => {
    server.fates = [40, 30];
    await sendInPieces(pieces);
    expect([server.begun, server.kept, server.pieces]).toEqual([1, 100, [0, 40, 70]]);
});

test("the same file chosen again goes on, and one that is gone is begun anew", async () => {
    server.fates = [40, 0, 0, 0, 0, 0];
    await expect(sendInPieces(pieces)).rejects.toThrow("broke off");
    server.fates = [];
    await sendInPieces(pieces);
    expect([server.begun, server.kept]).toEqual([1, 100]);

    server.fates = [40, 0, 0, 0, 0, 0];
    await expect(sendInPieces(pieces)).rejects.toThrow("broke off");
    server.isGone = true;
    server.fates = [];
    await sendInPieces(pieces);
    expect([server.begun, server.kept]).toEqual([3, 100]);
});

test("what is refused is refused, and a server that is busy is asked again", async () => {
    server.fates = [{ status: 503 }, { status: 409 }];
    await sendInPieces(pieces);
    expect([server.begun, server.kept]).toEqual([1, 100]);
    server.fates = [{ status: 422 }];
    await expect(sendInPieces(pieces)).rejects.toBeInstanceOf(ApiError);
});
