import { useState } from "preact/hooks";

import { api, everything, ok, type Schema } from "../api/client";
import { announce } from "../lib/announce";
import { figure, number } from "../lib/format";
import { href } from "../lib/router";
import { useLoad } from "../lib/use-load";
import { t } from "../texts";
import { DeleteButton } from "../ui/confirm";
import { Loading, PageTitle, Tag, Trouble } from "../ui/pieces";

type Own = Schema["Standard"];

/** What models are compared with. */
export function StandardsPage() {
    const standards = useLoad(() => ok(api.GET("/v1/standards")), []);
    return (
        <>
            <PageTitle title={t.standards.title} />
            <p class="quiet">{t.standards.lead}</p>
            <Trouble error={standards.error} />
            {!standards.data && standards.isLoading && <Loading />}
            {standards.data?.items.map((standard) =>
                "landmarks" in standard ? (
                    <OwnStandard key={standard.name} standard={standard} onChange={standards.reload} />
                ) : (
                    <section class="panel" key={standard.name}>
                        <div class="row spread">
                            <h2 class="row">
                                {standard.name} <Tag>{t.standards.builtIn}</Tag>
                            </h2>
                            <Ask name={standard.name} />
                        </div>
                        <p class="quiet">
                            {t.standards.landmarks}: {standard.corners.join(", ")}
                        </p>
                    </section>
                ),
            )}
        </>
    );
}

function Ask({ name }: { name: string }) {
    return (
        <a
            class="button"
            href={`${href("gallery")}?standard=${encodeURIComponent(name)}`}
            aria-label={`${t.standards.ask} ${name}`}
        >
            {t.standards.ask}
        </a>
    );
}

function OwnStandard({ standard, onChange }: { standard: Own; onChange: () => void }) {
    const [isMarking, setMarking] = useState(false);
    const { threshold } = standard;
    return (
        <section class="panel">
            <div class="row spread">
                <h2 class="row">
                    {standard.name} <Tag>{t.standards.own}</Tag>
                </h2>
                <div class="row">
                    <Ask name={standard.name} />
                    <DeleteButton
                        name={standard.name}
                        consequence={t.confirm.standard}
                        label={`${t.remove}: ${standard.name}`}
                        onConfirm={() =>
                            ok(api.DELETE("/v1/standards/{name}", { params: { path: { name: standard.name } } }))
                        }
                        onDone={onChange}
                    />
                </div>
            </div>
            <p class="quiet">
                {t.standards.landmarks}: {Object.keys(standard.landmarks).join(", ")}
            </p>
            <p>
                {t.standards.threshold(
                    figure(threshold.limit_mm),
                    t.standards.restsOn[threshold.rests_on] ?? threshold.rests_on,
                )}
            </p>
            <p class="quiet small">
                {t.standards.judged}: {number(standard.judged)} · {t.standards.pending}: {number(standard.pending)}
            </p>
            <details onToggle={(event) => setMarking(event.currentTarget.open)}>
                <summary>{t.standards.examples}</summary>
                {isMarking && <Examples standard={standard} onChange={onChange} />}
            </details>
        </section>
    );
}

type Mark = "yes" | "no" | "open";

/** Which stored models are of the class: the threshold moves with them. */
function Examples({ standard, onChange }: { standard: Own; onChange: () => void }) {
    const models = useLoad(
        () =>
            everything(
                (cursor) => ok(api.GET("/v1/models", { params: { query: { limit: 100, ...(cursor && { cursor }) } } })),
                500,
            ),
        [],
    );
    const [marks, setMarks] = useState<Record<string, Mark>>(() => ({
        ...Object.fromEntries((standard.examples.positive ?? []).map((id) => [id, "yes" as const])),
        ...Object.fromEntries((standard.examples.negative ?? []).map((id) => [id, "no" as const])),
    }));
    const [error, setError] = useState<unknown>();
    const save = async (event: Event) => {
        event.preventDefault();
        setError(undefined);
        const of = (mark: Mark) =>
            Object.entries(marks)
                .filter(([, value]) => value === mark)
                .map(([id]) => id);
        try {
            await ok(
                api.PUT("/v1/standards/{name}/examples", {
                    params: { path: { name: standard.name } },
                    body: { positive: of("yes"), negative: of("no") },
                }),
            );
            announce(t.standards.saved);
            onChange();
        } catch (fault) {
            setError(fault);
        }
    };
    if (!models.data) return models.isLoading ? <Loading /> : <Trouble error={models.error} />;
    return (
        <form class="stack" onSubmit={save}>
            <p class="quiet">{t.standards.examplesHelp}</p>
            <ul class="plain">
                {models.data.map((model) => (
                    <li class="row spread" key={model.id}>
                        <a href={href("models", model.id)}>{model.name}</a>
                        <select
                            aria-label={`${standard.name}: ${model.name}`}
                            value={marks[model.id] ?? "open"}
                            onChange={(event) => setMarks({ ...marks, [model.id]: event.currentTarget.value as Mark })}
                        >
                            {(["open", "yes", "no"] as const).map((mark) => (
                                <option key={mark} value={mark} selected={mark === (marks[model.id] ?? "open")}>
                                    {t.standards[mark]}
                                </option>
                            ))}
                        </select>
                    </li>
                ))}
            </ul>
            <Trouble error={error} />
            <button type="submit" class="main">
                {t.save}
            </button>
        </form>
    );
}
