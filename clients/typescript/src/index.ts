export { Client, everyItem, given, type ClientSettings, type RegisterWishes, type UploadWishes } from "./client.js";
export type { components, operations, paths } from "./core.js";
export { NoConnection, NotRegistered, Refused, VisageError } from "./errors.js";
export { Registration } from "./registration.js";
export type { Job, Patience, Poses, Problem, Progress, Schema } from "./types.js";
