import type { ComponentType } from "preact";
import { render } from "preact";

import { useStore } from "../lib/store";
import { chooseLanguage, language } from "../texts";
import { showTheme } from "./settings";

/** Puts a page on the screen, in the language and the colours of its reader; in another language all is drawn anew. */
export function start(Page: ComponentType): void {
    const Root = () => {
        const chosen = useStore(language);
        document.documentElement.lang = chosen;
        return <Page key={chosen} />;
    };
    chooseLanguage();
    showTheme();
    const place = document.getElementById("app");
    if (place) render(<Root />, place);
}
