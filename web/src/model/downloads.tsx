import { useState } from "preact/hooks";

import type { Schema } from "../api/client";
import { at } from "../lib/address";
import { bytes } from "../lib/format";
import { t } from "../texts";
import { Choice } from "../ui/pieces";
import { cloudFormats, has, meshFormats, posesFormats, scansFormats } from "./sources";

/** The files of the model, in every format that the server writes. */
export function Downloads({ model }: { model: Schema["Model"] }) {
    const base = at(`/v1/models/${encodeURIComponent(model.id)}`);
    return (
        <section class="panel stack">
            <h2>{t.model.downloads}</h2>
            {has(model, "mesh") && <Formats what="mesh" base={base} formats={meshFormats} />}
            {has(model, "cloud") && <Formats what="cloud" base={base} formats={cloudFormats} />}
            {has(model, "poses") && <Formats what="poses" base={base} formats={posesFormats} />}
            {has(model, "poses") && <Formats what="scans" base={base} formats={scansFormats} />}
            <ul class="plain small">
                {model.assets.map((asset) => (
                    <li key={asset.name}>
                        <a href={asset.href} download={asset.name}>
                            {asset.name}
                        </a>{" "}
                        <span class="quiet number">{bytes(asset.bytes)}</span>
                    </li>
                ))}
            </ul>
        </section>
    );
}

function Formats<T extends string>({
    what,
    base,
    formats,
}: {
    what: "mesh" | "cloud" | "poses" | "scans";
    base: string;
    formats: readonly [T, ...T[]];
}) {
    const [format, setFormat] = useState<T>(formats[0]);
    const choices = formats.map((name) => [name, name.toUpperCase()] as const);
    return (
        <div class="row downloads">
            <Choice label={t.model.what[what]} value={format} choices={choices} onChange={setFormat} />
            <a
                class="button"
                href={`${base}/${what}?format=${format}`}
                download
                aria-label={`${t.model.download}: ${t.model.what[what]}, ${format.toUpperCase()}`}
            >
                {t.model.download}
            </a>
        </div>
    );
}
