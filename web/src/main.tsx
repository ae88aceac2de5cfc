import "./style.css";

import { App } from "./app";
import { listen } from "./lib/router";
import { start } from "./ui/root";

listen();
start(App);
