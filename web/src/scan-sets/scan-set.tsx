import { api, ok, type Schema } from "../api/client";
import { JobTable } from "../jobs/table";
import { StartJob } from "../jobs/start";
import { date, bytes, number } from "../lib/format";
import { go, href } from "../lib/router";
import { useInfo } from "../lib/use-info";
import { useLoad } from "../lib/use-load";
import { compareAddress } from "../model/deviation";
import { t } from "../texts";
import { DeleteButton } from "../ui/confirm";
import { Loading, PageTitle, Trouble } from "../ui/pieces";
import { Table, type Column } from "../ui/table";
import { keepFile } from "./kept-files";
import { Upload } from "./upload";

/** One scan set: what is in it, and what can be made of it. */
export function ScanSetPage({ id }: { id: string }) {
    const info = useInfo();
    const set = useLoad(() => ok(api.GET("/v1/scan-sets/{id}", { params: { path: { id } } })), [id]);
    const jobs = useLoad(() => ok(api.GET("/v1/jobs", { params: { query: { scan_set_id: id, limit: 100 } } })), [id]);
    if (!set.data)
        return (
            <>
                {set.isLoading ? (
                    <Loading />
                ) : (
                    <>
                        <PageTitle title={t.scanSets.title} />
                        <Trouble error={set.error} />
                    </>
                )}
            </>
        );
    const scans = set.data.scans;
    return (
        <>
            <PageTitle title={set.data.name}>
                {scans.length > 1 && (
                    <a class="button" href={href("scan-sets", id, "hints")}>
                        {t.set.hints}
                    </a>
                )}
                <DeleteButton
                    name={set.data.name}
                    consequence={t.confirm.set}
                    goesToBin
                    onConfirm={() => ok(api.DELETE("/v1/scan-sets/{id}", { params: { path: { id } } }))}
                    onDone={() => go(href("scan-sets"))}
                />
            </PageTitle>
            <Trouble error={set.error} />
            <p class="quiet">
                {t.scanSets.scans(scans.length)} · {t.unit}:{" "}
                {set.data.unit === "unknown" ? t.units.unknown : set.data.unit} · {date(set.data.created_at)}
            </p>
            <section class="panel" aria-label={t.set.start}>
                {scans.length < 2 && <p class="quiet">{t.set.tooFew}</p>}
                {scans.length >= 2 && info.data && (
                    <StartJob info={info.data} set={set.data} isFirst={jobs.data?.items.length === 0} />
                )}
            </section>
            {jobs.data && jobs.data.items.length > 0 && (
                <section class="panel">
                    <h2>{t.set.jobs}</h2>
                    <JobTable jobs={jobs.data.items} onChange={jobs.reload} />
                    <CompareRuns jobs={jobs.data.items} />
                </section>
            )}
            <section class="panel">
                <h2>{t.set.scans}</h2>
                <ScanTable set={set.data} onChange={set.reload} />
            </section>
            <section class="panel">
                <h2>{t.set.poses}</h2>
                <Poses set={set.data} />
            </section>
            {info.data && (
                <details>
                    <summary>{t.upload.add}</summary>
                    <Upload
                        info={info.data}
                        set={set.data}
                        onStored={(_, files) => {
                            for (const item of files) if (item.role === "scan") keepFile(id, item.name, item.file);
                            set.reload();
                        }}
                    />
                </details>
            )}
        </>
    );
}

function ScanTable({ set, onChange }: { set: Schema["ScanSet"]; onChange: () => void }) {
    const columns: Column<Schema["ScanView"]>[] = [
        { title: t.set.scan, kind: "name", cell: (scan) => scan.name },
        { title: t.points, kind: "number", cell: (scan) => number(scan.points) },
        { title: t.size, kind: "number", cell: (scan) => bytes(scan.bytes) },
        { title: t.set.notes, kind: "small", cell: (scan) => readingNotes(scan.reading).join(" · ") },
        {
            title: t.remove,
            kind: "act",
            cell: (scan) => (
                <DeleteButton
                    name={scan.name}
                    consequence={t.confirm.scan}
                    label={`${t.remove}: ${scan.name}`}
                    className="bare"
                    onConfirm={() =>
                        ok(
                            api.DELETE("/v1/scan-sets/{id}/scans/{name}", {
                                params: { path: { id: set.id, name: scan.name } },
                            }),
                        )
                    }
                    onDone={onChange}
                />
            ),
        },
    ];
    return (
        <>
            <Table caption={t.set.scans} columns={columns} rows={set.scans} keyOf={(scan) => scan.name} />
            {set.passed_over.length > 0 && (
                <details>
                    <summary>{t.set.passedOver}</summary>
                    <ul>
                        {set.passed_over.map(({ file, why }) => (
                            <li key={file}>
                                <strong>{file}</strong> {why}
                            </li>
                        ))}
                    </ul>
                </details>
            )}
        </>
    );
}

/** What of a file was not taken, in words. */
export function readingNotes(reading: Schema["Reading"] | null | undefined): string[] {
    if (!reading) return [];
    const kinds = ["no_return", "faces", "normals", "colors", "intensities"] as const;
    const counted = kinds.filter((kind) => reading[kind] > 0).map((kind) => t.set.reading[kind](number(reading[kind])));
    return [...counted, ...reading.notes];
}

function Poses({ set }: { set: Schema["ScanSet"] }) {
    const poses = set.poses;
    if (!poses) return <p class="quiet">{t.set.noPoses}</p>;
    return (
        <>
            <p>{t.set.posesOf(poses.file, poses.count)}</p>
            {poses.scans_without_pose.length > 0 && (
                <p class="quiet">{t.set.without(poses.scans_without_pose.join(", "))}</p>
            )}
            {poses.notes.map((note) => (
                <p class="quiet" key={note}>
                    {note}
                </p>
            ))}
        </>
    );
}

/** What the newest job made beside what the one before it made. */
function CompareRuns({ jobs }: { jobs: readonly Schema["Job"][] }) {
    const [newest, before] = jobs.flatMap((job) => job.model_id ?? []);
    return newest && before ? <a href={compareAddress(before, newest)}>{t.compare.runs}</a> : null;
}
