import { at } from "./address";
import { createStore } from "./store";

/** Whether the server answers; `epoch` counts how often it came back, so that views know when to look again. */
export const connection = createStore({ isLost: false, epoch: 0 });

const pause = 1500;
let asking: Promise<void> | undefined;

/** Called by whoever was not answered; resolves when the server answers again. */
export function lost(): Promise<void> {
    asking ??= askUntilAnswered().finally(() => (asking = undefined));
    return asking;
}

async function askUntilAnswered(): Promise<void> {
    // a single request that broke off is no outage
    if (await isAnswered()) return;
    connection.set({ ...connection.get(), isLost: true });
    while (!(await isAnswered())) await new Promise((resolve) => setTimeout(resolve, pause));
    connection.set({ isLost: false, epoch: connection.get().epoch + 1 });
}

async function isAnswered(): Promise<boolean> {
    try {
        return (await fetch(at("/healthz"), { cache: "no-store" })).ok;
    } catch {
        return false;
    }
}
