import { createStore } from "../lib/store";
import { de } from "./de";
import { en, type Texts } from "./en";

export type { Texts };
export type Language = "en" | "de";

/** Every language; a further one is a file beside these that has all of the texts. */
const languages: Record<Language, Texts> = { en, de };

export const language = createStore<Language>("en");

/** The texts in the language of the reader. */
export let t: Texts = en;
language.subscribe(() => {
    t = languages[language.get()];
});

const key = "visage.language";

/** What was chosen before, else what the browser asks for. */
export function chooseLanguage(): void {
    const kept = localStorage.getItem(key);
    const wanted = kept ?? navigator.languages.map((name) => name.slice(0, 2)).find((name) => name in languages);
    language.set(wanted === "de" ? "de" : "en");
}

export function keepLanguage(chosen: Language): void {
    localStorage.setItem(key, chosen);
    language.set(chosen);
}
