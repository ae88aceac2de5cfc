import { useState } from "preact/hooks";

import { api, ok, type Schema } from "../api/client";
import { go, href } from "../lib/router";
import { t } from "../texts";
import { TextField, Trouble } from "../ui/pieces";
import { changed, enteredOf, invalid } from "./option-values";
import { OptionsForm } from "./options-form";

interface Props {
    info: Schema["Info"];
    set: Pick<Schema["ScanSet"], "id" | "scans">;
    /** Whether this set had no job before. */
    isFirst?: boolean | undefined;
    /** The job that it is to be like. */
    like?: Schema["Job"];
    hints?: Schema["Hints"];
    /** What has to be done before the job is sent. */
    prepare?: () => Promise<void>;
    text?: string;
}

/** Starts a registration with the options that a person wants. */
export function StartJob({ info, set, isFirst, like, hints, prepare, text }: Props) {
    const options = info.job_options;
    const [entered, setEntered] = useState(() => enteredOf(options, (like?.options ?? {}) as Record<string, unknown>));
    const [label, setLabel] = useState(like?.label ?? "");
    const [error, setError] = useState<unknown>();
    const [isBusy, setBusy] = useState(false);
    const isInvalid = invalid(options, entered).length > 0;
    const start = async (event: Event) => {
        event.preventDefault();
        setBusy(true);
        setError(undefined);
        const given = hints ?? like?.hints ?? null;
        const body = {
            scan_set_id: set.id,
            options: changed(options, entered) as Schema["JobOptions"],
            ...(label.trim() ? { label: label.trim() } : {}),
            ...(given ? { hints: given } : {}),
            ...(like?.base_model_id ? { base_model_id: like.base_model_id } : {}),
        };
        try {
            await prepare?.();
            const job = await ok(api.POST("/v1/jobs", { body }));
            go(href("jobs", job.id));
        } catch (fault) {
            setError(fault);
            setBusy(false);
        }
    };
    return (
        <form class="stack" onSubmit={start}>
            <details open={like !== undefined}>
                <summary>
                    {t.options.title}{" "}
                    <span class="quiet small">
                        ({t.options.changed(Object.keys(changed(options, entered)).length)})
                    </span>
                </summary>
                <div class="stack">
                    <TextField
                        label={`${t.label} (${t.optional})`}
                        help={t.labelHelp}
                        value={label}
                        onInput={setLabel}
                    />
                    <OptionsForm
                        options={options}
                        entered={entered}
                        scans={set.scans.map((scan) => scan.name)}
                        onChange={setEntered}
                    />
                </div>
            </details>
            <Trouble error={error} />
            {isInvalid && (
                <div class="note doubt" role="alert">
                    <p>{t.options.invalid}</p>
                </div>
            )}
            <button type="submit" class="main" disabled={isBusy || isInvalid}>
                {text ?? (isFirst === false ? t.set.startAgain : t.set.start)}
            </button>
        </form>
    );
}
