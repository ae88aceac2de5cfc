import { useMemo, useState } from "preact/hooks";

import type { Schema } from "../api/client";
import { announce } from "../lib/announce";
import { length, number, figure } from "../lib/format";
import { t } from "../texts";
import { Check, Choice } from "../ui/pieces";
import { css, modesOf, viewColour, type ColourMode } from "../viewer/colours";
import { byAxis, ofFace } from "../viewer/facing";
import { fetchSurface } from "../viewer/load";
import type { Markers, Place } from "../viewer/marker-types";
import type { Cut } from "../viewer/scene";
import type { Surface } from "../viewer/surface";
import { Viewer } from "../viewer/viewer";
import { CutControls } from "./cut-controls";
import { markersOf, type Found } from "./marker-list";
import { has, surfaceUrl, type Kind, type Matrix, type Report } from "./sources";
import { ViewList } from "./view-list";

interface Props {
    model: Schema["Model"];
    report: Report | undefined;
    poses: Record<string, Matrix | null> | undefined;
    found: Found | undefined;
    /** Landmarks that are being picked. */
    marks: [string, Place][];
    onMark?: ((place: Place) => void) | undefined;
}

const nothingHidden: ReadonlySet<number> = new Set();

/** The surface of a model with all that can be asked of it. */
export function ModelViewer({ model, report, poses, found, marks, onMark }: Props) {
    const kinds = (["mesh", "cloud"] as const).filter((kind) => has(model, kind));
    const [kind, setKind] = useState<Kind>(kinds[0] ?? "cloud");
    const [surface, setSurface] = useState<Surface>();
    const [wanted, setWanted] = useState<ColourMode>();
    const [range, setRange] = useState<[number, number]>();
    const face = useMemo(() => found && ofFace(found.landmarks), [found]);
    const [up, setUp] = useState(face ? "face" : "1");
    const facing = up === "face" && face ? face : (byAxis[Number(up)] ?? byAxis[1]);
    const [cut, setCut] = useState<Cut>();
    const [hidden, setHidden] = useState(nothingHidden);
    const [fitTurn, setFitTurn] = useState(0);
    const [isMeasuring, setMeasuring] = useState(false);
    const [measured, setMeasured] = useState<Place[]>([]);
    const [shown, setShown] = useState({ scanners: false, landmarks: true, triangle: true });
    const names = report?.views.map((view) => view.name) ?? [];
    const modes: ColourMode[] = surface ? modesOf(surface) : ["plain"];
    // what a person chose is kept where the other surface has it too
    const mode =
        wanted && modes.includes(wanted)
            ? wanted
            : modes.includes("scan")
              ? "scan"
              : modes.includes("view") && kind === "cloud"
                ? "view"
                : "plain";
    const distance =
        measured.length === 2
            ? Math.hypot(...[0, 1, 2].map((axis) => (measured[1]?.[axis] ?? 0) - (measured[0]?.[axis] ?? 0)))
            : undefined;
    const markers: Markers = useMemo(
        () =>
            markersOf({
                names,
                poses: shown.scanners ? poses : undefined,
                found,
                shown,
                marks,
                measured,
                distance: distance === undefined ? undefined : length(distance, model.unit),
            }),
        [poses, found, shown, marks, measured, report],
    );
    const look = useMemo(() => ({ mode, facing, cut, hidden }), [mode, facing, cut, hidden]);
    const measure = (place: Place) => {
        const next = measured.length === 1 ? [...measured, place] : [place];
        setMeasured(next);
        if (next.length === 1) announce(t.viewer.measureNext);
        else
            announce(
                t.viewer.distance(
                    length(
                        Math.hypot(...[0, 1, 2].map((axis) => (next[1]?.[axis] ?? 0) - (next[0]?.[axis] ?? 0))),
                        model.unit,
                    ),
                ),
            );
    };
    if (kinds.length === 0) return <p class="empty panel">{t.model.noSurface}</p>;
    const onPick = isMeasuring ? measure : onMark;
    const axes = (["X", "Y", "Z"] as const).map((axis, index) => [String(index), axis] as const);
    const ups = face ? [["face", t.viewer.upOfFace] as const, ...axes] : axes;
    return (
        <div>
            <div class="tools">
                {kinds.length > 1 && (
                    <Choice
                        label={t.viewer.show}
                        value={kind}
                        choices={kinds.map((name) => [name, t.viewer[name]] as const)}
                        onChange={setKind}
                    />
                )}
                <Choice
                    label={t.viewer.colour}
                    value={mode}
                    choices={modes.map((name) => [name, t.viewer.colours[name]] as const)}
                    onChange={setWanted}
                />
                <Choice label={t.viewer.up} value={up} choices={ups} onChange={setUp} />
                <button type="button" onClick={() => setFitTurn((count) => count + 1)}>
                    {t.viewer.fit}
                </button>
                <button
                    type="button"
                    aria-pressed={isMeasuring}
                    onClick={() => {
                        setMeasuring(!isMeasuring);
                        setMeasured([]);
                    }}
                >
                    {t.viewer.measure}
                </button>
            </div>
            <Viewer
                source={`${model.id}/${kind}`}
                keepsView
                load={(signal, onShare) => fetchSurface(surfaceUrl(model, kind), signal, onShare)}
                look={look}
                markers={markers}
                onLoaded={setSurface}
                onRange={setRange}
                onPick={onPick}
                fitTurn={fitTurn}
            />
            <p class="quiet small row spread">
                <span>{onPick ? t.viewer.pickHint : t.viewer.help}</span>
                {surface && (
                    <span class="number" data-testid="counts">
                        {surface.triangles
                            ? t.viewer.counts(
                                  number(surface.positions.length / 3),
                                  number(surface.triangles.length / 3),
                              )
                            : t.viewer.cloudCounts(number(surface.positions.length / 3))}
                    </span>
                )}
            </p>
            {isMeasuring && (
                <div class="note">
                    <p data-testid="distance">
                        {distance === undefined
                            ? measured.length === 1
                                ? t.viewer.measureNext
                                : t.viewer.measureHelp
                            : t.viewer.distance(length(distance, model.unit))}
                    </p>
                    {model.unit === "unknown" && <p class="small">{t.model.unitNote}</p>}
                </div>
            )}
            {range && (mode === "height" || mode === "support") && (
                <p class="row small">
                    <Scale />{" "}
                    {mode === "height"
                        ? t.viewer.lowHigh(length(range[0], model.unit), length(range[1], model.unit))
                        : t.viewer.lowHigh(figure(range[0]), figure(range[1]))}
                </p>
            )}
            <div class="halves">
                <CutControls cut={cut} onChange={setCut} />
                <fieldset>
                    <legend>{t.viewer.show}</legend>
                    {poses && (
                        <Check
                            label={t.viewer.scanners}
                            isOn={shown.scanners}
                            onChange={(scanners) => setShown({ ...shown, scanners })}
                        />
                    )}
                    {found && (
                        <Check
                            label={t.viewer.landmarks}
                            isOn={shown.landmarks}
                            onChange={(landmarks) => setShown({ ...shown, landmarks })}
                        />
                    )}
                    {found?.triangle && (
                        <Check
                            label={t.viewer.triangle}
                            isOn={shown.triangle}
                            onChange={(triangle) => setShown({ ...shown, triangle })}
                        />
                    )}
                    {kind === "cloud" && surface?.views && names.length > 0 && (
                        <ViewList
                            names={names}
                            hidden={hidden}
                            colourOf={mode === "view" ? (index) => css(viewColour(index)) : undefined}
                            onChange={setHidden}
                        />
                    )}
                    {!poses && !found && kind !== "cloud" && <p class="quiet small">{t.viewer.cloudShows}</p>}
                </fieldset>
            </div>
        </div>
    );
}

/** The colours of a scale, low to high. */
function Scale() {
    return (
        <svg width="120" height="12" aria-hidden="true">
            <defs>
                <linearGradient id="scale">
                    <stop offset="0" stop-color="#440154" />
                    <stop offset=".2" stop-color="#414487" />
                    <stop offset=".4" stop-color="#2a788e" />
                    <stop offset=".6" stop-color="#22a884" />
                    <stop offset=".8" stop-color="#7ad151" />
                    <stop offset="1" stop-color="#fde725" />
                </linearGradient>
            </defs>
            <rect width="120" height="12" rx="3" fill="url(#scale)" />
        </svg>
    );
}
