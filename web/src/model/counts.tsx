import { number } from "../lib/format";
import { t } from "../texts";
import type { Surface } from "../viewer/surface";

/** How much is shown. */
export function Counts({ surface }: { surface: Surface }) {
    const points = number(surface.positions.length / 3);
    return (
        <span class="number" data-testid="counts">
            {surface.triangles
                ? t.viewer.counts(points, number(surface.triangles.length / 3))
                : t.viewer.cloudCounts(points)}
        </span>
    );
}
