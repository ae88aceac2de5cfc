import { useMemo, useState } from "preact/hooks";

import type { Schema } from "../api/client";
import { href } from "../lib/router";
import { Counts } from "../model/counts";
import { Legend } from "../model/legend";
import { modeOf } from "../model/look-modes";
import { has, isMeasured, measuredUrl, surfaceUrl, type Kind } from "../model/sources";
import { t } from "../texts";
import { Quality } from "../ui/pieces";
import { modesOf, type ColourMode } from "../viewer/colours";
import type { Facing } from "../viewer/facing";
import type { CameraLink } from "../viewer/link";
import { fetchSurface } from "../viewer/load";
import type { Cut } from "../viewer/scene";
import { boundsOf, type Bounds, type Surface } from "../viewer/surface";
import { Viewer } from "../viewer/viewer";

interface Props {
    model: Schema["Model"];
    /** Which of the two it is: runs of the same scans have the same name. */
    title: string;
    /** What both have; each what it has where that is not the same. */
    kind: Kind | undefined;
    wanted: ColourMode;
    /** The model beside it. */
    other: string;
    facing: Facing;
    cut: Cut | undefined;
    /** Across which both are cut; each across itself if it is not given. */
    across: Bounds | undefined;
    onBounds: (bounds: Bounds) => void;
    link: CameraLink;
    fitTurn: number;
}

const nothingHidden: ReadonlySet<number> = new Set();

/** One of two models. */
export function Side({ model, title, kind, wanted, other, facing, cut, across, link, fitTurn, onBounds }: Props) {
    const [surface, setSurface] = useState<Surface>();
    const [range, setRange] = useState<[number, number]>();
    const shownKind = kind ?? (has(model, "mesh") ? "mesh" : "cloud");
    const measured = isMeasured(wanted) ? wanted : undefined;
    const mode = measured ?? modeOf(wanted, surface ? modesOf(surface) : ["plain"], shownKind);
    const look = useMemo(
        () => ({ mode, facing, cut: cut && { ...cut, across }, hidden: nothingHidden }),
        [mode, facing, cut, JSON.stringify(across)],
    );
    const url = measured ? measuredUrl(model, measured, other) : surfaceUrl(model, shownKind);
    return (
        <section aria-label={`${title}: ${model.name}`}>
            <h2 class="row">
                <a href={href("models", model.id)}>{model.name}</a> <Quality quality={model.quality} />
            </h2>
            <Viewer
                source={url}
                keepsView
                load={(signal, onShare) => fetchSurface(url, signal, onShare)}
                look={look}
                link={link}
                label={`${title}: ${model.name}. ${t.viewer.label}`}
                onLoaded={(loaded) => {
                    setSurface(loaded);
                    onBounds(boundsOf(loaded));
                }}
                onRange={setRange}
                fitTurn={fitTurn}
            />
            <p class="quiet small">{surface && <Counts surface={surface} />}</p>
            {range && <Legend mode={mode} range={range} unit={model.unit} />}
        </section>
    );
}
