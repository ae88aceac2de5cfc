import type { Client as Core } from "openapi-fetch";

import { given } from "./client.js";
import type { paths } from "./core.js";
import type { Job, Schema } from "./types.js";

/** A registered model, and how it came about. */
export class Registration {
    constructor(
        private readonly core: Core<paths>,
        /** The job that made it. */
        readonly job: Job,
        /** The model as the service knows it, with its report. */
        readonly model: Schema["Model"],
        /** For each scan the 4x4 motion that maps it into the world; `null` for one that could not be placed. */
        readonly poses: Schema["Poses"],
    ) {}

    /** `good`, `doubtful` or `failed`. */
    get quality(): string {
        return this.model.quality ?? "unknown";
    }

    /** The points of all placed scans, as PLY. */
    cloud(): Promise<Blob> {
        return this.file("cloud.ply");
    }

    /** The surface, as PLY. */
    mesh(): Promise<Blob> {
        return this.file("mesh.ply");
    }

    private file(file: Schema["SurfaceFile"]): Promise<Blob> {
        const params = { path: { id: this.model.id, file } };
        return given(this.core.GET("/v1/models/{id}/{file}", { params, parseAs: "blob" }));
    }
}
