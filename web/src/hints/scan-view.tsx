import { useMemo, useState } from "preact/hooks";

import { keepFile, keptFile } from "../scan-sets/kept-files";
import { t } from "../texts";
import { Field } from "../ui/pieces";
import { byAxis } from "../viewer/facing";
import type { Markers, Place } from "../viewer/marker-types";
import { readFile } from "../viewer/load";
import type { IsDropped } from "../viewer/scene";
import type { Surface } from "../viewer/surface";
import { Viewer } from "../viewer/viewer";

const colour = "#ff9d2e";
const nothingHidden: ReadonlySet<number> = new Set();

interface Props {
    set: string;
    scan: string;
    places: readonly Place[];
    /** What is marked as left out. */
    isDropped?: IsDropped | undefined;
    onLoaded?: (surface: Surface) => void;
    onPick: (place: Place) => void;
}

/** A scan from the reader's own disk: the server does not give scans back. */
export function ScanView({ set, scan, places, isDropped, onLoaded, onPick }: Props) {
    const [given, setGiven] = useState<File>();
    const file = given ?? keptFile(set, scan);
    const choose = (chosen: File | undefined) => {
        if (chosen) keepFile(set, scan, chosen);
        setGiven(chosen);
    };
    const look = useMemo(
        () => ({ mode: "plain" as const, facing: byAxis[1], hidden: nothingHidden, isDropped }),
        [isDropped],
    );
    const markers: Markers = useMemo(
        () => ({
            points: places.map((at, index) => ({ kind: "point", at, text: String(index + 1), colour })),
            lines: [],
        }),
        [places],
    );
    if (!file) {
        return (
            <div class="panel">
                <Field label={t.hints.file(scan)} help={t.hints.fileHelp}>
                    {(id, help) => (
                        <input
                            id={id}
                            aria-describedby={help}
                            type="file"
                            onChange={(event) => choose(event.currentTarget.files?.[0])}
                        />
                    )}
                </Field>
            </div>
        );
    }
    return (
        <Viewer
            source={`${scan}/${file.name}/${file.lastModified}`}
            label={`${scan}. ${t.viewer.label}`}
            load={() => readFile(file)}
            look={look}
            markers={markers}
            {...(onLoaded && { onLoaded })}
            onPick={({ place }) => onPick(place)}
        />
    );
}
