import { useEffect, useRef, useState } from "preact/hooks";

import { announce } from "../lib/announce";
import { percent } from "../lib/format";
import { t } from "../texts";
import { Trouble } from "../ui/pieces";
import type { ColourMode } from "./colours";
import type { Facing } from "./facing";
import type { CameraLink } from "./link";
import { noMarkers, type Markers } from "./marker-types";
import type { Overlay } from "./overlay";
import type { Cut, IsDropped, Label, Pick, Stage } from "./scene";
import type { Surface } from "./surface";

export interface Look {
    mode: ColourMode;
    facing: Facing;
    cut?: Cut | undefined;
    hidden: ReadonlySet<number>;
    /** What is marked as left out. */
    isDropped?: IsDropped | undefined;
}

interface Props {
    /** What is loaded; another value loads anew. */
    source: string;
    load: (signal: AbortSignal, onShare: (share: number) => void) => Promise<Surface>;
    look: Look;
    markers?: Markers;
    /** The points of a scan that are shown beside it. */
    overlay?: Overlay | undefined;
    /** Viewers that look from the same side. */
    link?: CameraLink | undefined;
    /** Whether the view stays when another source is loaded: both are in one frame. */
    keepsView?: boolean;
    label?: string;
    onLoaded?: (surface: Surface) => void;
    onRange?: (range: [number, number] | undefined) => void;
    /** Called with a place that was picked; the cross in the middle shows where the keyboard picks. */
    onPick?: ((pick: Pick) => void) | undefined;
    /** Changes when all shall be shown again. */
    fitTurn?: number;
}

/** A pointer that moved less than this has clicked. */
const clickReach = 5;
const step = Math.PI / 24;

/** Draws a surface. three.js comes with the first one. */
export function Viewer(props: Props) {
    const { source, look, markers = noMarkers, overlay, link } = props;
    const canvas = useRef<HTMLCanvasElement>(null);
    const [stage, setStage] = useState<Stage>();
    const [surface, setSurface] = useState<Surface>();
    const [share, setShare] = useState(0);
    const [error, setError] = useState<unknown>();
    const [isWithout3d, setWithout3d] = useState(false);
    const [labels, setLabels] = useState<Label[]>([]);
    const down = useRef<[number, number]>([Infinity, Infinity]);
    const hasShown = useRef(false);

    useEffect(() => {
        let made: Stage | undefined;
        let isGone = false;
        import("./scene").then(({ Stage }) => {
            if (isGone || !canvas.current) return;
            try {
                made = new Stage(canvas.current);
                made.onLabels = setLabels;
                setStage(made);
            } catch {
                setWithout3d(true);
            }
        }, setError);
        return () => {
            isGone = true;
            made?.dispose();
        };
    }, []);
    useEffect(() => {
        const controller = new AbortController();
        setError(undefined);
        setSurface(undefined);
        setShare(0);
        props.load(controller.signal, setShare).then(
            (loaded) => {
                if (controller.signal.aborted) return;
                setSurface(loaded);
                props.onLoaded?.(loaded);
            },
            (fault: unknown) => controller.signal.aborted || setError(fault),
        );
        return () => controller.abort();
    }, [source]);
    useEffect(() => {
        if (!stage || !surface) return;
        stage.show(surface, look.mode, look.facing, hasShown.current && props.keepsView === true);
        hasShown.current = true;
    }, [stage, surface]);
    useEffect(() => {
        if (stage && surface) props.onRange?.(stage.paint(look.mode, look.facing.axis, look.isDropped));
    }, [stage, surface, look.mode, look.facing.axis, look.isDropped]);
    useEffect(() => {
        if (!stage || !surface || !link) return;
        link.join(stage);
        stage.onView = (view) => link.moved(stage, view);
        return () => {
            stage.onView = () => undefined;
            link.leave(stage);
        };
    }, [stage, surface, link]);
    useEffect(() => stage?.setOverlay(surface && overlay), [stage, surface, overlay]);
    useEffect(() => stage?.setCut(look.cut), [stage, surface, look.cut]);
    useEffect(() => stage?.showViews(look.hidden), [stage, surface, look.hidden]);
    useEffect(() => stage?.setMarkers(markers), [stage, surface, markers]);
    useEffect(() => {
        if (stage && surface && hasShown.current) stage.fit(look.facing);
    }, [stage, look.facing, props.fitTurn]);

    const pick = (x: number, y: number) => {
        if (!stage || !props.onPick) return;
        const found = stage.pick(x, y);
        if (found) props.onPick(found);
        else announce(t.viewer.nothingThere);
    };
    const onKey = (event: KeyboardEvent) => {
        if (!stage || event.ctrlKey || event.metaKey || event.altKey) return;
        if (
            !press(stage, event, look.facing, () =>
                pick((canvas.current?.clientWidth ?? 0) / 2, (canvas.current?.clientHeight ?? 0) / 2),
            )
        )
            return;
        event.preventDefault();
    };
    return (
        <div class="viewer">
            <canvas
                ref={canvas}
                tabIndex={0}
                role="application"
                aria-label={props.label ?? t.viewer.label}
                data-ready={stage && surface ? "yes" : "no"}
                onKeyDown={onKey}
                onPointerDown={(event) => (down.current = [event.offsetX, event.offsetY])}
                onPointerUp={(event) => {
                    const [x, y] = down.current;
                    if (event.button === 0 && Math.hypot(event.offsetX - x, event.offsetY - y) < clickReach)
                        pick(event.offsetX, event.offsetY);
                }}
            />
            {labels.map(({ text, x, y, isCovered }) => (
                <span
                    key={text}
                    class={`spot ${isCovered ? "covered" : ""}`}
                    style={{ left: `${x}px`, top: `${y}px` }}
                    aria-hidden="true"
                >
                    {text}
                </span>
            ))}
            {props.onPick && (
                <svg class="cross" viewBox="0 0 21 21" aria-hidden="true">
                    <path d="M10.5 1v7M10.5 13v7M1 10.5h7M13 10.5h7" stroke="currentColor" stroke-width="2" />
                </svg>
            )}
            {(isWithout3d || error !== undefined) && (
                <div class="busy">
                    <div>{isWithout3d ? <p class="note doubt">{t.viewer.noWebgl}</p> : <Trouble error={error} />}</div>
                </div>
            )}
            {!surface && error === undefined && (
                <div class="busy" role="status">
                    {t.viewer.loadingModel(share > 0 ? percent(share) : "…")}
                </div>
            )}
        </div>
    );
}

/** What the keys do; false for those that mean nothing here. */
function press(stage: Stage, event: KeyboardEvent, facing: Facing, pick: () => void): boolean {
    const arrows: Record<string, [number, number]> = {
        ArrowLeft: [-1, 0],
        ArrowRight: [1, 0],
        ArrowUp: [0, 1],
        ArrowDown: [0, -1],
    };
    const arrow = arrows[event.key];
    if (arrow) {
        const [right, upward] = arrow;
        if (event.shiftKey) stage.pan(right * 0.06, upward * 0.06);
        else stage.turn(right * step, -upward * step);
        return true;
    }
    if (event.key === "+" || event.key === "=") stage.zoom(0.87);
    else if (event.key === "-") stage.zoom(1.15);
    else if (event.key === "f" || event.key === "F") stage.fit(facing);
    else if (event.key === "Enter" || event.key === " ") pick();
    else return false;
    return true;
}
