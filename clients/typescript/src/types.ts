import type { components } from "./core.js";

/** What goes over the wire, by the names of the contract. */
export type Schema = components["schemas"];
export type Job = Schema["Job"];
export type Problem = Schema["Problem"];

/** Is told what is being done, and how much of all of it is (0 to 1). */
export type Progress = (what: string, done: number) => void;

/** Where scans start: a pose file of any kind, or 4x4 matrices (scan to world) by the names of scans. */
export type Poses = File | Schema["Poses"];

/** How often, and after which pauses, a lost connection or a busy service is tried again. */
export interface Patience {
    /** So often a call is tried in all. */
    tries: number;
    /** The first pause in milliseconds; each further one is twice as long, where the service does not say when to come back. */
    pause: number;
}
