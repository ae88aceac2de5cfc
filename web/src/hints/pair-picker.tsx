import { useMemo, useState } from "preact/hooks";

import type { Schema } from "../api/client";
import { announce } from "../lib/announce";
import { without } from "../lib/without";
import { t } from "../texts";
import { Choice } from "../ui/pieces";
import type { Place } from "../viewer/marker-types";
import { ScanView } from "./scan-view";

/** Fewer pairs leave the motion open. */
const leastPairs = 3;

interface Props {
    set: Schema["ScanSet"];
    onPoints: (points: Schema["PickedPoints"]) => void;
    onOverlap: (a: string, b: string) => void;
}

/** Two scans side by side, in which the same places are picked in turn. */
export function PairPicker({ set, onPoints, onOverlap }: Props) {
    const names = set.scans.map((scan) => scan.name);
    const [a, setA] = useState(names[0] ?? "");
    const [b, setB] = useState(names[1] ?? "");
    const [pairs, setPairs] = useState<[Place, Place][]>([]);
    const [first, setFirst] = useState<Place>();
    const inA = useMemo(() => [...pairs.map(([place]) => place), ...(first ? [first] : [])], [pairs, first]);
    const inB = useMemo(() => pairs.map(([, place]) => place), [pairs]);
    const choices = names.map((name) => [name, name] as const);
    const choose = (setScan: (name: string) => void) => (name: string) => {
        // places belong to the scans that they were picked in
        setPairs([]);
        setFirst(undefined);
        setScan(name);
    };
    const pickA = (place: Place) => {
        setFirst(place);
        announce(t.hints.pickSecond);
    };
    const pickB = (place: Place) => {
        if (!first) {
            announce(t.hints.pickFirst);
            return;
        }
        setPairs([...pairs, [first, place]]);
        setFirst(undefined);
        announce(t.hints.pair(pairs.length + 1));
    };
    const keep = () => {
        onPoints({ a, b, pairs: pairs.map((pair) => pair.map((place) => [...place])) });
        setPairs([]);
    };
    const isSame = a === b;
    return (
        <section class="stack" aria-label={t.hints.pairs}>
            <div class="halves">
                <Choice label={t.hints.first} value={a} choices={choices} onChange={choose(setA)} />
                <Choice label={t.hints.second} value={b} choices={choices} onChange={choose(setB)} />
            </div>
            {isSame && (
                <div class="note doubt">
                    <p>{t.hints.same}</p>
                </div>
            )}
            {!isSame && (
                <>
                    <div class="halves">
                        <ScanView key={`a/${a}`} set={set.id} scan={a} places={inA} onPick={pickA} />
                        <ScanView key={`b/${b}`} set={set.id} scan={b} places={inB} onPick={pickB} />
                    </div>
                    <div class="panel stack">
                        <p>
                            <strong>{first ? t.hints.pickSecond : t.hints.pickFirst}</strong>{" "}
                            <span class="quiet small">{t.viewer.pickHint}</span>
                        </p>
                        {pairs.length === 0 && !first && <p class="quiet">{t.hints.pairsNone}</p>}
                        <ol class="row">
                            {pairs.map((pair, index) => (
                                <li key={pair.join()}>
                                    <button
                                        type="button"
                                        aria-label={t.hints.removePair(index + 1)}
                                        onClick={() => setPairs(without(pairs, index))}
                                    >
                                        {t.hints.pair(index + 1)} ×
                                    </button>
                                </li>
                            ))}
                        </ol>
                        {pairs.length > 0 && pairs.length < leastPairs && <p class="quiet">{t.hints.three}</p>}
                        <div class="row">
                            <button type="button" class="main" disabled={pairs.length < leastPairs} onClick={keep}>
                                {t.hints.keep}
                            </button>
                            <button type="button" onClick={() => onOverlap(a, b)}>
                                {t.hints.overlap}
                            </button>
                        </div>
                    </div>
                </>
            )}
        </section>
    );
}
