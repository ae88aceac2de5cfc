import { useState } from "preact/hooks";

import { api, ok, type Schema } from "../api/client";
import { send } from "../api/upload";
import { at } from "../lib/address";
import { announce } from "../lib/announce";
import { href } from "../lib/router";
import { t } from "../texts";
import { TextField, Trouble } from "../ui/pieces";
import type { Place } from "../viewer/marker-types";
import { has, surfaceUrl } from "./sources";

/** A place with a name. */
export type Mark = [string, Place];

interface Props {
    model: Schema["Model"];
    isMarking: boolean;
    marks: Mark[];
    onMarking: (isMarking: boolean) => void;
    onMarks: (marks: Mark[]) => void;
}

const least = 3;

/** Makes a class of the model and of places that a person picks on it. */
export function StandardMaker({ model, isMarking, marks, onMarking, onMarks }: Props) {
    const [name, setName] = useState("");
    const [error, setError] = useState<unknown>();
    const [isBusy, setBusy] = useState(false);
    const [saved, setSaved] = useState<string>();
    const names = marks.map(([mark]) => mark.trim());
    const isReady = marks.length >= least && new Set(names).size === names.length && names.every((mark) => mark !== "");
    const save = async (event: Event) => {
        event.preventDefault();
        setBusy(true);
        setError(undefined);
        try {
            const blob = await surfaceOf(model);
            const form = new FormData();
            form.append("model", blob, "model.ply");
            form.append("name", name.trim());
            form.append("unit", model.unit);
            form.append("landmarks", JSON.stringify(Object.fromEntries(marks.map(([mark, at]) => [mark.trim(), at]))));
            // the model itself is one
            form.append("positive", JSON.stringify([model.id]));
            const standard = await send<Schema["Standard"]>({ method: "POST", url: at("/v1/standards"), body: form });
            setSaved(standard.name);
            announce(t.marks.saved(standard.name));
            onMarks([]);
            onMarking(false);
            setName("");
        } catch (fault) {
            setError(fault);
        } finally {
            setBusy(false);
        }
    };
    const rename = (index: number, text: string) =>
        onMarks(marks.map(([mark, at], other) => (other === index ? [text, at] : [mark, at])));
    return (
        <section class="panel stack">
            <h2>{t.marks.title}</h2>
            <p class="quiet">{t.marks.lead}</p>
            <button type="button" aria-pressed={isMarking} onClick={() => onMarking(!isMarking)}>
                {isMarking ? t.marks.stop : t.marks.start}
            </button>
            {saved && (
                <div class="note good">
                    <p>
                        {t.marks.saved(saved)} <a href={href("standards")}>{t.nav.standards}</a>
                    </p>
                </div>
            )}
            {marks.length > 0 && (
                <form class="stack" onSubmit={save}>
                    <ul class="plain">
                        {marks.map(([mark, at], index) => (
                            <li class="row" key={at.join()}>
                                <input
                                    aria-label={t.marks.nameOf(index + 1)}
                                    value={mark}
                                    required
                                    onInput={(event) => rename(index, event.currentTarget.value)}
                                />
                                <button
                                    type="button"
                                    class="bare"
                                    aria-label={t.marks.remove(mark)}
                                    onClick={() => onMarks(marks.filter((_, other) => other !== index))}
                                >
                                    {t.remove}
                                </button>
                            </li>
                        ))}
                    </ul>
                    {marks.length < least && <p class="quiet">{t.marks.needed(least - marks.length)}</p>}
                    <TextField
                        label={t.marks.standardName}
                        help={t.marks.standardHelp}
                        value={name}
                        pattern="[A-Za-z0-9_\-]+"
                        required
                        onInput={setName}
                    />
                    <Trouble error={error} />
                    <button type="submit" class="main" disabled={!isReady || isBusy}>
                        {isBusy ? t.marks.sending : t.marks.save}
                    </button>
                </form>
            )}
        </section>
    );
}

/** The surface as the server has it: what was picked is in its coordinates. */
async function surfaceOf(model: Schema["Model"]): Promise<Blob> {
    const kind = has(model, "mesh") ? "mesh" : "cloud";
    const response = await fetch(surfaceUrl(model, kind));
    if (!response.ok) await ok(api.GET("/v1/models/{id}", { params: { path: { id: model.id } } }));
    return response.blob();
}
