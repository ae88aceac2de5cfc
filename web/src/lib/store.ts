import { useEffect, useState } from "preact/hooks";

/** A value that several parts of the page look at. */
export interface Store<T> {
    get(): T;
    set(value: T): void;
    subscribe(listener: () => void): () => void;
}

export function createStore<T>(first: T): Store<T> {
    let value = first;
    const listeners = new Set<() => void>();
    return {
        get: () => value,
        set: (next) => {
            if (Object.is(next, value)) return;
            value = next;
            for (const listener of [...listeners]) listener();
        },
        subscribe: (listener) => {
            listeners.add(listener);
            return () => listeners.delete(listener);
        },
    };
}

/** The value of a store; who uses it is drawn anew when it changes. */
export function useStore<T>(store: Store<T>): T {
    const [, redraw] = useState(0);
    useEffect(() => store.subscribe(() => redraw((count) => count + 1)), [store]);
    return store.get();
}
