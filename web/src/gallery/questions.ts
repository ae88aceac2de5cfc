import { api, everything, ok, type Schema } from "../api/client";
import type { Shown } from "./card";

/** What is asked of the gallery. */
export type Question = { kind: "all" } | { kind: "standard"; standard: string } | { kind: "like"; id: string };

export interface Page {
    models: Shown[];
    next: string | undefined;
    pending: number;
}

export interface Conditions {
    label: string;
    onlyMatches: boolean;
}

const pageSize = 60;

/** A page of the answer. */
export async function ask(
    question: Question,
    { label, onlyMatches }: Conditions,
    cursor: string | undefined,
): Promise<Page> {
    if (question.kind === "all") {
        const query = { limit: pageSize, ...(cursor && { cursor }), ...(label && { label }) };
        const answer = await ok(api.GET("/v1/models", { params: { query } }));
        return { models: answer.items.map(ofSummary), next: answer.next_cursor ?? undefined, pending: 0 };
    }
    const about = question.kind === "standard" ? { standard: question.standard } : { model_id: question.id };
    const body = {
        ...about,
        limit: pageSize,
        only_matches: onlyMatches,
        ...(cursor && { cursor }),
        ...(label && { filter: { labels: [label] } }),
    };
    return ofAnswer(await ok(api.POST("/v1/queries", { body })));
}

export function ofAnswer(answer: Schema["QueryAnswer"]): Page {
    return { models: answer.matches.map(ofMatch), next: answer.next_cursor ?? undefined, pending: answer.pending };
}

function ofSummary(model: Schema["ModelSummary"]): Shown {
    return { id: model.id, name: model.name, label: model.label, points: model.points, quality: model.quality };
}

function ofMatch(match: Schema["Match"]): Shown {
    return {
        id: match.model_id,
        name: match.name,
        label: match.label,
        score: match.score,
        isMatch: match.is_match,
        reason: match.reason?.text,
    };
}

/** All models, for a search by text: the interface itself searches by label and by look. */
export function allModels(): Promise<Shown[]> {
    return everything((cursor) =>
        ok(api.GET("/v1/models", { params: { query: { limit: 100, ...(cursor && { cursor }) } } })),
    ).then((models) => models.map(ofSummary));
}

/** Whether every word of the text stands in the name or the label. */
export function fits(model: Pick<Shown, "name" | "label">, text: string): boolean {
    const where = `${model.name} ${model.label ?? ""}`.toLocaleLowerCase();
    return text
        .toLocaleLowerCase()
        .split(/\s+/)
        .every((word) => where.includes(word));
}
