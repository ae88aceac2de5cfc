import { api, ok, type Schema } from "../api/client";
import { date, duration } from "../lib/format";
import { href } from "../lib/router";
import { t } from "../texts";
import { DeleteButton } from "../ui/confirm";
import { Tag } from "../ui/pieces";

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
    return (
        <div class="table-wrap">
            <table class="folds">
                <caption class="unseen">{t.jobs.table}</caption>
                <thead>
                    <tr>
                        <th scope="col">{t.jobs.job}</th>
                        <th scope="col">{t.jobs.statusTitle}</th>
                        <th scope="col">{t.jobs.stage}</th>
                        <th scope="col" class="number">
                            {t.jobs.time}
                        </th>
                        <th scope="col">{t.created}</th>
                        <th>
                            <span class="unseen">{t.remove}</span>
                        </th>
                    </tr>
                </thead>
                <tbody>
                    {jobs.map((job) => {
                        const seconds = runningSeconds(job);
                        const name = `${t.jobs.kind[job.kind]}, ${date(job.created_at)}`;
                        return (
                            <tr key={job.id}>
                                <td class="name">
                                    <a href={href("jobs", job.id)} aria-label={name}>
                                        {t.jobs.kind[job.kind]}
                                    </a>
                                    {job.label && <span class="quiet"> · {job.label}</span>}
                                </td>
                                <td data-title={t.jobs.statusTitle}>
                                    <StatusTag status={job.status} />
                                </td>
                                <td data-title={t.jobs.stage}>
                                    {job.stage && !isFinished(job) ? (t.jobs.stages[job.stage] ?? job.stage) : ""}
                                </td>
                                <td data-title={t.jobs.time} class="number">
                                    {seconds === undefined ? "" : duration(seconds)}
                                </td>
                                <td data-title={t.created}>{date(job.created_at)}</td>
                                <td class="act">
                                    {isFinished(job) && (
                                        <DeleteButton
                                            name={name}
                                            consequence={t.confirm.job}
                                            label={`${t.remove}: ${name}`}
                                            className="bare"
                                            onConfirm={() =>
                                                ok(api.DELETE("/v1/jobs/{id}", { params: { path: { id: job.id } } }))
                                            }
                                            onDone={onChange}
                                        />
                                    )}
                                </td>
                            </tr>
                        );
                    })}
                </tbody>
            </table>
        </div>
    );
}
