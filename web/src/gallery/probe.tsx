import { useState } from "preact/hooks";

import type { Schema } from "../api/client";
import { send } from "../api/upload";
import { t } from "../texts";
import { Choice, FileField, Trouble, UnitChoice, type Unit } from "../ui/pieces";
import { at } from "../lib/address";

/** Asks about a file that is not stored: which models are like it, or whether it is of a class. */
export function Probe({
    standards,
    onAnswer,
}: {
    standards: readonly string[];
    onAnswer: (answer: Schema["QueryAnswer"] | undefined) => void;
}) {
    const [file, setFile] = useState<File>();
    const [unit, setUnit] = useState<Unit>("unknown");
    const [standard, setStandard] = useState("");
    const [error, setError] = useState<unknown>();
    const [isBusy, setBusy] = useState(false);
    const ask = async (event: Event) => {
        event.preventDefault();
        if (!file) return;
        setBusy(true);
        setError(undefined);
        onAnswer(undefined);
        const form = new FormData();
        form.append("probe", file, file.name);
        form.append("unit", unit);
        if (standard) form.append("standard", standard);
        else form.append("limit", "100");
        try {
            onAnswer(await send<Schema["QueryAnswer"]>({ method: "POST", url: at("/v1/queries/probe"), body: form }));
        } catch (fault) {
            setError(fault);
        } finally {
            setBusy(false);
        }
    };
    const choices = [
        ["", t.gallery.questions.probe] as const,
        ...standards.map((name) => [name, t.gallery.isItOf(name)] as const),
    ];
    return (
        <form class="panel stack" onSubmit={ask}>
            <div class="form-grid">
                <FileField label={t.gallery.probe} help={t.gallery.probeHelp} onChoose={setFile} />
                <UnitChoice value={unit} onChange={setUnit} />
                <Choice label={t.gallery.question} value={standard} choices={choices} onChange={setStandard} />
            </div>
            <Trouble error={error} />
            <button type="submit" class="main" disabled={isBusy}>
                {isBusy ? t.loading : t.gallery.probeAsk}
            </button>
        </form>
    );
}
