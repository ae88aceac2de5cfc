import { useEffect, useState } from "preact/hooks";

import { api, ok, type Schema } from "../api/client";
import { t } from "../texts";
import { usePages } from "../ui/pages";
import { Choice, Loading, PageTitle, Trouble } from "../ui/pieces";
import { isFinished, JobTable } from "./table";

const statuses = ["queued", "running", "succeeded", "failed", "canceled"] as const;
/** How often a list with unfinished jobs is looked at again. A single job is followed live. */
const pause = 3000;

/** All jobs. */
export function JobList() {
    const [status, setStatus] = useState<Schema["JobStatus"] | "all">("all");
    const query = status === "all" ? {} : { status };
    const jobs = usePages(
        (cursor) => ok(api.GET("/v1/jobs", { params: { query: cursor ? { ...query, cursor } : query } })),
        [status],
    );
    const hasUnfinished = jobs.items?.some((job) => !isFinished(job)) ?? false;
    useEffect(() => {
        if (!hasUnfinished) return;
        const timer = setInterval(() => document.hidden || jobs.reload(), pause);
        return () => clearInterval(timer);
    }, [hasUnfinished, jobs.reload]);
    const choices = [["all", t.jobs.all] as const, ...statuses.map((name) => [name, t.jobs.status[name]] as const)];
    return (
        <>
            <PageTitle title={t.jobs.title} />
            <div class="tools">
                <Choice label={t.jobs.filter} value={status} choices={choices} onChange={setStatus} />
            </div>
            <section class="panel" aria-label={t.jobs.table}>
                <Trouble error={jobs.error} />
                {!jobs.items && jobs.isLoading && <Loading />}
                {jobs.items?.length === 0 && <p class="empty">{t.jobs.empty}</p>}
                {jobs.items && jobs.items.length > 0 && <JobTable jobs={jobs.items} onChange={jobs.reload} />}
                {jobs.more}
            </section>
        </>
    );
}
