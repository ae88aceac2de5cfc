import type { Job, Problem } from "./types.js";

/** Everything that this package throws by itself. */
export class VisageError extends Error {
    override name = "VisageError";
}

/** The service said no. */
export class Refused extends VisageError {
    override name = "Refused";

    constructor(readonly problem: Problem) {
        super(problem.hint ? `${problem.detail}; ${problem.hint}` : problem.detail);
    }

    /** What went wrong, stable across versions. */
    get code(): string {
        return this.problem.code;
    }

    /** The HTTP status. */
    get status(): number {
        return this.problem.status;
    }

    /** What to do about it. */
    get hint(): string {
        return this.problem.hint;
    }

    /** The scan concerned, if it is one. */
    get scan(): string | undefined {
        return this.problem.scan ?? undefined;
    }
}

/** A job has ended without a model. */
export class NotRegistered extends VisageError {
    override name = "NotRegistered";

    constructor(readonly job: Job) {
        super(job.error ? `${job.error.message}; ${job.error.hint}` : `the job is ${job.status}`);
    }
}

/** The service does not answer, however often it is asked. */
export class NoConnection extends VisageError {
    override name = "NoConnection";
}

/** Whatever came back, as a problem: a proxy on the way may answer with anything. */
export function problemOf(body: unknown, status: number): Problem {
    if (typeof body === "object" && body !== null && "code" in body && "detail" in body) return body as Problem;
    const title = `HTTP ${status}`;
    return { type: "about:blank", title, status, code: "unknown", detail: title, hint: "" };
}
