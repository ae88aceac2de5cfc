import { useCallback, useEffect, useState } from "preact/hooks";

import { connection } from "./connection";
import { useStore } from "./store";

export interface Load<T> {
    data: T | undefined;
    error: unknown;
    isLoading: boolean;
    reload(): void;
}

/** Loads what a view shows, again when its inputs change and when the server has come back. */
export function useLoad<T>(load: () => Promise<T>, inputs: readonly unknown[]): Load<T> {
    const { epoch } = useStore(connection);
    const [turn, setTurn] = useState(0);
    const [state, setState] = useState<Omit<Load<T>, "reload">>({ data: undefined, error: undefined, isLoading: true });
    useEffect(() => {
        let isCurrent = true;
        setState((before) => ({ ...before, isLoading: true }));
        load().then(
            (data) => isCurrent && setState({ data, error: undefined, isLoading: false }),
            (error: unknown) => isCurrent && setState((before) => ({ ...before, error, isLoading: false })),
        );
        return () => {
            isCurrent = false;
        };
    }, [...inputs, epoch, turn]);
    const reload = useCallback(() => setTurn((count) => count + 1), []);
    return { ...state, reload };
}
