import { useState } from "preact/hooks";

import { api, ok } from "../api/client";
import { at } from "../lib/address";
import { number, score } from "../lib/format";
import { href } from "../lib/router";
import { t } from "../texts";
import { DeleteButton } from "../ui/confirm";
import { Quality, Tag } from "../ui/pieces";

/** A model as it is shown in the gallery, from a list or as an answer. */
export interface Shown {
    id: string;
    name: string;
    label?: string | null | undefined;
    points?: number;
    quality?: string | null | undefined;
    score?: number;
    isMatch?: boolean;
    reason?: string | undefined;
}

export function Card({ model, onDeleted }: { model: Shown; onDeleted: () => void }) {
    return (
        <li class="card">
            <a class="thumb" href={href("models", model.id)} tabIndex={-1} aria-hidden="true">
                <Thumbnail id={model.id} />
            </a>
            <div class="body">
                <a href={href("models", model.id)}>{model.name}</a>
                <div class="row">
                    {model.isMatch !== undefined && (
                        <Tag kind={model.isMatch ? "good" : undefined}>
                            {model.isMatch ? t.gallery.card.match : t.gallery.card.noMatch}
                        </Tag>
                    )}
                    {model.score !== undefined && (
                        <span class="quiet small number">{t.gallery.card.score(score(model.score))}</span>
                    )}
                    <Quality quality={model.quality} />
                    {model.label && <span class="quiet small">{model.label}</span>}
                </div>
                {model.points !== undefined && (
                    <span class="quiet small number">
                        {number(model.points)} {t.points}
                    </span>
                )}
                {model.reason && <span class="quiet small">{model.reason}</span>}
                <div class="actions">
                    <a
                        class="button small-button"
                        href={`${href("gallery")}?like=${encodeURIComponent(model.id)}`}
                        aria-label={`${t.gallery.card.like}: ${model.name}`}
                    >
                        {t.gallery.card.like}
                    </a>
                    <DeleteButton
                        name={model.name}
                        consequence={t.confirm.model}
                        goesToBin
                        label={`${t.remove}: ${model.name}`}
                        className="bare"
                        onConfirm={() => ok(api.DELETE("/v1/models/{id}", { params: { path: { id: model.id } } }))}
                        onDone={onDeleted}
                    />
                </div>
            </div>
        </li>
    );
}

/** The picture that the server makes; where there is none, a sign that stands for a model. */
function Thumbnail({ id }: { id: string }) {
    const [isMissing, setMissing] = useState(false);
    if (!isMissing) {
        return (
            <img
                src={at(`/v1/models/${encodeURIComponent(id)}/pictures/thumbnail`)}
                alt=""
                width={256}
                height={192}
                loading="lazy"
                onError={() => setMissing(true)}
            />
        );
    }
    return (
        <svg viewBox="0 0 48 48" fill="none" stroke="currentColor" stroke-width="1.6" stroke-linejoin="round">
            <path d="M24 5l17 9.5v19L24 43 7 33.500v-19zM7 14.500L24 24l17-9.500M24 24v19" />
        </svg>
    );
}
