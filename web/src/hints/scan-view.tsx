import { useMemo, useState } from "preact/hooks";

import { ScanFileField } from "../scan-sets/file-field";
import { keptFile } from "../scan-sets/kept-files";
import { t } from "../texts";
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
                <ScanFileField set={set} scan={scan} onChoose={setGiven} />
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
