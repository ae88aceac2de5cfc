import { useEffect, useMemo, useState } from "preact/hooks";

import { api, ok, type Schema } from "../api/client";
import { announce } from "../lib/announce";
import { date, number } from "../lib/format";
import { go, href } from "../lib/router";
import { useLoad } from "../lib/use-load";
import { t } from "../texts";
import { DeleteButton } from "../ui/confirm";
import { Loading, PageTitle, Trouble } from "../ui/pieces";
import type { Overlay } from "../viewer/overlay";
import type { Pick } from "../viewer/scene";
import { compareAddress } from "./deviation";
import { Downloads } from "./downloads";
import type { Found } from "./marker-list";
import { ModelViewer } from "./model-viewer";
import { SeveralPlaces } from "./several-places";
import { has, reportOf, type Matrix } from "./sources";
import { StandardMaker, type Mark } from "./standard-maker";
import { TriangleAsker } from "./triangle-asker";
import { VerdictPanel } from "./verdict";

/** One model: its surface, what is to be thought of it, and its files. */
export function ModelPage({ id, query }: { id: string; query: URLSearchParams }) {
    const {
        data: model,
        error,
        isLoading,
    } = useLoad(() => ok(api.GET("/v1/models/{id}", { params: { path: { id } } })), [id]);
    if (!model)
        return isLoading ? (
            <Loading />
        ) : (
            <>
                <PageTitle title={t.gallery.title} />
                <Trouble error={error} />
            </>
        );
    return <Shown model={model} reference={query.get("reference") ?? ""} />;
}

function Shown({ model, reference }: { model: Schema["Model"]; reference: string }) {
    const report = useMemo(() => reportOf(model), [model]);
    const poses = usePoses(model);
    const found = useMemo(() => foundOn(model), [model]);
    const [picking, setPicking] = useState<"marks" | "triangle">();
    const [marks, setMarks] = useState<Mark[]>([]);
    const [corners, setCorners] = useState<Pick[]>([]);
    const [overlay, setOverlay] = useState<Overlay>();
    const mark = ({ place }: Pick) => {
        // a name that was removed is free again
        let count = 1;
        while (marks.some(([name]) => name === t.marks.nameOf(count))) count += 1;
        const name = t.marks.nameOf(count);
        setMarks([...marks, [name, place]]);
        announce(t.marks.picked(name));
    };
    const corner = (pick: Pick) => {
        // a fourth begins another triangle
        const next = corners.length < 3 ? [...corners, pick] : [pick];
        setCorners(next);
        announce(t.marks.picked(t.triangle.corner(next.length)));
    };
    const isTriangle = picking === "triangle" || (picking === undefined && marks.length === 0);
    const shownMarks = useMemo(
        () => (isTriangle ? corners.map(({ place }, index): Mark => [t.triangle.corner(index + 1), place]) : marks),
        [isTriangle, corners, marks],
    );
    const pick = { marks: mark, triangle: corner };
    const toggle = (what: "marks" | "triangle") => (isOn: boolean) => setPicking(isOn ? what : undefined);
    return (
        <>
            <PageTitle title={model.name}>
                <a class="button" href={`${href("gallery")}?like=${encodeURIComponent(model.id)}`}>
                    {t.model.like}
                </a>
                <a class="button" href={compareAddress(model.id, reference)}>
                    {t.compare.with}
                </a>
                <DeleteButton
                    name={model.name}
                    consequence={t.confirm.model}
                    goesToBin
                    onConfirm={() => ok(api.DELETE("/v1/models/{id}", { params: { path: { id: model.id } } }))}
                    onDone={() => go(href("gallery"))}
                />
            </PageTitle>
            <div class="columns">
                <div>
                    <ModelViewer
                        model={model}
                        report={report}
                        poses={poses}
                        found={found}
                        marks={shownMarks}
                        isTriangle={isTriangle}
                        onPick={picking && pick[picking]}
                        overlay={overlay}
                        reference={reference}
                    />
                    {report && poses && report.alternatives.length > 0 && (
                        <SeveralPlaces model={model} report={report} poses={poses} onOverlay={setOverlay} />
                    )}
                    <TriangleAsker
                        unit={model.unit}
                        isPicking={picking === "triangle"}
                        picks={corners}
                        onPicking={toggle("triangle")}
                        onPicks={setCorners}
                    />
                    <StandardMaker
                        model={model}
                        isMarking={picking === "marks"}
                        marks={marks}
                        onMarking={toggle("marks")}
                        onMarks={setMarks}
                    />
                </div>
                <div>
                    <VerdictPanel model={model} report={report} />
                    <section class="panel">
                        <h2>{t.model.facts}</h2>
                        <dl class="facts">
                            <dt>{t.points}</dt>
                            <dd class="number">{number(model.points)}</dd>
                            <dt>{t.unit}</dt>
                            <dd>{model.unit === "unknown" ? t.units.unknown : model.unit}</dd>
                            {model.label && (
                                <>
                                    <dt>{t.label}</dt>
                                    <dd>{model.label}</dd>
                                </>
                            )}
                            <dt>{t.created}</dt>
                            <dd>{date(model.created_at)}</dd>
                        </dl>
                        <div class="row">
                            {model.job_id && <a href={href("jobs", model.job_id)}>{t.model.openJob}</a>}
                            {model.scan_set_id && <a href={href("scan-sets", model.scan_set_id)}>{t.model.openSet}</a>}
                        </div>
                    </section>
                    <Downloads model={model} />
                </div>
            </div>
        </>
    );
}

/** Where each scan is, if the model was made of some. */
function usePoses(model: Schema["Model"]): Record<string, Matrix | null> | undefined {
    const [poses, setPoses] = useState<Record<string, Matrix | null>>();
    useEffect(() => {
        if (!has(model, "poses")) return;
        // a model without its poses is shown all the same
        ok(api.GET("/v1/models/{id}/poses.json", { params: { path: { id: model.id } } })).then(
            setPoses,
            () => undefined,
        );
    }, [model]);
    return poses;
}

/** The first class of which the model is one: the face, as a rule. */
function foundOn(model: Schema["Model"]): Found | undefined {
    const verdict = model.verdicts.find((verdict) => verdict.is_match && verdict.landmarks);
    return verdict?.landmarks ? { landmarks: verdict.landmarks, triangle: verdict.triangle ?? undefined } : undefined;
}
