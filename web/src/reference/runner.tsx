import { useState } from "preact/hooks";

import { at } from "../lib/address";
import { bytes } from "../lib/format";
import { t } from "../texts";
import { Choice, Field, Trouble } from "../ui/pieces";
import { addressOf, curl, exampleBodies, isSafe, type Call, type Contract } from "./contract";

interface Outcome {
    status: string;
    text: string;
}

/** More of an answer is not shown. */
const mostShown = 20_000;

/** A call with its parameters, as a command and to be run here. */
export function Runner({ contract, call }: { contract: Contract; call: Call }) {
    const [type, media] = Object.entries(call.requestBody?.content ?? {})[0] ?? [];
    const isJson = type === "application/json";
    const [values, setValues] = useState<Record<string, string>>({});
    const [examples] = useState(() => (isJson && media ? exampleBodies(contract, media) : []));
    const [body, setBody] = useState(examples[0]?.[1]);
    const [outcome, setOutcome] = useState<Outcome>();
    const [error, setError] = useState<unknown>();
    const [isBusy, setBusy] = useState(false);
    const inputs = (call.parameters ?? []).filter((parameter) => parameter.in !== "header");
    const isStream = Object.keys(call.responses["200"]?.content ?? {}).includes("text/event-stream");
    const canRun = (type === undefined || isJson) && !isStream;
    const run = async (event: Event) => {
        event.preventDefault();
        setBusy(true);
        setError(undefined);
        try {
            const init: RequestInit = {
                method: call.method.toUpperCase(),
                ...(body !== undefined && { body, headers: { "content-type": "application/json" } }),
            };
            setOutcome(await outcomeOf(await fetch(at(addressOf(call, values)), init)));
        } catch (fault) {
            setError(fault);
        } finally {
            setBusy(false);
        }
    };
    return (
        <form class="stack" onSubmit={run}>
            {inputs.length > 0 && (
                <div class="form-grid">
                    {inputs.map((parameter) => (
                        <Field key={parameter.name} label={parameter.name} help={parameter.description}>
                            {(id, help) => (
                                <input
                                    id={id}
                                    aria-describedby={help}
                                    value={values[parameter.name] ?? ""}
                                    required={parameter.required ?? false}
                                    autocomplete="off"
                                    placeholder={parameter.example === undefined ? "" : String(parameter.example)}
                                    onInput={(event) =>
                                        setValues({ ...values, [parameter.name]: event.currentTarget.value })
                                    }
                                />
                            )}
                        </Field>
                    ))}
                </div>
            )}
            {examples.length > 1 && (
                <Choice
                    label={t.reference.examples}
                    value={examples.find(([, text]) => text === body)?.[0] ?? ""}
                    choices={examples.map(([name]) => [name, name] as const)}
                    onChange={(name) => setBody(examples.find(([other]) => other === name)?.[1])}
                />
            )}
            {body !== undefined && (
                <Field label={t.reference.body}>
                    {(id) => (
                        <textarea
                            id={id}
                            rows={Math.min(12, body.split("\n").length + 1)}
                            value={body}
                            spellcheck={false}
                            onInput={(event) => setBody(event.currentTarget.value)}
                        />
                    )}
                </Field>
            )}
            <div>
                <span class="label">{t.reference.example}</span>
                <pre tabIndex={0}>{curl(contract, call, values, body, location.origin + at("").slice(0, -1))}</pre>
            </div>
            {!canRun && !isStream && <p class="quiet small">{t.reference.files}</p>}
            {canRun && (
                <div class="row">
                    <button
                        type="submit"
                        class={isSafe(call) ? "main" : "risky"}
                        disabled={isBusy}
                        aria-label={`${t.reference.run}: ${call.operationId}`}
                    >
                        {isBusy ? t.reference.running : t.reference.run}
                    </button>
                    {!isSafe(call) && <span class="quiet small">{t.reference.changes}</span>}
                </div>
            )}
            <Trouble error={error} />
            {outcome && (
                <div role="status">
                    <span class="label">
                        {t.reference.answer}: {outcome.status}
                    </span>
                    <pre class="answer" tabIndex={0}>
                        {outcome.text}
                    </pre>
                </div>
            )}
        </form>
    );
}

async function outcomeOf(response: Response): Promise<Outcome> {
    const status = `${response.status} ${response.statusText}`;
    const type = response.headers.get("content-type") ?? "";
    if (!/json|text|xml|yaml/.test(type)) {
        const size = (await response.blob()).size;
        return { status, text: type === "" ? "" : t.reference.binary(type, bytes(size)) };
    }
    const raw = await response.text();
    const text = type.includes("json") ? pretty(raw) : raw;
    return { status, text: text.length > mostShown ? `${text.slice(0, mostShown)}\n${t.reference.cut}` : text };
}

function pretty(text: string): string {
    try {
        return JSON.stringify(JSON.parse(text), null, 2);
    } catch {
        return text;
    }
}
