import type { ColourMode } from "../viewer/colours";
import type { Kind } from "./sources";

/** What a surface is coloured by: as a person chose where it has that, else as it tells most. */
export function modeOf(wanted: ColourMode | undefined, own: readonly ColourMode[], kind: Kind): ColourMode {
    if (wanted && own.includes(wanted)) return wanted;
    if (own.includes("scan")) return "scan";
    return own.includes("view") && kind === "cloud" ? "view" : "plain";
}
