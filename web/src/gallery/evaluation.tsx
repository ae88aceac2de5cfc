import { useState } from "preact/hooks";

import { api, ok } from "../api/client";
import { at } from "../lib/address";
import { number, percent } from "../lib/format";
import { useLoad } from "../lib/use-load";
import { t } from "../texts";
import { Choice, Loading, PageTitle, TextField, Trouble } from "../ui/pieces";

/** How well the answers agree with the labels. */
export function EvaluationPage() {
    const standards = useLoad(() => ok(api.GET("/v1/standards")), []);
    const [standard, setStandard] = useState("face");
    const [label, setLabel] = useState("");
    // it costs as much as hundreds of queries: it is done when somebody asks for it
    const [asked, setAsked] = useState<{ standard: string; label: string }>();
    const query = asked && { standard: asked.standard, ...(asked.label && { label: asked.label }) };
    const answer = useLoad(
        () => (query ? ok(api.GET("/v1/gallery/evaluation", { params: { query } })) : Promise.resolve(undefined)),
        [asked],
    );
    const names = standards.data?.items.map((item) => item.name) ?? ["face"];
    const ask = (event: Event) => {
        event.preventDefault();
        setAsked({ standard, label: label.trim() });
    };
    const { verdicts, rankings } = answer.data ?? {};
    return (
        <>
            <PageTitle title={t.evaluation.title} />
            <p class="quiet">{t.evaluation.lead}</p>
            <form class="tools" onSubmit={ask}>
                <Choice
                    label={t.evaluation.standard}
                    value={standard}
                    choices={names.map((name) => [name, name] as const)}
                    onChange={setStandard}
                />
                <TextField label={`${t.evaluation.label} (${t.optional})`} value={label} onInput={setLabel} />
                <button type="submit" class="main" disabled={answer.isLoading}>
                    {answer.isLoading ? t.evaluation.running : t.evaluation.ask}
                </button>
            </form>
            {answer.isLoading && <Loading />}
            <Trouble error={answer.error} />
            {query && answer.data && !answer.error && (
                <div class="halves">
                    <div class="panel">
                        <img
                            class="plot"
                            src={at(`/v1/gallery/evaluation.svg?${new URLSearchParams(query)}`)}
                            alt={t.evaluation.roc}
                        />
                    </div>
                    <div>
                        {verdicts && (
                            <section class="panel">
                                <h2>{verdicts.standard}</h2>
                                <dl class="facts number">
                                    <dt>{t.evaluation.auc}</dt>
                                    <dd>{number(verdicts.auc, 3)}</dd>
                                    <dt>{t.evaluation.interval}</dt>
                                    <dd>{verdicts.auc_interval.map((value) => number(value, 3)).join(" – ")}</dd>
                                    <dt>{t.evaluation.eer}</dt>
                                    <dd>{percent(verdicts.equal_error_rate)}</dd>
                                    <dt>{t.evaluation.accuracy}</dt>
                                    <dd>{percent(verdicts.best_accuracy)}</dd>
                                    <dt>{t.evaluation.counts}</dt>
                                    <dd>
                                        {number(verdicts.positives)}, {number(verdicts.negatives)}
                                    </dd>
                                </dl>
                            </section>
                        )}
                        {rankings && (
                            <section class="panel">
                                <h2>{t.evaluation.rankings}</h2>
                                <dl class="facts number">
                                    <dt>{t.evaluation.probes}</dt>
                                    <dd>{number(rankings.probes)}</dd>
                                    <dt>{t.evaluation.nearest}</dt>
                                    <dd>{percent(rankings.nearest_neighbour)}</dd>
                                    <dt>{t.evaluation.first}</dt>
                                    <dd>{percent(rankings.first_tier)}</dd>
                                    <dt>{t.evaluation.second}</dt>
                                    <dd>{percent(rankings.second_tier)}</dd>
                                    <dt>{t.evaluation.dcg}</dt>
                                    <dd>{number(rankings.discounted_cumulative_gain, 3)}</dd>
                                    <dt>{t.evaluation.map}</dt>
                                    <dd>{number(rankings.mean_average_precision, 3)}</dd>
                                </dl>
                            </section>
                        )}
                    </div>
                </div>
            )}
        </>
    );
}
