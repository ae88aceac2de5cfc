import { href } from "../lib/router";
import { unitNames, type Unit } from "../ui/pieces";
import type { Pick } from "../viewer/scene";

type Place = [number, number, number];

/** A triangle of a model, and from which side it was seen. */
export interface Triangle {
    corners: [Place, Place, Place];
    outward: Place;
    unit: Unit;
}

/** The address of the gallery's answer for three places that were picked. */
export function triangleAddress(picks: readonly Pick[], unit: string): string {
    const corners = picks.flatMap(({ place }) => [...place]);
    // the eye saw the outer side of all three
    const outward = [0, 1, 2].map((axis) => picks.reduce((sum, { toEye }) => sum + (toEye[axis] as number), 0));
    const listed = (numbers: readonly number[]) => numbers.map((value) => Number(value.toPrecision(9))).join(",");
    const query = new URLSearchParams({ triangle: listed(corners), outward: listed(outward), unit });
    return `${href("gallery")}?${query}`;
}

/** The triangle that an address names, if it is one. */
export function triangleOf(query: URLSearchParams): Triangle | undefined {
    const numbers = (name: string, count: number) => {
        const values = (query.get(name) ?? "").split(",").map((text) => (text.trim() === "" ? NaN : Number(text)));
        return values.length === count && values.every(Number.isFinite) ? values : undefined;
    };
    const [corners, outward] = [numbers("triangle", 9), numbers("outward", 3)];
    if (!corners || !outward) return undefined;
    const place = (from: number) => corners.slice(from, from + 3) as Place;
    const unit = unitNames.find((name) => name === query.get("unit")) ?? "unknown";
    return { corners: [place(0), place(3), place(6)], outward: outward as Place, unit };
}
