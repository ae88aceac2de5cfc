import { api, ok, type Schema } from "../api/client";
import { length } from "../lib/format";
import { t } from "../texts";
import type { Shown } from "./card";
import type { Triangle } from "./triangle";

/** What is asked of the gallery. */
export type Question =
    | { kind: "all" }
    | { kind: "standard"; standard: string }
    | { kind: "like"; id: string }
    | { kind: "triangle"; triangle: Triangle };

export interface Page {
    models: Shown[];
    next: string | undefined;
    pending: number;
}

export interface Conditions {
    label: string;
    /** Words of the name or the label. */
    text: string;
    onlyMatches: boolean;
}

const pageSize = 60;

/** A page of the answer. */
export async function ask(
    question: Question,
    { label, text, onlyMatches }: Conditions,
    cursor: string | undefined,
): Promise<Page> {
    if (question.kind === "all") {
        const query = { limit: pageSize, ...(cursor && { cursor }), ...(label && { label }), ...(text && { text }) };
        const answer = await ok(api.GET("/v1/models", { params: { query } }));
        return { models: answer.items.map(ofSummary), next: answer.next_cursor ?? undefined, pending: 0 };
    }
    const body = {
        ...about(question),
        limit: pageSize,
        only_matches: onlyMatches,
        ...(cursor && { cursor }),
        ...filterOf({ label, text }),
    };
    return ofAnswer(await ok(api.POST("/v1/queries", { body })), question.kind === "triangle");
}

/** What narrows an answer, as the server takes it; nothing if nothing does. */
export function filterOf({ label, text }: Pick<Conditions, "label" | "text">): { filter?: Schema["Filter"] } {
    return label || text ? { filter: { ...(label && { labels: [label] }), ...(text && { text }) } } : {};
}

function about(question: Exclude<Question, { kind: "all" }>) {
    if (question.kind === "standard") return { standard: question.standard };
    return question.kind === "like" ? { model_id: question.id } : { triangle: question.triangle };
}

export function ofAnswer(answer: Schema["QueryAnswer"], tellsError = false): Page {
    const models = answer.matches.map((match) => ({
        ...ofMatch(match),
        ...(tellsError && { reason: errorOf(match) }),
    }));
    return { models, next: answer.next_cursor ?? undefined, pending: answer.pending };
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

/** How far the best triangle of the model is from the one that was asked about. */
function errorOf({ matching_error_mm: error }: Schema["Match"]): string | undefined {
    return error === null || error === undefined ? undefined : t.gallery.card.error(length(error, "mm"));
}
