import { api, ok } from "../api/client";
import { date, number } from "../lib/format";
import { go, href } from "../lib/router";
import { useInfo } from "../lib/use-info";
import { t } from "../texts";
import { DeleteButton } from "../ui/confirm";
import { usePages } from "../ui/pages";
import { Loading, PageTitle, Trouble } from "../ui/pieces";
import { keepFile } from "./kept-files";
import { Upload } from "./upload";

/** All scan sets, and where new ones are made. */
export function ScanSetList() {
    const info = useInfo();
    const sets = usePages(
        (cursor) => ok(api.GET("/v1/scan-sets", { params: { query: cursor ? { cursor } : {} } })),
        [],
    );
    return (
        <>
            <PageTitle title={t.scanSets.title} />
            <p class="quiet">{t.scanSets.lead}</p>
            <section aria-label={t.scanSets.new}>
                <Trouble error={info.error} />
                {info.data && (
                    <Upload
                        info={info.data}
                        onStored={(id, files) => {
                            for (const item of files) if (item.role === "scan") keepFile(id, item.name, item.file);
                            go(href("scan-sets", id));
                        }}
                    />
                )}
            </section>
            <section class="panel" aria-label={t.scanSets.table}>
                <Trouble error={sets.error} />
                {!sets.items && sets.isLoading && <Loading />}
                {sets.items?.length === 0 && <p class="empty">{t.scanSets.empty}</p>}
                {sets.items && sets.items.length > 0 && (
                    <div class="table-wrap">
                        <table class="folds">
                            <caption class="unseen">{t.scanSets.table}</caption>
                            <thead>
                                <tr>
                                    <th scope="col">{t.name}</th>
                                    <th scope="col" class="number">
                                        {t.set.scans}
                                    </th>
                                    <th scope="col" class="number">
                                        {t.points}
                                    </th>
                                    <th scope="col">{t.unit}</th>
                                    <th scope="col">{t.created}</th>
                                    <th>
                                        <span class="unseen">{t.remove}</span>
                                    </th>
                                </tr>
                            </thead>
                            <tbody>
                                {sets.items.map((set) => (
                                    <tr key={set.id}>
                                        <td class="name">
                                            <a href={href("scan-sets", set.id)}>{set.name}</a>
                                        </td>
                                        <td class="number" data-title={t.set.scans}>
                                            {number(set.scans.length)}
                                        </td>
                                        <td class="number" data-title={t.points}>
                                            {number(set.scans.reduce((sum, scan) => sum + scan.points, 0))}
                                        </td>
                                        <td data-title={t.unit}>
                                            {set.unit === "unknown" ? t.units.unknown : set.unit}
                                        </td>
                                        <td data-title={t.created}>{date(set.created_at)}</td>
                                        <td class="act">
                                            <DeleteButton
                                                name={set.name}
                                                consequence={t.confirm.set}
                                                label={`${t.remove}: ${set.name}`}
                                                className="bare"
                                                onConfirm={() =>
                                                    ok(
                                                        api.DELETE("/v1/scan-sets/{id}", {
                                                            params: { path: { id: set.id } },
                                                        }),
                                                    )
                                                }
                                                onDone={sets.reload}
                                            />
                                        </td>
                                    </tr>
                                ))}
                            </tbody>
                        </table>
                    </div>
                )}
                {sets.more}
            </section>
        </>
    );
}
