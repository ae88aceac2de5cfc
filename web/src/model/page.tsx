import { useEffect, useMemo, useState } from "preact/hooks";

import { api, ok, type Schema } from "../api/client";
import { announce } from "../lib/announce";
import { date, number } from "../lib/format";
import { go, href } from "../lib/router";
import { useLoad } from "../lib/use-load";
import { t } from "../texts";
import { DeleteButton } from "../ui/confirm";
import { Loading, PageTitle, Trouble } from "../ui/pieces";
import type { Place } from "../viewer/marker-types";
import { Downloads } from "./downloads";
import { StandardMaker } from "./standard-maker";
import { ModelViewer } from "./model-viewer";
import type { Found } from "./marker-list";
import { has, reportOf, type Matrix } from "./sources";
import { VerdictPanel } from "./verdict";

/** One model: its surface, what is to be thought of it, and its files. */
export function ModelPage({ id }: { id: string }) {
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
    return <Shown model={model} />;
}

function Shown({ model }: { model: Schema["Model"] }) {
    const report = useMemo(() => reportOf(model), [model]);
    const poses = usePoses(model);
    const found = useMemo(() => foundOn(model), [model]);
    const [isMarking, setMarking] = useState(false);
    const [marks, setMarks] = useState<[string, Place][]>([]);
    const mark = (place: Place) => {
        // a name that was removed is free again
        let count = 1;
        while (marks.some(([name]) => name === t.marks.nameOf(count))) count += 1;
        const name = t.marks.nameOf(count);
        setMarks([...marks, [name, place]]);
        announce(t.marks.picked(name));
    };
    return (
        <>
            <PageTitle title={model.name}>
                <a class="button" href={`${href("gallery")}?like=${encodeURIComponent(model.id)}`}>
                    {t.model.like}
                </a>
                <DeleteButton
                    name={model.name}
                    consequence={t.confirm.model}
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
                        marks={marks}
                        onMark={isMarking ? mark : undefined}
                    />
                    <StandardMaker
                        model={model}
                        isMarking={isMarking}
                        marks={marks}
                        onMarking={setMarking}
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
