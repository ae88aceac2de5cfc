import { useRef, useState } from "preact/hooks";

import type { Schema } from "../api/client";
import { announce } from "../lib/announce";
import { bytes } from "../lib/format";
import { t } from "../texts";
import { TextField, Trouble, UnitChoice, type Unit } from "../ui/pieces";
import { Table, type Column } from "../ui/table";
import { DropZone } from "./drop-zone";
import { hasSeveralPoses, needsForm, needsUnit, roles, withoutCommonFolder, type Chosen, type Role } from "./files";
import { sendForm, sendOneByOne, type Item } from "./queue";

interface Props {
    info: Schema["Info"];
    /** The set that scans are added to; a new one where there is none. */
    set?: Schema["ScanSet"];
    onStored: (id: string, files: readonly Item[]) => void;
}

/** Takes files and stores them as a scan set, or in one. */
export function Upload({ info, set, onStored }: Props) {
    const [items, setItems] = useState<Item[]>([]);
    const [name, setName] = useState("");
    const [unit, setUnit] = useState<Unit>("unknown");
    const [error, setError] = useState<unknown>();
    const [stored, setStored] = useState<string>();
    const [stop, setStop] = useState<AbortController>();
    // changes come faster than the page is drawn
    const latest = useRef<Item[]>([]);
    const show = (next: Item[]) => {
        latest.current = next;
        setItems(next);
    };
    const paths = items.map((item) => item.path);
    const taken = items.map((item) => item.role);
    const sendable = items.filter((item) => item.role !== "skip");
    const tooLarge = sendable.filter(
        (item) => item.file.size > (item.role === "archive" ? info.limits.upload_bytes : info.limits.file_bytes),
    );
    const scans = sendable.filter((item) => item.role === "scan").length + (set?.scans.length ?? 0);
    const tooMany = scans > info.limits.scans_per_set;
    const archiveInSet = set !== undefined && needsForm(paths, taken);

    const choose = (chosen: Chosen[]) => {
        const names = withoutCommonFolder(chosen.map((item) => item.path));
        const taken = roles(names, info.file_formats);
        setError(undefined);
        setStored(undefined);
        if (!set && name === "") setName(suggestedName(chosen));
        show(
            chosen.map((item, index) => ({
                ...item,
                name: names[index] ?? item.path,
                role: taken[index] ?? "skip",
                state: "waiting",
                sent: 0,
            })),
        );
        const size = chosen.reduce((sum, item) => sum + item.file.size, 0);
        announce(t.upload.chosen(chosen.length, bytes(size)));
    };
    const setRole = (index: number, role: Role) =>
        show(
            items.map((item, other) => {
                if (other === index) return { ...item, role };
                // a set starts from one file of poses
                return role === "poses" && item.role === "poses" ? { ...item, role: "skip" } : item;
            }),
        );
    const start = async () => {
        const controller = new AbortController();
        setStop(controller);
        setError(undefined);
        const changed = (index: number, change: Partial<Item>) =>
            show(latest.current.map((item, other) => (other === index ? { ...item, ...change } : item)));
        const target = { name: name.trim(), unit, id: set?.id ?? stored };
        try {
            const id = await (needsForm(paths, taken) ? sendForm : sendOneByOne)(
                items,
                target,
                changed,
                controller.signal,
            );
            setStored(id);
            const failed = latest.current.filter((item) => item.state === "failed").length;
            announce(failed > 0 ? t.upload.partly(failed) : t.upload.done(sendable.length));
            if (failed === 0) onStored(id, latest.current);
        } catch (fault) {
            if (!controller.signal.aborted) setError(fault);
        } finally {
            setStop(undefined);
        }
    };
    const failed = items.filter((item) => item.state === "failed").length;
    return (
        <div class="stack">
            <DropZone formats={info.file_formats} isBusy={stop !== undefined} onChosen={choose} />
            {items.length > 0 && (
                <div class="panel stack">
                    {!set && (
                        <div class="form-grid">
                            <TextField label={`${t.name} (${t.optional})`} value={name} onInput={setName} />
                            {needsUnit(paths, taken) && (
                                <UnitChoice value={unit} onChange={setUnit} help={t.upload.unitHelp} />
                            )}
                        </div>
                    )}
                    {hasSeveralPoses(paths, taken) && !taken.includes("poses") && (
                        <div class="note">
                            <p>{t.upload.several}</p>
                        </div>
                    )}
                    {sendable.length === 0 && (
                        <div class="note doubt">
                            <p>{t.upload.nothing}</p>
                        </div>
                    )}
                    {archiveInSet && (
                        <div class="note doubt">
                            <p>{t.upload.archiveNewSet}</p>
                        </div>
                    )}
                    {tooMany && (
                        <div class="note doubt">
                            <p>{t.upload.tooMany(info.limits.scans_per_set)}</p>
                        </div>
                    )}
                    {tooLarge.map((item) => (
                        <div class="note doubt" key={item.path}>
                            <p>
                                {item.name}: {t.upload.tooLarge(bytes(info.limits.file_bytes))}
                            </p>
                        </div>
                    ))}
                    <FileTable items={items} isBusy={stop !== undefined} isSet={set !== undefined} onRole={setRole} />
                    <Trouble error={error} />
                    {failed > 0 && stored && !stop && (
                        <div class="note doubt" role="alert">
                            <p>{t.upload.partly(failed)}</p>
                        </div>
                    )}
                    <div class="row">
                        <button
                            type="button"
                            class="main"
                            onClick={start}
                            disabled={
                                stop !== undefined ||
                                sendable.length === 0 ||
                                tooLarge.length > 0 ||
                                tooMany ||
                                archiveInSet
                            }
                        >
                            {stop
                                ? t.upload.running
                                : t.upload.start(sendable.filter((item) => item.state !== "done").length)}
                        </button>
                        {stop && (
                            <button type="button" onClick={() => stop.abort()}>
                                {t.upload.stop}
                            </button>
                        )}
                        {stored && !stop && (
                            <button type="button" onClick={() => onStored(stored, items)}>
                                {t.upload.openSet}
                            </button>
                        )}
                    </div>
                </div>
            )}
        </div>
    );
}

/** A folder's name, else that of a single archive: what people would type themselves. */
function suggestedName(chosen: readonly Chosen[]): string {
    const first = chosen[0];
    if (!first) return "";
    const folder = first.path.includes("/") ? (first.path.split("/")[0] ?? "") : "";
    if (folder && chosen.every((item) => item.path.startsWith(`${folder}/`))) return folder;
    return chosen.length === 1 ? first.file.name.replace(/\.(zip|tar|tgz|tar\.gz|e57|ptx)$/i, "") : "";
}

function FileTable(props: {
    items: readonly Item[];
    isBusy: boolean;
    isSet: boolean;
    onRole: (index: number, role: Role) => void;
}) {
    const choices = (["scan", "archive", "poses", "skip"] as const).map(
        (role) => [role, t.upload.roles[role]] as const,
    );
    const columns: Column<Item>[] = [
        {
            title: t.upload.file,
            kind: "name",
            cell: (item) => (
                <>
                    {item.name}
                    {item.error !== undefined && <Trouble error={item.error} />}
                </>
            ),
        },
        { title: t.size, kind: "number", cell: (item) => bytes(item.file.size) },
        {
            title: t.upload.role,
            cell: (item, index) => (
                <select
                    aria-label={`${t.upload.role}: ${item.name}`}
                    disabled={props.isBusy || item.state === "done"}
                    value={item.role}
                    onChange={(event) => props.onRole(index, event.currentTarget.value as Role)}
                >
                    {choices.map(([role, text]) => (
                        <option key={role} value={role} selected={role === item.role}>
                            {text}
                        </option>
                    ))}
                </select>
            ),
        },
        { title: t.upload.state, cell: (item) => item.role !== "skip" && <FileState item={item} /> },
    ];
    return <Table caption={t.upload.table} columns={columns} rows={props.items} keyOf={(item) => item.path} />;
}

function FileState({ item }: { item: Item }) {
    const share = item.file.size > 0 ? item.sent / item.file.size : 0;
    const isMoving = item.state === "sending" || item.state === "again";
    return (
        <span>
            {t.upload.states[item.state]}
            {isMoving && <progress aria-label={t.upload.progressOf(item.name)} max={1} value={share} />}
        </span>
    );
}
