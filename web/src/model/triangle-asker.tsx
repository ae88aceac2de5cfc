import { t } from "../texts";
import type { Pick } from "../viewer/scene";
import { triangleAddress } from "../gallery/triangle";

interface Props {
    unit: string;
    isPicking: boolean;
    picks: readonly Pick[];
    onPicking: (isPicking: boolean) => void;
    onPicks: (picks: Pick[]) => void;
}

const corners = 3;

/** Asks the gallery for a triangle of three places that a person picks on the model. */
export function TriangleAsker({ unit, isPicking, picks, onPicking, onPicks }: Props) {
    return (
        <section class="panel stack">
            <h2>{t.triangle.title}</h2>
            <p class="quiet">{t.triangle.lead}</p>
            <div class="row">
                <button type="button" aria-pressed={isPicking} onClick={() => onPicking(!isPicking)}>
                    {isPicking ? t.marks.stop : t.triangle.start}
                </button>
                {picks.length > 0 && (
                    <button type="button" onClick={() => onPicks([])}>
                        {t.triangle.again}
                    </button>
                )}
                {picks.length === corners && (
                    <a class="button main" href={triangleAddress(picks, unit)}>
                        {t.triangle.ask}
                    </a>
                )}
            </div>
            {picks.length > 0 && picks.length < corners && (
                <p class="quiet">{t.triangle.needed(corners - picks.length)}</p>
            )}
        </section>
    );
}
