import type { ComponentChildren } from "preact";
import { useEffect, useState } from "preact/hooks";

import { api, ok, type Schema } from "../api/client";
import { StartJob } from "../jobs/start";
import { percent } from "../lib/format";
import { useInfo } from "../lib/use-info";
import { useLoad } from "../lib/use-load";
import { ScanFileField } from "../scan-sets/file-field";
import { keptFile } from "../scan-sets/kept-files";
import { t } from "../texts";
import { Field, Loading, Trouble } from "../ui/pieces";
import { readFile } from "../viewer/load";
import type { Overlay } from "../viewer/overlay";
import type { Surface } from "../viewer/surface";
import { choose, first, poseOf, startingPoses, type Chosen } from "./places";
import type { Alternatives, Matrix, Report } from "./sources";

interface Props {
    model: Schema["Model"];
    report: Report;
    poses: Record<string, Matrix | null>;
    onOverlay: (overlay: Overlay | undefined) => void;
}

const overlayColour = "#ff9d2e";

/** Scans that fit in several ways: a person says in which, and the job runs again from there. */
export function SeveralPlaces({ model, report, poses, onOverlay }: Props) {
    const rows = report.alternatives;
    const [chosen, setChosen] = useState<Record<string, Chosen>>({});
    const [shown, setShown] = useState<{ name: string; surface: Surface }>();
    const setId = model.scan_set_id ?? "";
    useEffect(() => {
        const row = rows.find(({ name }) => name === shown?.name);
        onOverlay(
            shown && row
                ? { surface: shown.surface, pose: poseOf(row, chosen[row.name] ?? first), colour: overlayColour }
                : undefined,
        );
    }, [shown, chosen]);
    return (
        <section class="panel stack">
            <h2>{t.places.title}</h2>
            <p class="quiet">{t.places.lead}</p>
            {rows.map((row) => (
                <Places
                    key={row.name}
                    row={row}
                    chosen={chosen[row.name] ?? first}
                    onChange={(choice) => setChosen(choose(rows, report.views, chosen, row.name, choice))}
                >
                    <Preview
                        set={setId}
                        scan={row.name}
                        isShown={shown?.name === row.name}
                        onShow={(surface) => setShown(surface && { name: row.name, surface })}
                    />
                </Places>
            ))}
            {setId && <Again model={model} setId={setId} poses={() => startingPoses(poses, rows, chosen)} />}
        </section>
    );
}

function Places(props: {
    row: Alternatives;
    chosen: Chosen;
    onChange: (chosen: Chosen) => void;
    children: ComponentChildren;
}) {
    const { row, chosen, onChange } = props;
    return (
        <fieldset class="stack">
            <legend>{row.name}</legend>
            <div>
                {row.poses.map(({ score }, index) => (
                    <label class="check" key={index}>
                        <input
                            type="radio"
                            name={`place of ${row.name}`}
                            checked={index === chosen.index}
                            onChange={() => onChange({ ...chosen, index })}
                        />
                        <span>{t.places.place(index + 1, percent(score))}</span>
                    </label>
                ))}
            </div>
            {row.axis && (
                <Field label={t.places.turn(chosen.degrees)} help={t.places.turnHelp}>
                    {(id, help) => (
                        <input
                            id={id}
                            aria-describedby={help}
                            type="range"
                            min={0}
                            max={359}
                            step={1}
                            value={chosen.degrees}
                            onInput={(event) => onChange({ ...chosen, degrees: event.currentTarget.valueAsNumber })}
                        />
                    )}
                </Field>
            )}
            {props.children}
        </fieldset>
    );
}

/** The scan where it was put; its file is the reader's own, since the server does not give scans back. */
function Preview(props: {
    set: string;
    scan: string;
    isShown: boolean;
    onShow: (surface: Surface | undefined) => void;
}) {
    const { set, scan, isShown, onShow } = props;
    const [error, setError] = useState<unknown>();
    const kept = keptFile(set, scan);
    const show = (file: File) => {
        setError(undefined);
        readFile(file).then(onShow, setError);
    };
    return (
        <>
            {isShown || kept ? (
                <button
                    type="button"
                    aria-pressed={isShown}
                    onClick={() => (isShown ? onShow(undefined) : kept && show(kept))}
                >
                    {t.places.show}
                </button>
            ) : (
                <ScanFileField set={set} scan={scan} onChoose={show} />
            )}
            <Trouble error={error} />
        </>
    );
}

/** A job of the same set, with the poses of the set replaced before. */
function Again({
    model,
    setId,
    poses,
}: {
    model: Schema["Model"];
    setId: string;
    poses: () => Record<string, Matrix>;
}) {
    const info = useInfo();
    const set = useLoad(() => ok(api.GET("/v1/scan-sets/{id}", { params: { path: { id: setId } } })), [setId]);
    // jobs are deleted when they are old; then the options are as they come
    const job = useLoad(
        () =>
            model.job_id
                ? ok(api.GET("/v1/jobs/{id}", { params: { path: { id: model.job_id } } })).catch(() => undefined)
                : Promise.resolve(undefined),
        [model.job_id],
    );
    const put = () =>
        ok(api.PUT("/v1/scan-sets/{id}/poses", { params: { path: { id: setId } }, body: poses() })).then(
            () => undefined,
        );
    if (!info.data || !set.data || job.isLoading) return set.error ? <Trouble error={set.error} /> : <Loading />;
    return (
        <>
            <p class="quiet small">{t.places.consequence}</p>
            <StartJob
                info={info.data}
                set={set.data}
                {...(job.data && { like: job.data })}
                prepare={put}
                text={t.places.start}
            />
        </>
    );
}
