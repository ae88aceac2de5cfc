import { language } from "../texts";

/** A number as the reader writes it, with so many digits after the point at most. */
export function number(value: number, digits = 0): string {
    return new Intl.NumberFormat(language.get(), { maximumFractionDigits: digits }).format(value);
}

/** A measured figure with its three telling digits. */
export function figure(value: number): string {
    return new Intl.NumberFormat(language.get(), { maximumSignificantDigits: 3 }).format(value);
}

export function percent(share: number): string {
    return new Intl.NumberFormat(language.get(), { style: "percent", maximumFractionDigits: 1 }).format(share);
}

/** A score between 0 and 1. */
export function score(value: number): string {
    return new Intl.NumberFormat(language.get(), { minimumFractionDigits: 2, maximumFractionDigits: 2 }).format(value);
}

/** A length in the unit of its model; without one the bare figure, since a guess would be worse. */
export function length(value: number, unit: string): string {
    return unit === "unknown" ? figure(value) : `${figure(value)}\u00a0${unit}`;
}

export function bytes(count: number): string {
    const names = ["B", "kB", "MB", "GB", "TB"];
    let value = count;
    let name = 0;
    while (value >= 1000 && name < names.length - 1) {
        value /= 1000;
        name += 1;
    }
    return `${number(value, value < 10 && name > 0 ? 1 : 0)}\u00a0${names[name]}`;
}

/** A time of the server in the zone of the reader. */
export function date(text: string): string {
    return new Intl.DateTimeFormat(language.get(), { dateStyle: "medium", timeStyle: "short" }).format(new Date(text));
}

/** Seconds in words that are read at a glance. */
export function duration(seconds: number): string {
    const whole = Math.max(0, Math.round(seconds));
    if (whole < 1) return `${number(Math.max(0, seconds), 1)}\u00a0s`;
    if (whole < 60) return `${whole}\u00a0s`;
    const minutes = Math.floor(whole / 60);
    if (minutes < 60) return `${minutes}\u00a0min ${whole % 60}\u00a0s`;
    return `${Math.floor(minutes / 60)}\u00a0h ${minutes % 60}\u00a0min`;
}
