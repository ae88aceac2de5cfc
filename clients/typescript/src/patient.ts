import { NoConnection } from "./errors.js";
import type { Patience } from "./types.js";

const BUSY = new Set([408, 429, 503]);
/** Calls that may be made twice; others only with a key by which the service knows them again. */
const REPEATABLE = new Set(["GET", "HEAD", "OPTIONS", "PUT", "DELETE"]);

const pause = (milliseconds: number) => new Promise<void>((resolve) => setTimeout(resolve, milliseconds));

/** `fetch` that tries again when the connection was lost or the service is busy. */
export function patientFetch(patience: Patience): (request: Request) => Promise<Response> {
    return async (request) => {
        const mayRepeat = REPEATABLE.has(request.method) || request.headers.has("idempotency-key");
        for (let tries = 1; ; tries++) {
            const isLast = tries >= patience.tries;
            const wait = patience.pause * 2 ** (tries - 1);
            try {
                const answer = await fetch(mayRepeat && !isLast ? request.clone() : request);
                // what was refused for want of time was not done
                if (!BUSY.has(answer.status) || isLast || !mayRepeat) return answer;
                await answer.body?.cancel();
                await pause(Number(answer.headers.get("retry-after")) * 1000 || wait);
            } catch (error) {
                request.signal.throwIfAborted();
                // fetch rejects with a TypeError when there is no answer at all
                if (!(error instanceof TypeError)) throw error;
                if (isLast || !mayRepeat) throw new NoConnection(`${request.url} does not answer`, { cause: error });
                await pause(wait);
            }
        }
    };
}
