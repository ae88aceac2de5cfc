import type { ComponentChildren } from "preact";

export interface Column<T> {
    title: string;
    /** The name of the row, a figure, a remark, or what is done with the row (its title is for screen readers alone). */
    kind?: "name" | "number" | "small" | "act";
    cell: (row: T, index: number) => ComponentChildren;
}

interface Props<T> {
    /** What the table lists, for screen readers. */
    caption: string;
    columns: readonly Column<T>[];
    rows: readonly T[];
    keyOf: (row: T) => string;
}

/** A table that becomes a list of rows on a narrow screen: there each cell stands beside the title of its column. */
export function Table<T>({ caption, columns, rows, keyOf }: Props<T>) {
    return (
        <div class="table-wrap">
            <table class="folds">
                <caption class="unseen">{caption}</caption>
                <thead>
                    <tr>
                        {columns.map(({ title, kind }) =>
                            kind === "act" ? (
                                <th key={title}>
                                    <span class="unseen">{title}</span>
                                </th>
                            ) : (
                                <th key={title} scope="col" class={kind === "number" ? kind : undefined}>
                                    {title}
                                </th>
                            ),
                        )}
                    </tr>
                </thead>
                <tbody>
                    {rows.map((row, index) => (
                        <tr key={keyOf(row)}>
                            {columns.map(({ title, kind, cell }) => (
                                <td
                                    key={title}
                                    class={kind}
                                    data-title={kind === "name" || kind === "act" ? undefined : title}
                                >
                                    {cell(row, index)}
                                </td>
                            ))}
                        </tr>
                    ))}
                </tbody>
            </table>
        </div>
    );
}
