import { number } from "../lib/format";
import { t } from "../texts";
import { Field } from "../ui/pieces";
import { invalid, type Entered, type OptionInfo } from "./option-values";

interface Props {
    options: readonly OptionInfo[];
    entered: Entered;
    scans: readonly string[];
    onChange: (entered: Entered) => void;
}

/** The options of a job as the server describes them: a new one appears here by itself. */
export function OptionsForm({ options, entered, scans, onChange }: Props) {
    const wrong = invalid(options, entered);
    return (
        <div class="form-grid">
            {options.map((option) => (
                <Field key={option.name} label={option.name} help={helpOf(option)}>
                    {(id, help) => (
                        <Control
                            id={id}
                            help={help}
                            option={option}
                            value={entered[option.name]}
                            isWrong={wrong.includes(option.name)}
                            scans={scans}
                            onChange={(text) => onChange({ ...entered, [option.name]: text })}
                        />
                    )}
                </Field>
            ))}
        </div>
    );
}

function shown(value: unknown): string {
    if (value === null || value === undefined) return t.options.byData;
    if (typeof value === "boolean") return value ? t.options.yes : t.options.no;
    return String(value);
}

function helpOf(option: OptionInfo): string {
    const range =
        typeof option.minimum === "number" && typeof option.maximum === "number"
            ? [t.options.range(number(option.minimum, 6), number(option.maximum, 6))]
            : [];
    const point = option.type === "array" ? [t.options.point] : [];
    return [option.help, ...range, ...point].join(" · ");
}

function Control(props: {
    id: string;
    help: string | undefined;
    option: OptionInfo;
    value: string | undefined;
    isWrong: boolean;
    scans: readonly string[];
    onChange: (text: string) => void;
}) {
    const { id, help, option } = props;
    const asItComes = option.default === null ? t.options.byData : t.options.defaultIs(shown(option.default));
    const choices = option.type === "boolean" ? ["true", "false"] : option.choices?.map(String);
    if (choices) {
        const value = props.value ?? String(option.default);
        return (
            <select
                id={id}
                aria-describedby={help}
                value={value}
                onChange={(event) => props.onChange(event.currentTarget.value)}
            >
                {choices.map((choice) => (
                    <option key={choice} value={choice} selected={choice === value}>
                        {option.type === "boolean" ? shown(choice === "true") : choice}
                    </option>
                ))}
            </select>
        );
    }
    // `reference` names a scan; any other text is free
    const list = option.name === "reference" ? `${id}-scans` : undefined;
    return (
        <>
            <input
                id={id}
                aria-describedby={help}
                aria-invalid={props.isWrong}
                value={props.value ?? ""}
                placeholder={asItComes}
                list={list}
                autocomplete="off"
                inputMode={option.type === "number" || option.type === "integer" ? "decimal" : "text"}
                onInput={(event) => props.onChange(event.currentTarget.value)}
            />
            {list && (
                <datalist id={list}>
                    {props.scans.map((name) => (
                        <option key={name} value={name} />
                    ))}
                </datalist>
            )}
        </>
    );
}
