import { useState } from "preact/hooks";

import { announce } from "../lib/announce";
import { length } from "../lib/format";
import { t } from "../texts";
import type { Place } from "../viewer/marker-types";

/** Two places that were picked, and how far they are from each other. */
export function useMeasuring(unit: string) {
    const [isOn, setOn] = useState(false);
    const [places, setPlaces] = useState<Place[]>([]);
    const distance = distanceOf(places);
    const text = distance === undefined ? undefined : length(distance, unit);
    const pick = (place: Place) => {
        const next = places.length === 1 ? [...places, place] : [place];
        setPlaces(next);
        const measured = distanceOf(next);
        announce(measured === undefined ? t.viewer.measureNext : t.viewer.distance(length(measured, unit)));
    };
    const toggle = () => {
        setOn(!isOn);
        setPlaces([]);
    };
    return { isOn, places, text, pick, toggle };
}

function distanceOf([from, to]: readonly Place[]): number | undefined {
    return from && to && Math.hypot(to[0] - from[0], to[1] - from[1], to[2] - from[2]);
}

/** What is to be picked next, or what was measured. */
export function MeasureNote({ measuring, unit }: { measuring: ReturnType<typeof useMeasuring>; unit: string }) {
    const { places, text } = measuring;
    return (
        <div class="note">
            <p data-testid="distance">
                {text ? t.viewer.distance(text) : places.length === 1 ? t.viewer.measureNext : t.viewer.measureHelp}
            </p>
            {unit === "unknown" && <p class="small">{t.model.unitNote}</p>}
        </div>
    );
}
