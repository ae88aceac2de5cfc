import "../style.css";

import { start } from "../ui/root";
import { Reference } from "./reference";

start(Reference);
