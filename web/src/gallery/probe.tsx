import { useEffect, useRef, useState } from "preact/hooks";

import type { Schema } from "../api/client";
import { send } from "../api/upload";
import { t } from "../texts";
import { Choice, FileField, Trouble, UnitChoice, type Unit } from "../ui/pieces";
import { at } from "../lib/address";
import { filterOf, type Conditions } from "./questions";

/** Asks about a file that is not stored: which models are like it, or whether it is of a class. */
export function Probe({
    standards,
    conditions,
    onAnswer,
}: {
    standards: readonly string[];
    /** What narrows the answer: when it changes, what was asked is asked again. */
    conditions: Pick<Conditions, "label" | "text">;
    onAnswer: (answer: Schema["QueryAnswer"] | undefined) => void;
}) {
    const [file, setFile] = useState<File>();
    const [unit, setUnit] = useState<Unit>("unknown");
    const [standard, setStandard] = useState("");
    const [error, setError] = useState<unknown>();
    const [isBusy, setBusy] = useState(false);
    const turn = useRef(0);
    const hasAsked = useRef(false);
    const { filter } = filterOf(conditions);
    const narrowed = JSON.stringify(filter);
    useEffect(() => {
        if (hasAsked.current && !standard) void ask();
    }, [narrowed]);
    const ask = async () => {
        if (!file) return;
        const own = (turn.current += 1);
        hasAsked.current = true;
        setBusy(true);
        setError(undefined);
        onAnswer(undefined);
        const form = new FormData();
        form.append("probe", file, file.name);
        form.append("unit", unit);
        if (standard) form.append("standard", standard);
        else form.append("limit", "100");
        if (narrowed && !standard) form.append("filter", narrowed);
        try {
            const url = at("/v1/queries/probe");
            const answer = await send<Schema["QueryAnswer"]>({ method: "POST", url, body: form });
            // of several that are under way the last one counts
            if (own === turn.current) onAnswer(answer);
        } catch (fault) {
            if (own === turn.current) setError(fault);
        } finally {
            if (own === turn.current) setBusy(false);
        }
    };
    const choices = [
        ["", t.gallery.questions.probe] as const,
        ...standards.map((name) => [name, t.gallery.isItOf(name)] as const),
    ];
    return (
        <form
            class="panel stack"
            onSubmit={(event) => {
                event.preventDefault();
                void ask();
            }}
        >
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
