import { api, ok, type Schema } from "../api/client";
import { length, number } from "../lib/format";
import { href } from "../lib/router";
import { useLoad } from "../lib/use-load";
import { t } from "../texts";
import { Loading, Trouble } from "../ui/pieces";
import { Table, type Column } from "../ui/table";
import { ModelPicker } from "./model-picker";

interface Props {
    model: Pick<Schema["Model"], "id" | "unit">;
    reference: string;
    onReference: (id: string) => void;
}

/** Another model, and how far this one is from it. */
export function Deviation({ model, reference, onReference }: Props) {
    return (
        <section class="panel stack" aria-label={t.deviation.title}>
            <ModelPicker
                label={t.deviation.reference}
                value={reference}
                isFit={({ id, unit }) => id !== model.id && unit === model.unit}
                onChange={onReference}
            />
            <p class="quiet small">{t.deviation.help}</p>
            {reference && <Figures id={model.id} reference={reference} />}
            {reference && <a href={compareAddress(model.id, reference)}>{t.compare.beside}</a>}
        </section>
    );
}

/** Both beside each other. */
export function compareAddress(a: string, b: string): string {
    return `${href("compare")}?${new URLSearchParams({ a, b })}`;
}

type Row = keyof Pick<
    Schema["DeviationFigures"],
    "mean_signed" | "mean" | "rms" | "p95" | "p99" | "points" | "out_of_reach"
>;
const rows: readonly Row[] = ["mean_signed", "mean", "rms", "p95", "p99", "points", "out_of_reach"];

function Figures({ id, reference }: { id: string; reference: string }) {
    const { data, error, isLoading } = useLoad(
        () => ok(api.GET("/v1/models/{id}/deviation", { params: { path: { id }, query: { reference } } })),
        [id, reference],
    );
    if (isLoading || !data) return error ? <Trouble error={error} /> : <Loading />;
    const cell = (row: Row, figures: Schema["DeviationFigures"]) =>
        row === "points" || row === "out_of_reach" ? number(figures[row]) : length(figures[row], data.unit);
    const columns: Column<Row>[] = [
        { title: t.deviation.figure, kind: "name", cell: (row) => t.deviation.figures[row] },
        { title: t.deviation.forth, kind: "number", cell: (row) => cell(row, data.model_to_reference) },
        { title: t.deviation.back, kind: "number", cell: (row) => cell(row, data.reference_to_model) },
    ];
    return <Table caption={t.deviation.title} columns={columns} rows={rows} keyOf={(row) => row} />;
}
