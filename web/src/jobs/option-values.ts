import type { Schema } from "../api/client";

export type OptionInfo = Schema["OptionInfo"];
/** What a person has entered, as text, by option; what is not here stays as it comes. */
export type Entered = Record<string, string>;

/** The value that was entered, `undefined` for one that can't be read or is out of its range. */
export function valueOf(option: OptionInfo, text: string): unknown {
    if (option.choices) return option.choices.includes(text) ? text : undefined;
    if (option.type === "boolean") return text === "true";
    if (option.type === "string") return text === "" ? undefined : text;
    if (option.type === "array") {
        const numbers = text
            .split(/[\s,;]+/)
            .filter((part) => part !== "")
            .map(Number);
        return numbers.length === 3 && numbers.every(Number.isFinite) ? numbers : undefined;
    }
    const number = Number(text.replace(",", "."));
    if (text.trim() === "" || !Number.isFinite(number) || (option.type === "integer" && !Number.isInteger(number)))
        return undefined;
    const isInside = number >= (option.minimum ?? -Infinity) && number <= (option.maximum ?? Infinity);
    return isInside ? number : undefined;
}

/** The options that differ from what they are by default. */
export function changed(options: readonly OptionInfo[], entered: Entered): Record<string, unknown> {
    const rows = options.flatMap((option) => {
        const text = entered[option.name];
        const value = text === undefined ? undefined : valueOf(option, text);
        return value === undefined || JSON.stringify(value) === JSON.stringify(option.default)
            ? []
            : [[option.name, value] as const];
    });
    return Object.fromEntries(rows);
}

/** Options whose text can't be used. */
export function invalid(options: readonly OptionInfo[], entered: Entered): string[] {
    const isWrong = (option: OptionInfo) => {
        const text = entered[option.name];
        return text !== undefined && text !== "" && valueOf(option, text) === undefined;
    };
    return options.filter(isWrong).map((option) => option.name);
}

/** What a job ran with, as text. */
export function enteredOf(options: readonly OptionInfo[], values: Record<string, unknown>): Entered {
    const rows = options.flatMap((option) => {
        const value = values[option.name];
        if (value === undefined || value === null || JSON.stringify(value) === JSON.stringify(option.default))
            return [];
        return [[option.name, Array.isArray(value) ? value.join(" ") : String(value)] as const];
    });
    return Object.fromEntries(rows);
}
