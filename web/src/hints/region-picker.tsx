import { useMemo, useState } from "preact/hooks";

import type { Schema } from "../api/client";
import { announce } from "../lib/announce";
import { length, percent } from "../lib/format";
import { t } from "../texts";
import { Choice, Field } from "../ui/pieces";
import type { Place } from "../viewer/marker-types";
import type { Surface } from "../viewer/surface";
import { boxOf, diagonal, droppedShare, isDroppedBy, regionAt, shapes, type RegionHint, type Shape } from "./regions";
import { ScanView } from "./scan-view";

interface Props {
    set: Schema["ScanSet"];
    /** The regions that were kept, of all scans. */
    regions: readonly RegionHint[];
    onRegion: (region: RegionHint) => void;
}

/** Marks parts of a scan that are to be used or left out: what goes is seen at once. */
export function RegionPicker({ set, regions, onRegion }: Props) {
    const names = set.scans.map((scan) => scan.name);
    const [scan, setScan] = useState(names[0] ?? "");
    const [surface, setSurface] = useState<Surface>();
    const [place, setPlace] = useState<Place>();
    const [shape, setShape] = useState<Shape>("ball");
    const [kind, setKind] = useState<"use" | "leave">("leave");
    const [size, setSize] = useState(0.1);
    const box = useMemo(() => surface && boxOf(surface), [surface]);
    const radius = box ? size * diagonal(box) : 0;
    const draft: RegionHint | undefined = useMemo(
        () => (place && box ? { scan, [kind]: regionAt(shape, place, radius, box) } : undefined),
        [place, box, scan, kind, shape, radius],
    );
    const all = useMemo(
        () => [...regions.filter((region) => region.scan === scan), ...(draft ? [draft] : [])],
        [regions, scan, draft],
    );
    const isDropped = useMemo(() => (all.length > 0 ? isDroppedBy(all) : undefined), [all]);
    const share = useMemo(() => (surface && isDropped ? droppedShare(surface, isDropped) : 0), [surface, isDropped]);
    const places = useMemo(() => (place ? [place] : []), [place]);
    const choose = (name: string) => {
        setScan(name);
        setPlace(undefined);
        setSurface(undefined);
    };
    const pick = (picked: Place) => {
        setPlace(picked);
        announce(t.regions.picked);
    };
    const keep = () => {
        if (!draft) return;
        onRegion(draft);
        setPlace(undefined);
    };
    return (
        <section class="stack" aria-label={t.regions.title}>
            <p class="quiet">{t.regions.lead}</p>
            <div class="halves">
                <div class="stack">
                    <Choice
                        label={t.regions.scan}
                        value={scan}
                        choices={names.map((name) => [name, name] as const)}
                        onChange={choose}
                    />
                    <ScanView
                        key={scan}
                        set={set.id}
                        scan={scan}
                        places={places}
                        isDropped={isDropped}
                        onLoaded={setSurface}
                        onPick={pick}
                    />
                </div>
                <div class="panel stack">
                    <Choice
                        label={t.regions.what}
                        value={kind}
                        choices={(["leave", "use"] as const).map((name) => [name, t.regions.kinds[name]] as const)}
                        onChange={setKind}
                    />
                    <Choice
                        label={t.regions.shape}
                        value={shape}
                        choices={shapes.map((name) => [name, shapeText(name)] as const)}
                        onChange={setShape}
                    />
                    {shape === "ball" && (
                        <Field label={t.regions.radius(length(radius, set.unit))}>
                            {(id) => (
                                <input
                                    id={id}
                                    type="range"
                                    min={0.01}
                                    max={0.6}
                                    step={0.01}
                                    value={size}
                                    onInput={(event) => setSize(event.currentTarget.valueAsNumber)}
                                />
                            )}
                        </Field>
                    )}
                    <p role="status" data-testid="dropped">
                        {place ? t.regions.share(percent(share)) : t.regions.pick}
                    </p>
                    <button type="button" class="main" disabled={!draft} onClick={keep}>
                        {t.regions.keep}
                    </button>
                </div>
            </div>
        </section>
    );
}

export function shapeText(shape: Shape): string {
    if (shape === "ball") return t.regions.ball;
    const axis = shape.slice(1).toUpperCase();
    return shape.startsWith("+") ? t.regions.above(axis) : t.regions.below(axis);
}
