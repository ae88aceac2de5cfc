import { useMemo, useState } from "preact/hooks";

import { keptFile } from "../scan-sets/kept-files";
import { t } from "../texts";
import { Field } from "../ui/pieces";
import { byAxis } from "../viewer/facing";
import type { Markers, Place } from "../viewer/marker-types";
import { read } from "../viewer/load";
import { Viewer } from "../viewer/viewer";

const colour = "#ff9d2e";
const nothingHidden: ReadonlySet<number> = new Set();

interface Props {
    set: string;
    scan: string;
    places: readonly Place[];
    onPick: (place: Place) => void;
}

/** A scan from the reader's own disk: the server does not give scans back. */
export function ScanView({ set, scan, places, onPick }: Props) {
    const [given, setGiven] = useState<File>();
    const file = given ?? keptFile(set, scan);
    const look = useMemo(() => ({ mode: "plain" as const, facing: byAxis[1], hidden: nothingHidden }), []);
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
                            onChange={(event) => setGiven(event.currentTarget.files?.[0])}
                        />
                    )}
                </Field>
            </div>
        );
    }
    const load = async () => read(await file.arrayBuffer(), kindOf(file.name));
    return (
        <Viewer
            source={`${scan}/${file.name}/${file.lastModified}`}
            label={`${scan}. ${t.viewer.label}`}
            load={load}
            look={look}
            markers={markers}
            onPick={onPick}
        />
    );
}

function kindOf(name: string): "ply" | "xyz" {
    if (/\.ply$/i.test(name)) return "ply";
    if (/\.(xyz|xyzn|xyzrgb|txt|asc|csv|pts)$/i.test(name)) return "xyz";
    throw new Error(t.hints.unreadable);
}
