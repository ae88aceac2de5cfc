/** Where the page is: `/`, or the path below which the service is served. No address of it has a further folder. */
export const root = globalThis.location ? new URL(".", location.href).pathname : "/";

/** An address of the service, wherever it is served: `/v1/jobs` below it. */
export function at(path: string, from = root): string {
    return from + path.replace(/^\//, "");
}
