import { css, viewColour } from "../viewer/colours";
import type { Marker, Markers, Place } from "../viewer/marker-types";
import type { Matrix } from "./sources";

/** Where a face, or a thing of another class, was found on the model. */
export interface Found {
    landmarks: Record<string, number[]>;
    triangle: number[][] | undefined;
}

interface Told {
    names: readonly string[];
    poses: Record<string, Matrix | null> | undefined;
    found: Found | undefined;
    shown: { landmarks: boolean; triangle: boolean };
    marks: readonly [string, Place][];
    /** Whether the marks are the corners of one. */
    isTriangle: boolean;
    measured: readonly Place[];
    distance: string | undefined;
}

const foundColour = "#e0457b";
const markColour = "#ff9d2e";
const measureColour = "#2f9bff";

/** All that stands beside the surface. */
export function markersOf(told: Told): Markers {
    const { names, poses, found, shown, marks, isTriangle, measured, distance } = told;
    const points: Marker[] = [];
    const lines: Markers["lines"] = [];
    for (const [name, pose] of Object.entries(poses ?? {})) {
        const at = pose && originOf(pose);
        if (at)
            points.push({ kind: "scanner", at, text: name, colour: css(viewColour(Math.max(0, names.indexOf(name)))) });
    }
    if (found && shown.landmarks) {
        for (const [name, at] of Object.entries(found.landmarks)) {
            if (isPlace(at)) points.push({ kind: "point", at, text: name.replaceAll("_", " "), colour: foundColour });
        }
    }
    const corners = found?.triangle?.filter(isPlace);
    if (corners?.length === 3 && shown.triangle) lines.push({ places: corners, isClosed: true, colour: foundColour });
    for (const [name, at] of marks) points.push({ kind: "point", at, text: name, colour: markColour });
    if (isTriangle && marks.length > 1)
        lines.push({ places: marks.map(([, at]) => at), isClosed: marks.length > 2, colour: markColour });
    measured.forEach((at, index) =>
        points.push({
            kind: "point",
            at,
            colour: measureColour,
            ...(index === 1 && distance ? { text: distance } : {}),
        }),
    );
    if (measured.length === 2) lines.push({ places: [...measured], isClosed: false, colour: measureColour });
    return { points, lines };
}

function isPlace(at: readonly number[]): at is [number, number, number] {
    return at.length === 3 && at.every(Number.isFinite);
}

/** Where the origin of a scan's frame is in the frame of the model: the scanner, in the files of most. */
export function originOf(pose: Matrix): Place | undefined {
    const at = [0, 1, 2].map((row) => pose[row]?.[3] ?? NaN);
    return isPlace(at) ? at : undefined;
}
