import type { Schema } from "../api/client";
import { score } from "../lib/format";
import { t } from "../texts";
import { Quality, Tag } from "../ui/pieces";
import type { Report } from "./sources";

/** What is to be thought of the model: of its registration, and of what it shows. */
export function VerdictPanel({ model, report }: { model: Schema["Model"]; report: Report | undefined }) {
    const quality = report?.verdict?.quality ?? model.quality;
    return (
        <section class="panel">
            <h2 class="row">
                {t.model.verdict} <Quality quality={quality} />
            </h2>
            {quality ? <p>{t.model.qualityHelp[quality]}</p> : <p class="quiet">{t.model.uploaded}</p>}
            {report?.verdict && report.verdict.reasons.length > 0 && (
                <ul>
                    {report.verdict.reasons.map((reason) => (
                        <li key={reason}>{reason}</li>
                    ))}
                </ul>
            )}
            {report && report.views.length > 0 && <Placed report={report} />}
            {model.verdicts.map((verdict) => (
                <ClassVerdict key={verdict.standard} verdict={verdict} />
            ))}
            {!model.signature && <p class="quiet">{t.model.face.none}</p>}
        </section>
    );
}

function Placed({ report }: { report: Report }) {
    const without = report.views.filter((view) => !view.placed);
    return (
        <>
            <p>{t.model.placed(report.views.length - without.length, report.views.length)}</p>
            {without.length > 0 && (
                <details>
                    <summary>{t.model.unplaced}</summary>
                    <ul>
                        {without.map((view) => (
                            <li key={view.name}>
                                <strong>{view.name}</strong>
                                {view.unplaced && <>: {view.unplaced}</>}
                            </li>
                        ))}
                    </ul>
                </details>
            )}
        </>
    );
}

function ClassVerdict({ verdict }: { verdict: Schema["Verdict"] }) {
    const title =
        verdict.standard === "face"
            ? verdict.is_match
                ? t.model.face.yes
                : t.model.face.no
            : t.model.of(verdict.standard);
    return (
        <div class={`note ${verdict.is_match ? "good" : ""}`} data-testid={`verdict-${verdict.standard}`}>
            <p class="row">
                <strong>{title}</strong>
                {verdict.standard !== "face" && (
                    <Tag kind={verdict.is_match ? "good" : undefined}>
                        {verdict.is_match ? t.model.match : t.model.noMatch}
                    </Tag>
                )}
            </p>
            <p class="small">{t.model.score(score(verdict.score), score(verdict.threshold))}</p>
            {verdict.reason && <p class="small">{verdict.reason.text}</p>}
        </div>
    );
}
