import type { ComponentChildren } from "preact";
import { useEffect, useId, useRef } from "preact/hooks";

import { ApiError, ConnectionError } from "../api/client";
import { t } from "../texts";

/** The heading of a page: it gets the focus, so that a screen reader reads on from there. */
export function PageTitle({ children, title }: { children?: ComponentChildren; title: string }) {
    const heading = useRef<HTMLHeadingElement>(null);
    useEffect(() => {
        document.title = `${title} · visage`;
    }, [title]);
    useEffect(() => heading.current?.focus({ preventScroll: true }), []);
    return (
        <div class="headline">
            <h1 ref={heading} tabIndex={-1}>
                {title}
            </h1>
            {children && <div class="row">{children}</div>}
        </div>
    );
}

/** What went wrong, and what to do about it. */
export function Trouble({ error }: { error: unknown }) {
    if (error === undefined || error === null) return null;
    if (error instanceof ConnectionError)
        return (
            <div class="note bad" role="alert">
                <p>{t.error.offline}</p>
            </div>
        );
    if (error instanceof ApiError) return <Fault {...error.problem} message={error.problem.detail} />;
    return (
        <div class="note bad" role="alert">
            <p>{error instanceof Error ? error.message : String(error)}</p>
        </div>
    );
}

/** An error as the server words it: of a call or of a job. */
export function Fault(fault: { code: string; message: string; hint: string; scan?: string | null }) {
    return (
        <div class="note bad" role="alert">
            <p>
                <strong>{t.error.title}:</strong> {fault.message}
            </p>
            {fault.hint && (
                <p>
                    <strong>{t.error.whatToDo}:</strong> {fault.hint}
                </p>
            )}
            <p class="small">
                {fault.scan && (
                    <>
                        {t.error.scan}: {fault.scan} ·{" "}
                    </>
                )}
                {t.error.code}: <code>{fault.code}</code>
            </p>
        </div>
    );
}

export function Field(props: {
    label: string;
    help?: string | undefined;
    children: (id: string, help: string | undefined) => ComponentChildren;
}) {
    const id = useId();
    const help = props.help ? `${id}-help` : undefined;
    return (
        <div class="field">
            <label for={id}>{props.label}</label>
            {props.children(id, help)}
            {props.help && (
                <p class="help" id={help}>
                    {props.help}
                </p>
            )}
        </div>
    );
}

/** One file that has to be chosen. */
export function FileField(props: { label: string; help: string; onChoose: (file: File | undefined) => void }) {
    return (
        <Field label={props.label} help={props.help}>
            {(id, help) => (
                <input
                    id={id}
                    aria-describedby={help}
                    type="file"
                    required
                    onChange={(event) => props.onChoose(event.currentTarget.files?.[0])}
                />
            )}
        </Field>
    );
}

export function TextField(props: {
    label: string;
    value: string;
    help?: string;
    required?: boolean;
    pattern?: string;
    type?: "text" | "search";
    list?: string[];
    onInput: (value: string) => void;
}) {
    const list = useId();
    return (
        <Field label={props.label} help={props.help}>
            {(id, help) => (
                <>
                    <input
                        id={id}
                        aria-describedby={help}
                        type={props.type ?? "text"}
                        value={props.value}
                        required={props.required}
                        pattern={props.pattern}
                        list={props.list ? list : undefined}
                        autocomplete="off"
                        onInput={(event) => props.onInput(event.currentTarget.value)}
                    />
                    {props.list && (
                        <datalist id={list}>
                            {props.list.map((item) => (
                                <option key={item} value={item} />
                            ))}
                        </datalist>
                    )}
                </>
            )}
        </Field>
    );
}

export function Choice<T extends string>(props: {
    label: string;
    value: T;
    choices: readonly (readonly [T, string])[];
    help?: string | undefined;
    onChange: (value: T) => void;
}) {
    return (
        <Field label={props.label} help={props.help}>
            {(id, help) => (
                <select
                    id={id}
                    aria-describedby={help}
                    value={props.value}
                    onChange={(event) => props.onChange(event.currentTarget.value as T)}
                >
                    {props.choices.map(([value, text]) => (
                        <option key={value} value={value} selected={value === props.value}>
                            {text}
                        </option>
                    ))}
                </select>
            )}
        </Field>
    );
}

export function Check(props: { label: ComponentChildren; isOn: boolean; onChange: (isOn: boolean) => void }) {
    return (
        <label class="check">
            <input
                type="checkbox"
                checked={props.isOn}
                onChange={(event) => props.onChange(event.currentTarget.checked)}
            />
            <span>{props.label}</span>
        </label>
    );
}

export type Unit = "mm" | "cm" | "m" | "in" | "unknown";
export const unitNames: readonly Unit[] = ["unknown", "mm", "cm", "m", "in"];

export function UnitChoice(props: { value: Unit; help?: string; onChange: (unit: Unit) => void }) {
    return (
        <Choice
            label={t.unit}
            value={props.value}
            help={props.help}
            choices={unitNames.map((unit) => [unit, t.units[unit]] as const)}
            onChange={props.onChange}
        />
    );
}

export function Loading() {
    return (
        <p class="quiet" role="status">
            {t.loading}
        </p>
    );
}

export function Tag({
    kind,
    children,
}: {
    kind?: "good" | "doubt" | "bad" | "busy" | undefined;
    children: ComponentChildren;
}) {
    return <span class={`tag ${kind ?? ""}`}>{children}</span>;
}

const qualityTags = { good: "good", doubtful: "doubt", failed: "bad" } as const;

export function Quality({ quality }: { quality: string | null | undefined }) {
    if (!quality) return null;
    return <Tag kind={qualityTags[quality as keyof typeof qualityTags]}>{t.model.quality[quality] ?? quality}</Tag>;
}
