import { api, ok, type Schema } from "../api/client";
import { date, duration } from "../lib/format";
import { href } from "../lib/router";
import { t } from "../texts";
import { DeleteButton } from "../ui/confirm";
import { Tag } from "../ui/pieces";
import { Table, type Column } from "../ui/table";

type Job = Schema["Job"];

const kinds = { queued: undefined, running: "busy", succeeded: "good", failed: "bad", canceled: undefined } as const;

export function StatusTag({ status }: { status: Job["status"] }) {
    return <Tag kind={kinds[status]}>{t.jobs.status[status]}</Tag>;
}

export const isFinished = (job: Job) =>
    job.status === "succeeded" || job.status === "failed" || job.status === "canceled";

/** Seconds from its start to its end, or to now. */
export function runningSeconds(job: Job): number | undefined {
    if (!job.started_at) return undefined;
    const end = job.finished_at ? Date.parse(job.finished_at) : Date.now();
    return (end - Date.parse(job.started_at)) / 1000;
}

export function JobTable({ jobs, onChange }: { jobs: readonly Job[]; onChange: () => void }) {
    const nameOf = (job: Job) => `${t.jobs.kind[job.kind]}, ${date(job.created_at)}`;
    const columns: Column<Job>[] = [
        {
            title: t.jobs.job,
            kind: "name",
            cell: (job) => (
                <>
                    <a href={href("jobs", job.id)} aria-label={nameOf(job)}>
                        {t.jobs.kind[job.kind]}
                    </a>
                    {job.label && <span class="quiet"> · {job.label}</span>}
                </>
            ),
        },
        { title: t.jobs.statusTitle, cell: (job) => <StatusTag status={job.status} /> },
        {
            title: t.jobs.stage,
            cell: (job) => job.stage && !isFinished(job) && (t.jobs.stages[job.stage] ?? job.stage),
        },
        {
            title: t.jobs.time,
            kind: "number",
            cell: (job) => {
                const seconds = runningSeconds(job);
                return seconds !== undefined && duration(seconds);
            },
        },
        { title: t.created, cell: (job) => date(job.created_at) },
        {
            title: t.remove,
            kind: "act",
            cell: (job) =>
                isFinished(job) && (
                    <DeleteButton
                        name={nameOf(job)}
                        consequence={t.confirm.job}
                        goesToBin
                        label={`${t.remove}: ${nameOf(job)}`}
                        className="bare"
                        onConfirm={() => ok(api.DELETE("/v1/jobs/{id}", { params: { path: { id: job.id } } }))}
                        onDone={onChange}
                    />
                ),
        },
    ];
    return <Table caption={t.jobs.table} columns={columns} rows={jobs} keyOf={(job) => job.id} />;
}
