import { useRef, useState } from "preact/hooks";

import { t } from "../texts";
import { chosen, dropped, type Chosen } from "./files";

/** Where files, folders and archives are dropped, or chosen. */
export function DropZone(props: { formats: readonly string[]; isBusy: boolean; onChosen: (files: Chosen[]) => void }) {
    const [isOver, setOver] = useState(false);
    const files = useRef<HTMLInputElement>(null);
    const folder = useRef<HTMLInputElement>(null);
    const take = (list: Chosen[]) => {
        if (list.length > 0 && !props.isBusy) props.onChosen(list);
    };
    const changed = (input: HTMLInputElement) => {
        take(chosen(input.files));
        // the same files can be chosen again
        input.value = "";
    };
    return (
        <div
            class={`drop ${isOver ? "over" : ""}`}
            onDragOver={(event) => {
                event.preventDefault();
                setOver(true);
            }}
            onDragLeave={() => setOver(false)}
            onDrop={async (event) => {
                event.preventDefault();
                setOver(false);
                if (event.dataTransfer) take(await dropped(event.dataTransfer));
            }}
        >
            <p>
                <strong>{t.upload.drop}</strong>
            </p>
            <div class="row">
                <span class="quiet">{t.upload.or}</span>
                <button type="button" disabled={props.isBusy} onClick={() => files.current?.click()}>
                    {t.upload.chooseFiles}
                </button>
                <button type="button" disabled={props.isBusy} onClick={() => folder.current?.click()}>
                    {t.upload.chooseFolder}
                </button>
            </div>
            <p class="quiet small">
                {t.upload.formats(props.formats.map((ending) => ending.replace(/^\./, "")).join(", "))}
            </p>
            <input
                ref={files}
                type="file"
                multiple
                hidden
                aria-label={t.upload.chooseFiles}
                data-testid="files"
                onChange={(event) => changed(event.currentTarget)}
            />
            <input
                ref={folder}
                type="file"
                multiple
                hidden
                aria-label={t.upload.chooseFolder}
                onChange={(event) => changed(event.currentTarget)}
                {...{ webkitdirectory: true }}
            />
        </div>
    );
}
