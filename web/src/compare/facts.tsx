import type { ComponentChildren } from "preact";

import type { Schema } from "../api/client";
import { date, length, number } from "../lib/format";
import { reportOf, type Report } from "../model/sources";
import { t } from "../texts";
import { Quality } from "../ui/pieces";
import { Table, type Column } from "../ui/table";

type Model = Schema["Model"];

interface Fact {
    title: string;
    of: (model: Model, report: Report | undefined) => ComponentChildren;
}

const facts = (): Fact[] => [
    { title: t.model.verdict, of: (model) => <Quality quality={model.quality} /> },
    {
        title: t.compare.placed,
        of: (_, report) =>
            report &&
            report.views.length > 0 &&
            t.model.placed(report.views.filter(({ placed }) => placed).length, report.views.length),
    },
    {
        title: t.compare.reasons,
        of: (_, report) => (report?.verdict?.reasons ?? []).join("; "),
    },
    {
        title: t.compare.spacing,
        of: (model, report) => report?.spacing !== undefined && length(report.spacing, model.unit),
    },
    { title: t.points, of: (model) => number(model.points) },
    { title: t.label, of: (model) => model.label },
    { title: t.created, of: (model) => date(model.created_at) },
];

/** What is known of two models, line by line; what is known of neither is left out. */
export function FactTable({ models }: { models: readonly [Model, Model] }) {
    const reports = models.map(reportOf);
    const column = (index: 0 | 1): Column<Fact> => ({
        title:
            models[index].name === models[1 - index]?.name ? `${index + 1}. ${models[index].name}` : models[index].name,
        cell: ({ of }) => of(models[index], reports[index]),
    });
    const columns = [
        { title: t.model.facts, kind: "name" as const, cell: ({ title }: Fact) => title },
        column(0),
        column(1),
    ];
    const known = facts().filter(({ title, of }) =>
        title === t.model.verdict
            ? models.some(({ quality }) => quality)
            : models.some((model, index) => of(model, reports[index])),
    );
    return <Table caption={t.compare.title} columns={columns} rows={known} keyOf={({ title }) => title} />;
}
