import { useState } from "preact/hooks";

import { api, ok, type Schema } from "../api/client";
import { date } from "../lib/format";
import { useLoad } from "../lib/use-load";
import { useSettled } from "../lib/use-settled";
import { t } from "../texts";
import { Choice, TextField, Trouble } from "../ui/pieces";

interface Props {
    label: string;
    value: string;
    /** Which of the models can be chosen. */
    isFit?: (model: Schema["ModelSummary"]) => boolean;
    onChange: (id: string) => void;
}

const most = 100;

/** One of the stored models: the newest to choose from, others by their names. */
export function ModelPicker({ label, value, isFit = () => true, onChange }: Props) {
    const [text, setText] = useState("");
    const words = useSettled(text).trim();
    const listed = useLoad(
        () => ok(api.GET("/v1/models", { params: { query: { limit: most, ...(words && { text: words }) } } })),
        [words],
    );
    // the one that is chosen stands in the list, however old it is
    const chosen = useLoad(
        () =>
            value ? ok(api.GET("/v1/models/{id}", { params: { path: { id: value } } })) : Promise.resolve(undefined),
        [value],
    );
    const fitting = listed.data?.items.filter(isFit) ?? [];
    const own = chosen.data && value === chosen.data.id && !fitting.some(({ id }) => id === value) ? [chosen.data] : [];
    const choices = [
        ["", t.picker.none] as const,
        ...[...own, ...fitting].map(
            ({ id, name, created_at }) => [id, t.picker.model(name, date(created_at))] as const,
        ),
    ];
    const hasMore = Boolean(listed.data?.next_cursor) || words !== "";
    return (
        <div class="stack">
            <Choice label={label} value={value} choices={choices} onChange={onChange} />
            {hasMore && <TextField label={t.picker.find(label)} type="search" value={text} onInput={setText} />}
            <Trouble error={listed.error ?? chosen.error} />
        </div>
    );
}
