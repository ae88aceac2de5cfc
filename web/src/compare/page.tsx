import { useMemo, useState } from "preact/hooks";

import { api, ok, type Schema } from "../api/client";
import { go, href } from "../lib/router";
import { useLoad } from "../lib/use-load";
import { CutControls } from "../model/cut-controls";
import { compareAddress } from "../model/deviation";
import { ModelPicker } from "../model/model-picker";
import { has } from "../model/sources";
import { t } from "../texts";
import { Check, Choice, PageTitle, Trouble } from "../ui/pieces";
import type { ColourMode } from "../viewer/colours";
import { byAxis } from "../viewer/facing";
import { CameraLink } from "../viewer/link";
import type { Cut } from "../viewer/scene";
import { joined, type Bounds } from "../viewer/surface";
import { FactTable } from "./facts";
import { Side } from "./side";

type Model = Schema["Model"];

const modes: readonly ColourMode[] = ["plain", "scan", "view", "support", "height", "saliency", "deviation"];

/** Two models beside each other, seen from the same side. Which they are stands in the address, so that it can be handed on. */
export function ComparePage({ query }: { query: URLSearchParams }) {
    const [a, b] = [query.get("a") ?? "", query.get("b") ?? ""];
    const first = useModel(a);
    const second = useModel(b);
    const models = [first.data, second.data] as const;
    const [one, other] = models;
    const choose = (next: { a?: string; b?: string }) => go(compareAddress(next.a ?? a, next.b ?? b));
    return (
        <>
            <PageTitle title={t.compare.title} />
            <p class="quiet">{t.compare.lead}</p>
            <div class="halves">
                <ModelPicker label={t.compare.first} value={a} onChange={(id) => choose({ a: id })} />
                <ModelPicker label={t.compare.second} value={b} onChange={(id) => choose({ b: id })} />
            </div>
            <Trouble error={first.error ?? second.error} />
            {one && other ? (
                <Both key={`${one.id} ${other.id}`} models={[one, other]} />
            ) : (
                <p class="empty panel">{t.compare.choose}</p>
            )}
        </>
    );
}

function useModel(id: string) {
    const { data, error } = useLoad(
        () => (id ? ok(api.GET("/v1/models/{id}", { params: { path: { id } } })) : Promise.resolve(undefined)),
        [id],
    );
    return { data: data?.id === id ? data : undefined, error };
}

function Both({ models }: { models: readonly [Model, Model] }) {
    const [one, other] = models;
    // runs of the same scans have the world of their first scan
    const [isOneFrame, setOneFrame] = useState(one.scan_set_id != null && one.scan_set_id === other.scan_set_id);
    const link = useMemo(() => new CameraLink(isOneFrame), [isOneFrame]);
    const hasBoth = (kind: "mesh" | "cloud") => models.every((model) => has(model, kind));
    const kinds = (["mesh", "cloud"] as const).filter(hasBoth);
    const [kind, setKind] = useState(kinds[0]);
    const [mode, setMode] = useState<ColourMode>("plain");
    const [up, setUp] = useState("1");
    const [fitTurn, setFitTurn] = useState(0);
    const [cut, setCut] = useState<Cut>();
    const [bounds, setBounds] = useState<readonly (Bounds | undefined)[]>([undefined, undefined]);
    // in one frame it is one plane that cuts both; else each is cut at the same share of its own size
    const across = isOneFrame && bounds[0] && bounds[1] ? joined(bounds[0], bounds[1]) : undefined;
    const facing = byAxis[Number(up)] ?? byAxis[1];
    // to measure distances the unit and the frame have to be the same
    const offered = modes.filter((name) => name !== "deviation" || (isOneFrame && one.unit === other.unit));
    const shownMode = offered.includes(mode) ? mode : "plain";
    return (
        <>
            <div class="tools">
                {kinds.length > 1 && kind && (
                    <Choice
                        label={t.viewer.show}
                        value={kind}
                        choices={kinds.map((name) => [name, t.viewer[name]] as const)}
                        onChange={setKind}
                    />
                )}
                <Choice
                    label={t.viewer.colour}
                    value={shownMode}
                    choices={offered.map((name) => [name, t.viewer.colours[name]] as const)}
                    onChange={setMode}
                />
                <Choice
                    label={t.viewer.up}
                    value={up}
                    choices={(["X", "Y", "Z"] as const).map((axis, index) => [String(index), axis] as const)}
                    onChange={setUp}
                />
                <button type="button" onClick={() => setFitTurn((count) => count + 1)}>
                    {t.viewer.fit}
                </button>
                <Check label={t.compare.oneFrame} isOn={isOneFrame} onChange={setOneFrame} />
            </div>
            <div class="halves">
                {models.map((model, index) => (
                    <Side
                        key={model.id}
                        model={model}
                        title={index === 0 ? t.compare.first : t.compare.second}
                        kind={kind}
                        wanted={shownMode}
                        other={models[1 - index]?.id ?? ""}
                        facing={facing}
                        cut={cut}
                        across={across}
                        onBounds={(own) => setBounds((known) => known.map((it, at) => (at === index ? own : it)))}
                        link={link}
                        fitTurn={fitTurn}
                    />
                ))}
            </div>
            <CutControls cut={cut} onChange={setCut} across={across} unit={one.unit} />
            <section class="panel">
                <FactTable models={models} />
                {isOneFrame && one.unit === other.unit && (
                    <a href={`${href("models", one.id)}?${new URLSearchParams({ reference: other.id })}`}>
                        {t.compare.deviation}
                    </a>
                )}
            </section>
        </>
    );
}
