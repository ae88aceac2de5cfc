import { useState } from "preact/hooks";

import type { Schema } from "../api/client";
import { send } from "../api/upload";
import { at } from "../lib/address";
import { announce } from "../lib/announce";
import { t } from "../texts";
import { FileField, TextField, Trouble, UnitChoice, type Unit } from "../ui/pieces";

/** Puts a finished mesh or cloud into the gallery. */
export function AddModel({ onAdded }: { onAdded: () => void }) {
    const [file, setFile] = useState<File>();
    const [name, setName] = useState("");
    const [label, setLabel] = useState("");
    const [unit, setUnit] = useState<Unit>("unknown");
    const [share, setShare] = useState<number>();
    const [error, setError] = useState<unknown>();
    const [added, setAdded] = useState<string>();
    const add = async (event: Event) => {
        event.preventDefault();
        if (!file) return;
        setError(undefined);
        setAdded(undefined);
        setShare(0);
        const form = new FormData();
        form.append("model", file, file.name);
        form.append("unit", unit);
        if (name.trim()) form.append("name", name.trim());
        if (label.trim()) form.append("label", label.trim());
        try {
            const model = await send<Schema["Model"]>({
                method: "POST",
                url: at("/v1/models"),
                body: form,
                onProgress: (sent) => setShare(Math.min(1, sent / file.size)),
            });
            setAdded(model.name);
            announce(t.gallery.added(model.name));
            setName("");
            onAdded();
        } catch (fault) {
            setError(fault);
        } finally {
            setShare(undefined);
        }
    };
    return (
        <details class="panel">
            <summary>{t.gallery.add}</summary>
            <form class="stack" onSubmit={add}>
                <div class="form-grid">
                    <FileField label={t.gallery.addFile} help={t.gallery.addHelp} onChoose={setFile} />
                    <TextField label={`${t.name} (${t.optional})`} value={name} onInput={setName} />
                    <TextField
                        label={`${t.label} (${t.optional})`}
                        help={t.labelHelp}
                        value={label}
                        onInput={setLabel}
                    />
                    <UnitChoice value={unit} onChange={setUnit} />
                </div>
                <Trouble error={error} />
                {share !== undefined && <progress aria-label={t.upload.progress} max={1} value={share} />}
                {added && (
                    <div class="note good">
                        <p>{t.gallery.added(added)}</p>
                    </div>
                )}
                <button type="submit" class="main" disabled={share !== undefined}>
                    {share === undefined ? t.gallery.add : t.gallery.adding}
                </button>
            </form>
        </details>
    );
}
