import { useEffect, useRef, useState } from "preact/hooks";

import { api, ApiError, ok, type Schema } from "../api/client";
import { follow } from "../api/follow";
import { announce } from "../lib/announce";
import { date, duration, percent } from "../lib/format";
import { go, href } from "../lib/router";
import { useInfo } from "../lib/use-info";
import { t } from "../texts";
import { DeleteButton } from "../ui/confirm";
import { Fault, Loading, PageTitle, Tag, Trouble } from "../ui/pieces";
import { StartJob } from "./start";
import { isFinished, runningSeconds, StatusTag } from "./table";
import { secondsLeft } from "./time-left";

type Job = Schema["Job"];

/** The job as it is now, followed until it ends. */
function useJob(id: string, turn: number) {
    const [job, setJob] = useState<Job>();
    const [isLive, setLive] = useState(false);
    const [error, setError] = useState<unknown>();
    useEffect(() => {
        let isCurrent = true;
        const look = () => ok(api.GET("/v1/jobs/{id}", { params: { path: { id } } }));
        const show = (next: Job) => {
            if (!isCurrent) return;
            setJob(next);
            setError(undefined);
        };
        let stop: (() => void) | undefined;
        look().then(
            (first) => {
                show(first);
                if (!isCurrent || isFinished(first)) return;
                stop = follow(id, {
                    onJob: show,
                    onState: setLive,
                    onRefused: () =>
                        void look().then(show, (fault) => {
                            if (!isCurrent) return;
                            setError(fault);
                            // a job that was deleted does not come back
                            if (fault instanceof ApiError && fault.problem.status === 404) stop?.();
                        }),
                });
            },
            (fault) => isCurrent && setError(fault),
        );
        return () => {
            isCurrent = false;
            stop?.();
        };
    }, [id, turn]);
    return { job, setJob, isLive, error };
}

/** One job, live. */
export function JobPage({ id }: { id: string }) {
    const [turn, setTurn] = useState(0);
    const { job, setJob, isLive, error } = useJob(id, turn);
    const [actionError, setActionError] = useState<unknown>();
    const status = job?.status;
    const before = useRef(status);
    useEffect(() => {
        if (status && before.current && before.current !== status) announce(t.jobs.announce[status]);
        before.current = status;
    }, [status]);
    if (!job)
        return error ? (
            <>
                <PageTitle title={t.jobs.title} />
                <Trouble error={error} />
            </>
        ) : (
            <Loading />
        );
    const act = async (call: Promise<Job>) => {
        setActionError(undefined);
        try {
            setJob(await call);
            setTurn((count) => count + 1);
        } catch (fault) {
            setActionError(fault);
        }
    };
    const path = { params: { path: { id } } };
    return (
        <>
            <PageTitle title={t.jobs.kind[job.kind]}>
                {!isFinished(job) && (
                    <button
                        type="button"
                        class="risky"
                        disabled={job.cancel_asked}
                        onClick={() => act(ok(api.POST("/v1/jobs/{id}/cancel", path)))}
                    >
                        {job.cancel_asked ? t.jobs.stopping : t.jobs.stop}
                    </button>
                )}
                {(job.status === "failed" || job.status === "canceled") && (
                    <button type="button" onClick={() => act(ok(api.POST("/v1/jobs/{id}/retry", path)))}>
                        {t.jobs.retry}
                    </button>
                )}
                {isFinished(job) && (
                    <DeleteButton
                        name={t.jobs.kind[job.kind]}
                        consequence={t.confirm.job}
                        goesToBin
                        onConfirm={() => ok(api.DELETE("/v1/jobs/{id}", path))}
                        onDone={() => go(job.scan_set_id ? href("scan-sets", job.scan_set_id) : href("jobs"))}
                    />
                )}
            </PageTitle>
            <Trouble error={actionError ?? error} />
            <Progress job={job} isLive={isLive} />
            {job.error && (
                <Fault
                    code={job.error.code}
                    message={job.error.message}
                    hint={job.error.hint}
                    scan={job.error.scan ?? null}
                />
            )}
            <div class="row">
                {job.model_id && (
                    <a class="button main" href={href("models", job.model_id)}>
                        {t.jobs.toModel}
                    </a>
                )}
                {job.scan_set_id && (
                    <a class="button" href={href("scan-sets", job.scan_set_id)}>
                        {t.jobs.toSet}
                    </a>
                )}
            </div>
            <Stages job={job} />
            {isFinished(job) && job.kind === "register" && job.scan_set_id && (
                <Again job={job} setId={job.scan_set_id} />
            )}
        </>
    );
}

function Progress({ job, isLive }: { job: Job; isLive: boolean }) {
    const elapsed = runningSeconds(job);
    const left = elapsed === undefined ? undefined : secondsLeft(job.progress, elapsed);
    const isRunning = job.status === "running";
    return (
        <section class="panel stack" aria-label={t.jobs.progress}>
            <div class="row spread">
                <span class="row">
                    <StatusTag status={job.status} />
                    {isRunning && job.stage && <span>{t.jobs.stageNow(t.jobs.stages[job.stage] ?? job.stage)}</span>}
                    {job.status === "queued" && <span>{t.jobs.waiting}</span>}
                </span>
                {!isFinished(job) && (
                    <Tag kind={isLive ? "busy" : undefined}>{isLive ? t.jobs.live : t.jobs.reconnecting}</Tag>
                )}
            </div>
            <progress aria-label={t.jobs.progress} max={1} value={job.progress} />
            <div class="row spread quiet small number">
                <span>{percent(job.progress)}</span>
                <span>
                    {isRunning && (left === undefined ? t.jobs.leftUnknown : t.jobs.left(duration(left)))}
                    {isFinished(job) && elapsed !== undefined && t.jobs.took(duration(elapsed))}
                </span>
            </div>
            {job.attempts > 1 && (
                <div class="note">
                    <p>{t.jobs.attempts(job.attempts)}</p>
                </div>
            )}
        </section>
    );
}

function Stages({ job }: { job: Job }) {
    const rows = Object.entries(job.seconds);
    return (
        <section class="panel">
            <dl class="facts">
                <dt>{t.created}</dt>
                <dd>{date(job.created_at)}</dd>
                {job.label && (
                    <>
                        <dt>{t.label}</dt>
                        <dd>{job.label}</dd>
                    </>
                )}
            </dl>
            {rows.length > 0 && (
                <details>
                    <summary>{t.jobs.seconds}</summary>
                    <dl class="facts number">
                        {rows.map(([stage, seconds]) => (
                            <>
                                <dt key={stage}>{t.jobs.stages[stage] ?? stage}</dt>
                                <dd>{duration(seconds)}</dd>
                            </>
                        ))}
                    </dl>
                </details>
            )}
        </section>
    );
}

function Again({ job, setId }: { job: Job; setId: string }) {
    const info = useInfo();
    const [scans, setScans] = useState<Schema["ScanView"][]>();
    const [error, setError] = useState<unknown>();
    const open = (isOpen: boolean) => {
        if (!isOpen || scans) return;
        ok(api.GET("/v1/scan-sets/{id}", { params: { path: { id: setId } } })).then(
            (set) => setScans(set.scans),
            setError,
        );
    };
    return (
        <section class="panel">
            <details onToggle={(event) => open(event.currentTarget.open)}>
                <summary>{t.jobs.other}</summary>
                <Trouble error={error ?? info.error} />
                {scans && info.data && (
                    <StartJob info={info.data} set={{ id: setId, scans }} like={job} text={t.options.start} />
                )}
            </details>
        </section>
    );
}
