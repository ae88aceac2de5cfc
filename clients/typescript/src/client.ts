import createClient, { type Client as Core } from "openapi-fetch";

import type { paths } from "./core.js";
import { NotRegistered, problemOf, Refused } from "./errors.js";
import { patientFetch } from "./patient.js";
import { LARGE, sendInPieces } from "./pieces.js";
import { Registration } from "./registration.js";
import type { Job, Patience, Poses, Progress, Schema } from "./types.js";

const ARCHIVES = [".zip", ".tar", ".tgz", ".tar.gz"];
/** What is understood together with other files: depth images, and textures with what names them. */
const COMPANIONS = [".png", ".tif", ".tiff", ".jpg", ".jpeg", ".mtl"];
/** How much of a registration the sending of scans counts for. */
const SENDING = 0.3;
const WAIT = 30;
const WAIT_WITH_PROGRESS = 1;

export interface ClientSettings {
    /** What the service knows you by. */
    key?: string;
    patience?: Partial<Patience>;
}

export interface UploadWishes {
    /** Where the scans start. */
    poses?: Poses;
    unit?: Schema["Unit"];
    name?: string;
    progress?: Progress;
    signal?: AbortSignal;
}

export interface RegisterWishes extends UploadWishes {
    /** Its class, for the gallery. */
    label?: string;
    /** As `info().job_options` lists them. */
    options?: Schema["JobOptions"];
    hints?: Schema["Hints"];
}

/** What a call of the core gives, or throws. */
export async function given<T>(call: Promise<{ data?: T; error?: unknown; response: Response }>): Promise<T> {
    const { data, error, response } = await call;
    if (error !== undefined || !response.ok) throw new Refused(problemOf(error, response.status));
    return data as T;
}

/** A service of visage. */
export class Client {
    /** Every call of the contract, typed: `await given(client.core.GET("/v1/models"))`. */
    readonly core: Core<paths>;
    private readonly base: string;
    private readonly headers: Record<string, string>;
    private readonly fetch: (request: Request) => Promise<Response>;

    /** `url` is the address of the service; in a browser that is the page's own if it is not given. */
    constructor(url?: string, { key, patience }: ClientSettings = {}) {
        const own = (globalThis as { location?: { origin: string } }).location?.origin;
        this.base = (url ?? own ?? "http://127.0.0.1:8080").replace(/\/+$/, "");
        this.headers = key ? { authorization: `Bearer ${key}` } : {};
        this.fetch = patientFetch({ tries: 5, pause: 500, ...patience });
        this.core = createClient<paths>({ baseUrl: this.base, headers: this.headers, fetch: this.fetch });
    }

    /** Limits, versions, formats and the options of jobs. */
    info(): Promise<Schema["Info"]> {
        return given(this.core.GET("/v1/info"));
    }

    /** Stores scans as a set. Files that the service does not read are left out. */
    async upload(scans: Iterable<File>, wishes: UploadWishes = {}): Promise<Schema["ScanSet"]> {
        const { poses, unit, progress, signal } = wishes;
        const { file_formats } = await this.info();
        const all = [...scans];
        const isOf = (file: File, endings: readonly string[]) =>
            endings.some((ending) => file.name.toLowerCase().endsWith(ending.startsWith(".") ? ending : `.${ending}`));
        const whole = all.filter((file) => isOf(file, ARCHIVES) || isOf(file, COMPANIONS));
        const files = all.filter((file) => whole.includes(file) || isOf(file, file_formats));
        const name = wishes.name ?? files[0]?.name ?? "scans";
        const set = whole.length > 0
            ? await this.sendWhole(files, name, unit, signal)
            : await given(
                  this.core.POST("/v1/scan-sets", {
                      body: { name, ...(unit && { unit }) },
                      params: { header: { "Idempotency-Key": crypto.randomUUID() } },
                      ...(signal && { signal }),
                  }),
              );
        if (whole.length === 0) await this.sendScans(set.id, files, progress, signal);
        if (poses instanceof File) {
            const put = this.core.PUT("/v1/scan-sets/{id}/pose-file", {
                params: { path: { id: set.id } },
                body: poses,
                bodySerializer: (body) => body as unknown as BodyInit,
                headers: { "content-type": "application/octet-stream" },
            });
            await given(put);
        } else if (poses) {
            await given(this.core.PUT("/v1/scan-sets/{id}/poses", { params: { path: { id: set.id } }, body: poses }));
        }
        return given(this.core.GET("/v1/scan-sets/{id}", { params: { path: { id: set.id } } }));
    }

    /** Sends scans, waits until they are registered, and gives the result. */
    async register(scans: Iterable<File>, wishes: RegisterWishes = {}): Promise<Registration> {
        const { label, options, hints, progress, signal } = wishes;
        const sending = progress && ((what: string, done: number) => progress(what, SENDING * done));
        const set = await this.upload(scans, { ...wishes, ...(sending && { progress: sending }) });
        const job = await given(
            this.core.POST("/v1/jobs", {
                body: {
                    scan_set_id: set.id,
                    ...(label !== undefined && { label }),
                    ...(options && { options }),
                    ...(hints && { hints }),
                },
                params: { header: { "Idempotency-Key": crypto.randomUUID() } },
            }),
        );
        const rest = progress && ((what: string, done: number) => progress(what, SENDING + (1 - SENDING) * done));
        return this.wait(job, { ...(rest && { progress: rest }), ...(signal && { signal }) });
    }

    /** Waits for the end of a registration, which may have been ordered before. */
    async wait(job: Job | string, { progress, signal }: Pick<UploadWishes, "progress" | "signal"> = {}): Promise<Registration> {
        const look = (id: string, wait: number) =>
            given(this.core.GET("/v1/jobs/{id}", { params: { path: { id }, query: { wait } }, ...(signal && { signal }) }));
        let now = typeof job === "string" ? await look(job, 0) : job;
        while (now.status === "queued" || now.status === "running") {
            progress?.(now.stage ?? "waiting", now.progress);
            now = await look(now.id, progress ? WAIT_WITH_PROGRESS : WAIT);
        }
        if (now.status !== "succeeded" || !now.model_id) throw new NotRegistered(now);
        progress?.("succeeded", 1);
        const path = { id: now.model_id };
        const model = await given(this.core.GET("/v1/models/{id}", { params: { path } }));
        const poses = await given(this.core.GET("/v1/models/{id}/poses.json", { params: { path } }));
        return new Registration(this.core, now, model, poses);
    }

    /** Models that are like a stored one (its id), or like a mesh or cloud in a file; best first. */
    async like(to: string | File, { limit = 20, unit }: { limit?: number; unit?: Schema["Unit"] } = {}): Promise<Schema["Match"][]> {
        if (typeof to === "string") {
            return (await given(this.core.POST("/v1/queries", { body: { model_id: to, limit } }))).matches;
        }
        const body = { probe: to, limit, ...(unit && { unit }) };
        const answer = this.core.POST("/v1/queries/probe", { body, bodySerializer: formOf });
        return (await given(answer)).matches;
    }

    /** Models that are of a class: faces, or what a standard of your own says; best first. */
    async matching(standard = "face", { limit = 20, onlyMatches = true } = {}): Promise<Schema["Match"][]> {
        const body = { standard, limit, only_matches: onlyMatches };
        return (await given(this.core.POST("/v1/queries", { body }))).matches;
    }

    /** All models of the service, page by page. */
    models(filter: { text?: string; label?: string } = {}): AsyncGenerator<Schema["ModelSummary"]> {
        return everyItem((cursor) =>
            given(this.core.GET("/v1/models", { params: { query: { ...filter, limit: 100, ...(cursor && { cursor }) } } })),
        );
    }

    /** All jobs of the service, page by page. */
    jobs(): AsyncGenerator<Job> {
        return everyItem((cursor) =>
            given(this.core.GET("/v1/jobs", { params: { query: { limit: 100, ...(cursor && { cursor }) } } })),
        );
    }

    /** What is understood together goes as one form, which is kept as a whole or not at all. */
    private sendWhole(scans: File[], name: string, unit?: Schema["Unit"], signal?: AbortSignal): Promise<Schema["ScanSet"]> {
        return given(
            this.core.POST("/v1/scan-sets/upload", {
                body: { scans, name, ...(unit && { unit }) },
                bodySerializer: formOf,
                params: { header: { "Idempotency-Key": crypto.randomUUID() } },
                ...(signal && { signal }),
            }),
        );
    }

    private async sendScans(set: string, scans: File[], progress?: Progress, signal?: AbortSignal): Promise<void> {
        const total = scans.reduce((sum, scan) => sum + scan.size, 0) || 1;
        let before = 0;
        for (const scan of scans) {
            const told = (bytes: number) => progress?.(`sending ${scan.name}`, (before + bytes) / total);
            told(0);
            if (scan.size > LARGE) {
                await sendInPieces({ base: this.base, headers: this.headers, fetch: this.fetch }, set, scan, told, signal);
            } else {
                const put = this.core.PUT("/v1/scan-sets/{id}/scans/{name}", {
                    params: { path: { id: set, name: scan.name } },
                    body: scan,
                    bodySerializer: (body) => body as unknown as BodyInit,
                    headers: { "content-type": "application/octet-stream" },
                    ...(signal && { signal }),
                });
                await given(put);
            }
            before += scan.size;
        }
    }
}

/** Items of a list, page by page as they are asked for. */
export async function* everyItem<T>(
    page: (cursor: string | undefined) => Promise<{ items: T[]; next_cursor?: string | null }>,
): AsyncGenerator<T> {
    let cursor: string | undefined;
    do {
        const answer = await page(cursor);
        yield* answer.items;
        cursor = answer.next_cursor ?? undefined;
    } while (cursor !== undefined);
}

/** Fields as a form: files as they are, lists as several fields, anything else as its text. */
function formOf(fields: object): FormData {
    const form = new FormData();
    for (const [name, value] of Object.entries(fields)) {
        for (const item of Array.isArray(value) ? value : [value]) {
            if (item instanceof Blob) form.append(name, item, item instanceof File ? item.name : name);
            else form.append(name, String(item));
        }
    }
    return form;
}
