import "./style.css";

import { render } from "preact";

import { App } from "./app";
import { listen } from "./lib/router";
import { useStore } from "./lib/store";
import { chooseLanguage, language } from "./texts";
import { showTheme } from "./ui/settings";

/** All is drawn anew in another language. */
function Root() {
    const chosen = useStore(language);
    document.documentElement.lang = chosen;
    return <App key={chosen} />;
}

chooseLanguage();
showTheme();
listen();
const root = document.getElementById("app");
if (root) render(<Root />, root);
