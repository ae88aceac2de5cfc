import type { Alternatives, Matrix, Report } from "./sources";

/** Which of its places a scan gets, and how far it is turned from there about its axis, if it has one. */
export interface Chosen {
    index: number;
    degrees: number;
}

export const first: Chosen = { index: 0, degrees: 0 };

/** The pose that was chosen for a scan. */
export function poseOf(row: Alternatives, { index, degrees }: Chosen): Matrix {
    const pose = (row.poses[index] ?? row.poses[0])?.pose ?? [];
    return row.axis && degrees !== 0 ? turned(pose, row.axis, (degrees * Math.PI) / 180) : pose;
}

/** The poses that a new job starts from: those that were found, and those that were chosen. */
export function startingPoses(
    found: Record<string, Matrix | null>,
    rows: readonly Alternatives[],
    chosen: Record<string, Chosen>,
): Record<string, Matrix> {
    const poses: Record<string, Matrix> = {};
    for (const [name, pose] of Object.entries(found)) if (pose) poses[name] = pose;
    for (const row of rows) poses[row.name] = poseOf(row, chosen[row.name] ?? first);
    return poses;
}

/** The choice, made for all scans that hang together with this one: their places are in the same order. */
export function choose(
    rows: readonly Alternatives[],
    views: Report["views"],
    chosen: Record<string, Chosen>,
    name: string,
    choice: Chosen,
): Record<string, Chosen> {
    const groupOf = (scan: string) => views.find((view) => view.name === scan)?.group ?? undefined;
    const group = groupOf(name);
    const count = rows.find((row) => row.name === name)?.poses.length;
    const along = rows.filter(
        (row) => row.name !== name && group !== undefined && groupOf(row.name) === group && row.poses.length === count,
    );
    return { ...chosen, [name]: choice, ...Object.fromEntries(along.map((row) => [row.name, choice])) };
}

/** A pose, turned about an axis of the world. */
function turned(pose: Matrix, axis: NonNullable<Alternatives["axis"]>, angle: number): Matrix {
    const size = Math.hypot(...axis.direction) || 1;
    const [x = 0, y = 0, z = 0] = axis.direction.map((value) => value / size);
    const [sine, cosine] = [Math.sin(angle), Math.cos(angle)];
    const rest = 1 - cosine;
    const turn = [
        [cosine + x * x * rest, x * y * rest - z * sine, x * z * rest + y * sine],
        [y * x * rest + z * sine, cosine + y * y * rest, y * z * rest - x * sine],
        [z * x * rest - y * sine, z * y * rest + x * sine, cosine + z * z * rest],
    ];
    const at = (matrix: Matrix, row: number, column: number) => matrix[row]?.[column] ?? 0;
    const sum = (row: number, value: (index: number) => number) =>
        [0, 1, 2].reduce((total, index) => total + at(turn, row, index) * value(index), 0);
    const point = (index: number) => axis.point[index] ?? 0;
    const rows = [0, 1, 2].map((row) => [
        ...[0, 1, 2].map((column) => sum(row, (index) => at(pose, index, column))),
        sum(row, (index) => at(pose, index, 3) - point(index)) + point(row),
    ]);
    return [...rows, [0, 0, 0, 1]];
}
