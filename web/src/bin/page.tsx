import { useState } from "preact/hooks";

import { api, ok, type Schema } from "../api/client";
import { announce } from "../lib/announce";
import { bytes, date } from "../lib/format";
import { useInfo } from "../lib/use-info";
import { t } from "../texts";
import { DeleteButton } from "../ui/confirm";
import { usePages } from "../ui/pages";
import { Loading, PageTitle, Trouble } from "../ui/pieces";
import { Table, type Column } from "../ui/table";

type Entry = Schema["BinEntry"];

/** What was deleted and can still be put back. */
export function BinPage() {
    const info = useInfo();
    const [error, setError] = useState<unknown>();
    const entries = usePages((cursor) => ok(api.GET("/v1/bin", { params: { query: cursor ? { cursor } : {} } })), []);
    const restore = async (entry: Entry) => {
        setError(undefined);
        try {
            await ok(api.POST("/v1/bin/{id}/restore", { params: { path: { id: entry.id } } }));
            announce(t.bin.restored(entry.name));
            entries.reload();
        } catch (fault) {
            setError(fault);
        }
    };
    return (
        <>
            <PageTitle title={t.bin.title} />
            <p class="quiet">{info.data?.limits.bin_days === 0 ? t.bin.off : t.bin.lead}</p>
            <section class="panel" aria-label={t.bin.table}>
                <Trouble error={error ?? entries.error} />
                {!entries.items && entries.isLoading && <Loading />}
                {entries.items?.length === 0 && <p class="empty">{t.bin.empty}</p>}
                {entries.items && entries.items.length > 0 && (
                    <EntryTable entries={entries.items} onRestore={restore} onChange={entries.reload} />
                )}
                {entries.more}
            </section>
        </>
    );
}

interface Props {
    entries: readonly Entry[];
    onRestore: (entry: Entry) => void;
    onChange: () => void;
}

function EntryTable({ entries, onRestore, onChange }: Props) {
    const columns: Column<Entry>[] = [
        { title: t.name, kind: "name", cell: (entry) => entry.name },
        { title: t.bin.what, cell: (entry) => t.bin.kind[entry.kind] },
        { title: t.size, kind: "number", cell: (entry) => bytes(entry.bytes) },
        { title: t.bin.deleted, cell: (entry) => date(entry.deleted_at) },
        { title: t.bin.expires, cell: (entry) => date(entry.expires_at) },
        {
            title: t.bin.restore,
            kind: "act",
            cell: (entry) => (
                <button
                    type="button"
                    class="bare"
                    aria-label={`${t.bin.restore}: ${entry.name}`}
                    onClick={() => onRestore(entry)}
                >
                    {t.bin.restore}
                </button>
            ),
        },
        {
            title: t.remove,
            kind: "act",
            cell: (entry) => (
                <DeleteButton
                    name={entry.name}
                    consequence={t.confirm.bin}
                    label={`${t.remove}: ${entry.name}`}
                    className="bare"
                    onConfirm={() => ok(api.DELETE("/v1/bin/{id}", { params: { path: { id: entry.id } } }))}
                    onDone={onChange}
                />
            ),
        },
    ];
    return <Table caption={t.bin.table} columns={columns} rows={entries} keyOf={(entry) => entry.id} />;
}
