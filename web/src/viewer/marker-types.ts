export type Place = readonly [number, number, number];

/** Something that stands beside the surface, in the coordinates of the model. */
export interface Marker {
    kind: "point" | "scanner";
    at: Place;
    /** Shown beside it. */
    text?: string;
    colour: string;
}

export interface Markers {
    points: Marker[];
    /** Lines from place to place; closed ones are triangles. */
    lines: { places: Place[]; isClosed: boolean; colour: string }[];
}

export const noMarkers: Markers = { points: [], lines: [] };
