import { useMemo, useState } from "preact/hooks";

import type { Schema } from "../api/client";
import { t } from "../texts";
import { Check, Choice } from "../ui/pieces";
import { css, modesOf, viewColour, type ColourMode } from "../viewer/colours";
import { byAxis, ofFace } from "../viewer/facing";
import { fetchSurface } from "../viewer/load";
import type { Markers, Place } from "../viewer/marker-types";
import type { Overlay } from "../viewer/overlay";
import type { Cut, Pick } from "../viewer/scene";
import { movedByView } from "../viewer/start";
import { boundsOf, type Bounds, type Surface } from "../viewer/surface";
import { Viewer } from "../viewer/viewer";
import { Counts } from "./counts";
import { CutControls } from "./cut-controls";
import { Deviation } from "./deviation";
import { Legend } from "./legend";
import { modeOf } from "./look-modes";
import { markersOf, type Found } from "./marker-list";
import { MeasureNote, useMeasuring } from "./measuring";
import { ShownControls } from "./shown-controls";
import { has, isMeasured, measuredUrl, surfaceUrl, type Kind, type Matrix, type Report } from "./sources";
import { ViewList } from "./view-list";

interface Props {
    model: Schema["Model"];
    report: Report | undefined;
    poses: Record<string, Matrix | null> | undefined;
    found: Found | undefined;
    /** Places that are being picked, closed to a triangle where they are one. */
    marks: readonly [string, Place][];
    isTriangle: boolean;
    onPick: ((pick: Pick) => void) | undefined;
    overlay: Overlay | undefined;
    /** The model that it is compared with at first. */
    reference: string;
}

const nothingHidden: ReadonlySet<number> = new Set();

/** The surface of a model with all that can be asked of it. */
export function ModelViewer({ model, report, poses, found, marks, isTriangle, overlay, ...props }: Props) {
    const kinds = (["mesh", "cloud"] as const).filter((kind) => has(model, kind));
    const [kind, setKind] = useState<Kind>(kinds[0] ?? "cloud");
    const [surface, setSurface] = useState<Surface>();
    const [ownModes, setOwnModes] = useState<ColourMode[]>(["plain"]);
    const [reference, setReference] = useState(props.reference);
    const [wanted, setWanted] = useState<ColourMode | undefined>(props.reference ? "deviation" : undefined);
    const [range, setRange] = useState<[number, number]>();
    const face = useMemo(() => found && ofFace(found.landmarks), [found]);
    const [up, setUp] = useState(face ? "face" : "1");
    const facing = up === "face" && face ? face : (byAxis[Number(up)] ?? byAxis[1]);
    const [cut, setCut] = useState<Cut>();
    const [hidden, setHidden] = useState(nothingHidden);
    const [bounds, setBounds] = useState<Bounds>();
    const [isAtStart, setAtStart] = useState(false);
    const [fitTurn, setFitTurn] = useState(0);
    const measuring = useMeasuring(model.unit);
    const [shown, setShown] = useState({ scanners: false, landmarks: true, triangle: true });
    const names = report?.views.map((view) => view.name) ?? [];
    // what is measured comes with a surface of its own; a deviation has to be from something
    const measured = wanted && isMeasured(wanted) && (wanted === "saliency" || reference) ? wanted : undefined;
    const mode = measured ?? modeOf(wanted, ownModes, kind);
    const markers: Markers = useMemo(
        () =>
            markersOf({
                names,
                poses: shown.scanners ? poses : undefined,
                found,
                shown,
                marks,
                isTriangle,
                measured: measuring.places,
                distance: measuring.text,
            }),
        [poses, found, shown, marks, isTriangle, measuring.places, report],
    );
    // a plane stays where it is when scans are shown where they began
    const look = useMemo(
        () => ({ mode, facing, cut: cut && { ...cut, across: bounds }, hidden }),
        [mode, facing, cut, bounds, hidden],
    );
    const starts = report?.views.map((view) => view.start_from_final) ?? [];
    const hasStarts = kind === "cloud" && !measured && starts.some((start) => start);
    const showsStarts = hasStarts && isAtStart;
    if (kinds.length === 0) return <p class="empty panel">{t.model.noSurface}</p>;
    const onPick = measuring.isOn ? ({ place }: Pick) => measuring.pick(place) : props.onPick;
    const axes = (["X", "Y", "Z"] as const).map((axis, index) => [String(index), axis] as const);
    const ups = face ? [["face", t.viewer.upOfFace] as const, ...axes] : axes;
    const modes: ColourMode[] = [...ownModes, "saliency", "deviation"];
    const url = measured ? measuredUrl(model, measured, reference) : surfaceUrl(model, kind);
    return (
        <div>
            <div class="tools">
                {kinds.length > 1 && !measured && (
                    <Choice
                        label={t.viewer.show}
                        value={kind}
                        choices={kinds.map((name) => [name, t.viewer[name]] as const)}
                        onChange={setKind}
                    />
                )}
                <Choice
                    label={t.viewer.colour}
                    value={wanted === "deviation" ? wanted : mode}
                    choices={modes.map((name) => [name, t.viewer.colours[name]] as const)}
                    onChange={setWanted}
                />
                <Choice label={t.viewer.up} value={up} choices={ups} onChange={setUp} />
                <button type="button" onClick={() => setFitTurn((count) => count + 1)}>
                    {t.viewer.fit}
                </button>
                <button type="button" aria-pressed={measuring.isOn} onClick={measuring.toggle}>
                    {t.viewer.measure}
                </button>
            </div>
            <Viewer
                source={showsStarts ? `${url}#start` : url}
                keepsView
                load={async (signal, onShare) => {
                    const loaded = await fetchSurface(url, signal, onShare);
                    return showsStarts ? movedByView(loaded, starts) : loaded;
                }}
                look={look}
                markers={markers}
                overlay={overlay}
                onLoaded={(loaded) => {
                    setSurface(loaded);
                    if (!showsStarts) setBounds(boundsOf(loaded));
                    if (!measured) setOwnModes(modesOf(loaded));
                }}
                onRange={setRange}
                onPick={onPick}
                fitTurn={fitTurn}
            />
            <p class="quiet small row spread">
                <span>{onPick ? t.viewer.pickHint : t.viewer.help}</span>
                {surface && <Counts surface={surface} />}
            </p>
            {measuring.isOn && <MeasureNote measuring={measuring} unit={model.unit} />}
            {range && <Legend mode={mode} range={range} unit={model.unit} />}
            {wanted === "deviation" && <Deviation model={model} reference={reference} onReference={setReference} />}
            <div class="halves">
                <CutControls cut={cut} onChange={setCut} across={bounds} unit={model.unit} />
                <fieldset>
                    <legend>{t.viewer.show}</legend>
                    <ShownControls
                        has={{
                            scanners: poses !== undefined,
                            landmarks: found !== undefined,
                            triangle: found?.triangle !== undefined,
                        }}
                        shown={shown}
                        onChange={setShown}
                    />
                    {hasStarts && (
                        <Check
                            label={t.viewer.atStart}
                            isOn={isAtStart}
                            onChange={(isOn) => {
                                setAtStart(isOn);
                                if (isOn) setWanted("view");
                            }}
                        />
                    )}
                    {kind === "cloud" && !measured && surface?.views && names.length > 0 && (
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
