import { useState } from "preact/hooks";

import { api, ok, type Schema } from "../api/client";
import { StartJob } from "../jobs/start";
import { length } from "../lib/format";
import { href } from "../lib/router";
import { useInfo } from "../lib/use-info";
import { useLoad } from "../lib/use-load";
import { without } from "../lib/without";
import { t } from "../texts";
import { Loading, PageTitle, Trouble } from "../ui/pieces";
import { PairPicker } from "./pair-picker";
import { RegionPicker } from "./region-picker";
import type { RegionHint } from "./regions";

/** What a person says of two scans where machines can't tell. */
export function HintsPage({ id }: { id: string }) {
    const set = useLoad(() => ok(api.GET("/v1/scan-sets/{id}", { params: { path: { id } } })), [id]);
    const [hints, setHints] = useState<Required<Pick<Schema["Hints"], "points" | "overlaps" | "regions">>>({
        points: [],
        overlaps: [],
        regions: [],
    });
    const [areRegionsOpen, setRegionsOpen] = useState(false);
    const info = useInfo();
    if (!set.data)
        return set.isLoading ? (
            <Loading />
        ) : (
            <>
                <PageTitle title={t.hints.title} />
                <Trouble error={set.error} />
            </>
        );
    const given = [
        ...hints.points.map((hint, index) => ({
            text: t.hints.pointsOf(hint.pairs.length, hint.a, hint.b),
            remove: () => setHints({ ...hints, points: without(hints.points, index) }),
        })),
        ...hints.overlaps.map((pair, index) => ({
            text: t.hints.overlapOf(pair[0] ?? "", pair[1] ?? ""),
            remove: () => setHints({ ...hints, overlaps: without(hints.overlaps, index) }),
        })),
        ...hints.regions.map((region, index) => ({
            text: regionText(region, set.data?.unit ?? "unknown", index),
            remove: () => setHints({ ...hints, regions: without(hints.regions, index) }),
        })),
    ];
    return (
        <>
            <PageTitle title={t.hints.title}>
                <a class="button" href={href("scan-sets", id)}>
                    {set.data.name}
                </a>
            </PageTitle>
            <p class="quiet">{t.hints.lead}</p>
            <Trouble error={info.error} />
            {set.data.scans.length > 1 && (
                <PairPicker
                    set={set.data}
                    onPoints={(points) => setHints({ ...hints, points: [...hints.points, points] })}
                    onOverlap={(a, b) =>
                        setHints({
                            ...hints,
                            overlaps: [
                                ...hints.overlaps.filter((pair) => !(pair.includes(a) && pair.includes(b))),
                                [a, b],
                            ],
                        })
                    }
                />
            )}
            <details class="panel" onToggle={(event) => setRegionsOpen(event.currentTarget.open)}>
                <summary>{t.regions.title}</summary>
                {areRegionsOpen && (
                    <RegionPicker
                        set={set.data}
                        regions={hints.regions}
                        onRegion={(region) => setHints({ ...hints, regions: [...hints.regions, region] })}
                    />
                )}
            </details>
            <section class="panel stack">
                <h2>{t.hints.given}</h2>
                {given.length === 0 && <p class="quiet">{t.hints.none}</p>}
                <ul class="plain">
                    {given.map(({ text, remove }) => (
                        <li class="row spread" key={text}>
                            <span>{text}</span>
                            <button
                                type="button"
                                class="bare"
                                aria-label={`${t.hints.removeHint}: ${text}`}
                                onClick={remove}
                            >
                                {t.hints.removeHint}
                            </button>
                        </li>
                    ))}
                </ul>
                {given.length > 0 && info.data && (
                    <StartJob info={info.data} set={set.data} hints={hints} text={t.hints.start} />
                )}
            </section>
        </>
    );
}

/** A region in words; two that read alike are told apart by their numbers. */
function regionText(hint: RegionHint, unit: string, index: number): string {
    const kind = hint.use ? "use" : "leave";
    const sphere = hint[kind]?.sphere;
    const what = sphere ? t.regions.ballOf(length(sphere.radius, unit)) : t.regions.side;
    return `${t.regions.region(index + 1)}: ${hint.scan}, ${what}, ${t.regions.kinds[kind]}`;
}
