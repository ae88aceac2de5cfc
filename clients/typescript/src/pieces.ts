import { NoConnection, problemOf, Refused } from "./errors.js";

/** Smaller files are sent whole: that is one request instead of several. */
export const LARGE = 4 << 20;
const PIECE = 8 << 20;
/** So often a piece may be lost without anything having arrived before the connection counts as lost for good. */
const MOST_LOSSES = 5;
const TUS = { "tus-resumable": "1.0.0" };

/** How pieces are sent: the address of the service, what every request carries, and how it is made. */
export interface Line {
    base: string;
    headers: Record<string, string>;
    fetch: (request: Request) => Promise<Response>;
}

/** Sends a scan piece by piece (tus 1.0): after a lost connection it goes on with what the service has not got. */
export async function sendInPieces(
    line: Line,
    set: string,
    file: File,
    sent: (bytes: number) => void,
    signal?: AbortSignal,
): Promise<void> {
    const asked = async (url: string, init: RequestInit) => {
        const headers = { ...line.headers, ...TUS, ...(init.headers as Record<string, string>) };
        const answer = await line.fetch(new Request(url, { ...init, headers, ...(signal && { signal }) }));
        if (answer.ok) return answer;
        throw new Refused(problemOf(await answer.json().catch(() => undefined), answer.status));
    };
    const begin = async () => {
        const filename = btoa(String.fromCharCode(...new TextEncoder().encode(file.name)));
        const answer = await asked(`${line.base}/v1/scan-sets/${encodeURIComponent(set)}/uploads`, {
            method: "POST",
            headers: { "upload-length": String(file.size), "upload-metadata": `filename ${filename}` },
        });
        return new URL(answer.headers.get("location") ?? "", `${line.base}/`).href;
    };
    let url: string | undefined;
    for (let losses = 0, reached = -1; ; ) {
        try {
            url ??= await begin();
            const told = await asked(url, { method: "HEAD" });
            let offset = Number(told.headers.get("upload-offset"));
            while (offset < file.size) {
                // as long as something arrives it goes on
                if (offset > reached) [losses, reached] = [0, offset];
                sent(offset);
                const answer = await asked(url, {
                    method: "PATCH",
                    headers: { "upload-offset": String(offset), "content-type": "application/offset+octet-stream" },
                    // in memory, since not every browser sends a Blob again that it has begun to read
                    body: await file.slice(offset, offset + PIECE).arrayBuffer(),
                });
                offset = Number(answer.headers.get("upload-offset"));
            }
            return;
        } catch (error) {
            const isGone = error instanceof Refused && error.status === 404;
            const mayPass = ["offset_mismatch", "request_in_progress", "in_use", "overloaded"];
            const passes = error instanceof NoConnection || isGone || (error instanceof Refused && mayPass.includes(error.code));
            losses += 1;
            if (!passes || losses >= MOST_LOSSES) throw error;
            // given up meanwhile: begun anew
            if (isGone) url = undefined;
            await new Promise((resolve) => setTimeout(resolve, 200 * 2 ** losses));
        }
    }
}
