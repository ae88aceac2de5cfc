import { api, ok, type Schema } from "../api/client";
import { date, number } from "../lib/format";
import { go, href } from "../lib/router";
import { useInfo } from "../lib/use-info";
import { t } from "../texts";
import { DeleteButton } from "../ui/confirm";
import { usePages } from "../ui/pages";
import { Loading, PageTitle, Trouble } from "../ui/pieces";
import { Table, type Column } from "../ui/table";
import { keepFile } from "./kept-files";
import { Upload } from "./upload";

/** All scan sets, and where new ones are made. */
export function ScanSetList() {
    const info = useInfo();
    const sets = usePages(
        (cursor) => ok(api.GET("/v1/scan-sets", { params: { query: cursor ? { cursor } : {} } })),
        [],
    );
    return (
        <>
            <PageTitle title={t.scanSets.title} />
            <p class="quiet">{t.scanSets.lead}</p>
            <section aria-label={t.scanSets.new}>
                <Trouble error={info.error} />
                {info.data && (
                    <Upload
                        info={info.data}
                        onStored={(id, files) => {
                            for (const item of files) if (item.role === "scan") keepFile(id, item.name, item.file);
                            go(href("scan-sets", id));
                        }}
                    />
                )}
            </section>
            <section class="panel" aria-label={t.scanSets.table}>
                <Trouble error={sets.error} />
                {!sets.items && sets.isLoading && <Loading />}
                {sets.items?.length === 0 && <p class="empty">{t.scanSets.empty}</p>}
                {sets.items && sets.items.length > 0 && <SetTable sets={sets.items} onChange={sets.reload} />}
                {sets.more}
            </section>
        </>
    );
}

type ScanSet = Schema["ScanSet"];

function SetTable({ sets, onChange }: { sets: readonly ScanSet[]; onChange: () => void }) {
    const columns: Column<ScanSet>[] = [
        { title: t.name, kind: "name", cell: (set) => <a href={href("scan-sets", set.id)}>{set.name}</a> },
        { title: t.set.scans, kind: "number", cell: (set) => number(set.scans.length) },
        {
            title: t.points,
            kind: "number",
            cell: (set) => number(set.scans.reduce((sum, scan) => sum + scan.points, 0)),
        },
        { title: t.unit, cell: (set) => (set.unit === "unknown" ? t.units.unknown : set.unit) },
        { title: t.created, cell: (set) => date(set.created_at) },
        {
            title: t.remove,
            kind: "act",
            cell: (set) => (
                <DeleteButton
                    name={set.name}
                    consequence={t.confirm.set}
                    goesToBin
                    label={`${t.remove}: ${set.name}`}
                    className="bare"
                    onConfirm={() => ok(api.DELETE("/v1/scan-sets/{id}", { params: { path: { id: set.id } } }))}
                    onDone={onChange}
                />
            ),
        },
    ];
    return <Table caption={t.scanSets.table} columns={columns} rows={sets} keyOf={(set) => set.id} />;
}
