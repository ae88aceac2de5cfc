import { useId } from "preact/hooks";

import { figure, length } from "../lib/format";
import { t } from "../texts";
import { css, scaleOf, type ColourMode } from "../viewer/colours";

/** Which values the colours of the surface stand for. */
export function Legend({ mode, range, unit }: { mode: ColourMode; range: [number, number]; unit: string }) {
    const isLength = mode === "height" || mode === "deviation";
    const [low, high] = range.map((value) => (isLength ? length(value, unit) : figure(value)));
    return (
        <p class="row small" data-testid="legend">
            <Scale range={range} /> {t.viewer.lowHigh(low ?? "", high ?? "")}
            {mode === "deviation" && (
                <span class="quiet">{range[0] < 0 ? t.deviation.signs : t.deviation.withoutSigns}</span>
            )}
        </p>
    );
}

/** The colours of a scale, low to high. */
function Scale({ range }: { range: [number, number] }) {
    const id = useId();
    const stops = scaleOf(range);
    return (
        <svg width="120" height="12" aria-hidden="true">
            <defs>
                <linearGradient id={id}>
                    {stops.map((stop, index) => (
                        <stop key={stop.join()} offset={index / (stops.length - 1)} stop-color={css(stop)} />
                    ))}
                </linearGradient>
            </defs>
            <rect width="120" height="12" rx="3" fill={`url(#${id})`} />
        </svg>
    );
}
