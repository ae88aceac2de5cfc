import { useEffect, useState } from "preact/hooks";

import { useLoad } from "../lib/use-load";
import { t } from "../texts";

interface Answer<T> {
    items: T[];
    next_cursor?: string | null;
}

/** A list that grows page by page. */
export function usePages<T>(load: (cursor: string | undefined) => Promise<Answer<T>>, inputs: readonly unknown[]) {
    const first = useLoad(() => load(undefined), inputs);
    const [more, setMore] = useState<Answer<T>>();
    const [error, setError] = useState<unknown>();
    useEffect(() => {
        setMore(undefined);
        setError(undefined);
    }, [first.data]);
    const cursor = more ? more.next_cursor : first.data?.next_cursor;
    const next = async () => {
        if (!cursor) return;
        try {
            const answer = await load(cursor);
            setMore({ items: [...(more?.items ?? []), ...answer.items], next_cursor: answer.next_cursor ?? null });
        } catch (fault) {
            setError(fault);
        }
    };
    return {
        items: first.data && [...first.data.items, ...(more?.items ?? [])],
        error: error ?? first.error,
        isLoading: first.isLoading,
        reload: first.reload,
        more: cursor ? (
            <div class="row end">
                <button type="button" onClick={next}>
                    {t.more}
                </button>
            </div>
        ) : null,
    };
}
