import createClient from "openapi-fetch";

import { at } from "../lib/address";
import { lost } from "../lib/connection";
import type { components, paths } from "./schema";

export type Schema = components["schemas"];
export type Problem = Schema["Problem"];

/** Every call of the interface, typed by its contract. */
export const api = createClient<paths>({ baseUrl: at("").slice(0, -1) });

/** An answer that is an error, as the server words it: what went wrong, and what to do about it. */
export class ApiError extends Error {
    constructor(readonly problem: Problem) {
        super(problem.detail);
    }
}

/** The server did not answer. */
export class ConnectionError extends Error {}

/** What a call gives, or throws. */
export async function ok<T>(call: Promise<{ data?: T; error?: unknown; response: Response }>): Promise<T> {
    let result;
    try {
        result = await call;
    } catch (error) {
        // fetch rejects with a TypeError when there is no answer at all
        if (error instanceof TypeError) {
            void lost();
            throw new ConnectionError(error.message);
        }
        throw error;
    }
    if (result.error !== undefined || !result.response.ok)
        throw new ApiError(problemOf(result.error, result.response.status));
    return result.data as T;
}

/** Whatever came back, as a problem: a proxy on the way may answer with anything. */
export function problemOf(body: unknown, status: number): Problem {
    if (typeof body === "object" && body !== null && "code" in body && "detail" in body) return body as Problem;
    const title = `HTTP ${status}`;
    return { type: "about:blank", title, status, code: "unknown", detail: title, hint: "" };
}

/** All pages of a list, up to so many items. */
export async function everything<T>(
    page: (cursor: string | undefined) => Promise<{ items: T[]; next_cursor?: string | null }>,
    most = 2000,
): Promise<T[]> {
    const items: T[] = [];
    let cursor: string | undefined;
    do {
        const answer = await page(cursor);
        items.push(...answer.items);
        cursor = answer.next_cursor ?? undefined;
    } while (cursor !== undefined && items.length < most);
    return items;
}
