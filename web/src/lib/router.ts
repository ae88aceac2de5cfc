import { createStore } from "./store";

/** Where the page is: the parts of the address behind `#/`, decoded, and its query. */
export interface Place {
    parts: string[];
    query: URLSearchParams;
}

// The address behind `#` never reaches the server: no address of the page can get in the way of one of the interface.
export function parse(hash: string): Place {
    const [path = "", query = ""] = hash.replace(/^#\/?/, "").split("?");
    return {
        parts: path
            .split("/")
            .filter((part) => part !== "")
            .map(decoded),
        query: new URLSearchParams(query),
    };
}

/** An address may have been typed by hand: what is no encoding stands as it is. */
function decoded(part: string): string {
    try {
        return decodeURIComponent(part);
    } catch {
        return part;
    }
}

export const place = createStore<Place>(parse(globalThis.location?.hash ?? ""));

export function listen(): void {
    addEventListener("hashchange", () => place.set(parse(location.hash)));
}

/** An address of the page; each part is encoded. */
export function href(...parts: string[]): string {
    return `#/${parts.map(encodeURIComponent).join("/")}`;
}

export function go(address: string): void {
    location.hash = address;
}
