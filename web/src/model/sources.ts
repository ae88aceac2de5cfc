import type { Schema } from "../api/client";
import { at } from "../lib/address";

export type Kind = "mesh" | "cloud";

export const meshFormats = [
    "ply",
    "obj",
    "stl",
    "off",
    "glb",
    "3mf",
] as const satisfies readonly Schema["MeshFormat"][];
export const cloudFormats = [
    "ply",
    "pcd",
    "obj",
    "off",
    "xyz",
    "glb",
    "e57",
    "las",
] as const satisfies readonly Schema["CloudFormat"][];
export const posesFormats = [
    "json",
    "conf",
    "aln",
    "mlp",
    "log",
    "matrices",
] as const satisfies readonly Schema["PosesFormat"][];
export const scansFormats = [
    "e57",
    "ply",
    "pcd",
    "obj",
    "off",
    "xyz",
    "glb",
    "las",
] as const satisfies readonly Schema["ScansFormat"][];

// a format that the contract gains and this table lacks does not compile
type Lacking =
    | Exclude<Schema["MeshFormat"], (typeof meshFormats)[number]>
    | Exclude<Schema["CloudFormat"], (typeof cloudFormats)[number]>
    | Exclude<Schema["PosesFormat"], (typeof posesFormats)[number]>
    | Exclude<Schema["ScansFormat"], (typeof scansFormats)[number]>;
export const isComplete: Lacking extends never ? true : Lacking = true;

export function has(model: Schema["Model"], kind: string): boolean {
    return model.assets.some((asset) => asset.name.startsWith(`${kind}.`));
}

/** Where the surface of a model comes from as PLY: of an upload in another format it is made when it is asked for. */
export function surfaceUrl(model: Schema["Model"], kind: Kind): string {
    const own = model.assets.find((asset) => asset.name === `${kind}.ply`);
    return own?.href ?? at(`/v1/models/${encodeURIComponent(model.id)}/${kind}?format=ply`);
}

/** What is measured on the surface when it is asked for, and comes with a surface of its own. */
export type Measured = "saliency" | "deviation";

export function isMeasured(mode: string): mode is Measured {
    return mode === "saliency" || mode === "deviation";
}

/** The surface with a figure at each vertex; to another model where it is its distance. */
export function measuredUrl(model: Pick<Schema["Model"], "id">, what: Measured, reference: string): string {
    const address = `/v1/models/${encodeURIComponent(model.id)}/${what}.ply`;
    return what === "deviation" ? `${address}?${new URLSearchParams({ reference })}` : address;
}

export type Matrix = number[][];

/** What of a report is shown. It is the server's own, but of whatever version made the model: nothing is taken for granted. */
export interface Report {
    verdict?: { quality: string; reasons: string[] };
    views: {
        name: string;
        placed: boolean;
        unplaced?: string | null;
        copy_of?: string | null;
        points?: number;
        /** The scans of one number hang together. */
        group?: number | null;
        /** Moves its points in the model to where they were before its pose was refined. */
        start_from_final?: Matrix | null;
    }[];
    spacing?: number;
    /** Scans that fit in several ways. */
    alternatives: Alternatives[];
}

export interface Alternatives {
    name: string;
    /** The best first. */
    poses: { pose: Matrix; score: number }[];
    /** About which it turns freely, if it does. */
    axis?: { point: number[]; direction: number[] } | null;
}

export function reportOf(model: Schema["Model"]): Report | undefined {
    const result = (model.report as { result?: Partial<Report> } | null | undefined)?.result;
    if (!result) return undefined;
    return {
        views: Array.isArray(result.views) ? result.views : [],
        ...(result.verdict && { verdict: { quality: result.verdict.quality, reasons: result.verdict.reasons ?? [] } }),
        ...(typeof result.spacing === "number" && { spacing: result.spacing }),
        alternatives: Array.isArray(result.alternatives)
            ? result.alternatives.filter((row) => Array.isArray(row.poses) && row.poses.length > 0)
            : [],
    };
}
