import { useState } from "preact/hooks";

import { keepLanguage, language, t, type Language } from "../texts";
import { de } from "../texts/de";
import { en } from "../texts/en";

const themeKey = "visage.theme";
const themes = ["system", "light", "dark"] as const;
type Theme = (typeof themes)[number];

function keptTheme(): Theme {
    return themes.find((theme) => theme === localStorage.getItem(themeKey)) ?? "system";
}

export function showTheme(theme = keptTheme()): void {
    if (theme === "system") delete document.documentElement.dataset["theme"];
    else document.documentElement.dataset["theme"] = theme;
}

/** Language and colours. */
export function Settings() {
    const [theme, setTheme] = useState(keptTheme);
    const chooseTheme = (chosen: Theme) => {
        localStorage.setItem(themeKey, chosen);
        showTheme(chosen);
        setTheme(chosen);
    };
    return (
        <div class="settings">
            <select
                aria-label={t.settings.language}
                value={language.get()}
                onChange={(event) => keepLanguage(event.currentTarget.value as Language)}
            >
                <option value="en">{en.languageName}</option>
                <option value="de">{de.languageName}</option>
            </select>
            <select
                aria-label={t.settings.theme}
                value={theme}
                onChange={(event) => chooseTheme(event.currentTarget.value as Theme)}
            >
                {themes.map((name) => (
                    <option key={name} value={name} selected={name === theme}>
                        {t.settings[name]}
                    </option>
                ))}
            </select>
        </div>
    );
}
