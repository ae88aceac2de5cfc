import { useEffect, useState } from "preact/hooks";

import { api, ok, type Schema } from "../api/client";
import { announce } from "../lib/announce";
import { go, href } from "../lib/router";
import { useLoad } from "../lib/use-load";
import { useSettled } from "../lib/use-settled";
import { t } from "../texts";
import { Check, Choice, Loading, PageTitle, TextField, Trouble } from "../ui/pieces";
import { AddModel } from "./add-model";
import { Card, type Shown } from "./card";
import { Probe } from "./probe";
import { ask, ofAnswer, type Page, type Question } from "./questions";
import { triangleOf } from "./triangle";

/** All models, and every way to find one. What is asked stands in the address, so that it can be handed on. */
export function Gallery({ query }: { query: URLSearchParams }) {
    const [label, setLabel] = useState("");
    const [text, setText] = useState("");
    const [onlyMatches, setOnlyMatches] = useState(false);
    const [probed, setProbed] = useState<Schema["QueryAnswer"]>();
    const question = questionOf(query);
    const isProbing = query.get("probe") !== null;
    const standards = useLoad(() => ok(api.GET("/v1/standards")), []);
    const key = JSON.stringify(question);
    const settled = useSettled(label);
    const words = useSettled(text).trim();
    const conditions = { label: settled.trim(), text: words, onlyMatches };
    const first = useLoad(
        () => (isProbing ? Promise.resolve(undefined) : ask(question, conditions, undefined)),
        [key, settled, words, onlyMatches, isProbing],
    );
    const [more, setMore] = useState<Page>();
    const [moreError, setMoreError] = useState<unknown>();
    useEffect(() => setMore(undefined), [first.data]);
    const page = isProbing ? probed && ofAnswer(probed) : first.data;
    const shown = [...(page?.models ?? []), ...(more?.models ?? [])];
    const next = more ? more.next : page?.next;
    const isAnswered = isProbing ? probed !== undefined : first.data !== undefined && !first.isLoading;
    useEffect(() => {
        if (isAnswered && (words || question.kind !== "all" || isProbing)) announce(t.gallery.found(shown.length));
    }, [isAnswered, words, key, shown.length]);

    const choices = [
        ["", t.gallery.questions.none] as const,
        ...(standards.data?.items ?? []).map(
            (standard) => [`standard=${encodeURIComponent(standard.name)}`, t.gallery.whichAre(standard.name)] as const,
        ),
        ...(question.kind === "like"
            ? [[`like=${encodeURIComponent(question.id)}`, t.gallery.questions.like] as const]
            : []),
        ...(question.kind === "triangle" ? [[query.toString(), t.gallery.questions.triangle] as const] : []),
        ["probe=", t.gallery.questions.probe] as const,
    ];
    const asked = isProbing ? "probe=" : addressOf(question, query);
    const reload = () => {
        first.reload();
        if (probed) setProbed(undefined);
    };
    const loadMore = () => {
        ask(question, conditions, next).then(
            (answer) => setMore({ ...answer, models: [...(more?.models ?? []), ...answer.models] }),
            setMoreError,
        );
    };
    return (
        <>
            <PageTitle title={t.gallery.title}>
                <a class="button" href={href("evaluation")}>
                    {t.gallery.evaluation}
                </a>
            </PageTitle>
            <p class="quiet">{t.gallery.lead}</p>
            <AddModel onAdded={reload} />
            <search>
                <div class="tools">
                    <Choice
                        label={t.gallery.question}
                        value={asked}
                        choices={choices}
                        onChange={(value) => go(value ? `${href("gallery")}?${value}` : href("gallery"))}
                    />
                    <TextField label={t.gallery.text} type="search" value={text} onInput={setText} />
                    <TextField label={t.label} value={label} onInput={setLabel} list={labelsOf(shown)} />
                    {question.kind !== "all" && (
                        <Check label={t.gallery.onlyMatches} isOn={onlyMatches} onChange={setOnlyMatches} />
                    )}
                    {asked !== "" && (
                        <a class="button" href={href("gallery")}>
                            {t.gallery.clear}
                        </a>
                    )}
                </div>
            </search>
            {question.kind === "like" && <LikeWhat id={question.id} />}
            {isProbing && (
                <Probe
                    standards={standards.data?.items.map((standard) => standard.name) ?? []}
                    conditions={conditions}
                    onAnswer={setProbed}
                />
            )}
            <Trouble error={first.error ?? moreError ?? standards.error} />
            {probed?.verdict && isProbing && (
                <div class={`note ${probed.verdict.is_match ? "good" : ""}`}>
                    <p>{t.gallery.probeIs(probed.verdict.is_match)}</p>
                    {probed.verdict.reason && <p>{probed.verdict.reason.text}</p>}
                </div>
            )}
            {!isAnswered && !isProbing && first.isLoading && !first.data && <Loading />}
            {page && page.pending > 0 && (
                <div class="note doubt">
                    <p>{t.gallery.pending(page.pending)}</p>
                </div>
            )}
            {isAnswered && shown.length === 0 && !probed?.verdict && (
                <p class="empty panel">
                    {question.kind === "all" && !words && !settled && !isProbing ? t.gallery.empty : t.gallery.none}
                </p>
            )}
            <ul class="cards" aria-label={t.gallery.title} aria-busy={!isProbing && first.isLoading}>
                {shown.map((model) => (
                    <Card key={model.id} model={model} onDeleted={reload} />
                ))}
            </ul>
            {next && !isProbing && (
                <div class="row end">
                    <button type="button" onClick={loadMore}>
                        {t.more}
                    </button>
                </div>
            )}
        </>
    );
}

function questionOf(query: URLSearchParams): Question {
    const [standard, id, triangle] = [query.get("standard"), query.get("like"), triangleOf(query)];
    if (id) return { kind: "like", id };
    if (triangle) return { kind: "triangle", triangle };
    return standard ? { kind: "standard", standard } : { kind: "all" };
}

/** What of the address asks the question. */
function addressOf(question: Question, query: URLSearchParams): string {
    switch (question.kind) {
        case "all":
            return "";
        case "standard":
            return `standard=${encodeURIComponent(question.standard)}`;
        case "like":
            return `like=${encodeURIComponent(question.id)}`;
        case "triangle":
            return query.toString();
    }
}

function labelsOf(models: readonly Shown[]): string[] {
    return [...new Set(models.flatMap((model) => (model.label ? [model.label] : [])))].sort();
}

function LikeWhat({ id }: { id: string }) {
    const model = useLoad(() => ok(api.GET("/v1/models/{id}", { params: { path: { id } } })), [id]);
    if (!model.data) return <Trouble error={model.error} />;
    return (
        <p>
            <a href={href("models", id)}>{t.gallery.likeOf(model.data.name)}</a>
        </p>
    );
}
