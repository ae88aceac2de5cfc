import { t } from "../texts";
import { Field } from "../ui/pieces";
import { keepFile } from "./kept-files";

interface Props {
    set: string;
    scan: string;
    onChoose: (file: File) => void;
}

/** Asks for the file of a scan, from the reader's own disk, and keeps it: the server does not give scans back. */
export function ScanFileField({ set, scan, onChoose }: Props) {
    const choose = (file: File | undefined) => {
        if (!file) return;
        keepFile(set, scan, file);
        onChoose(file);
    };
    return (
        <Field label={t.hints.file(scan)} help={t.hints.fileHelp}>
            {(id, help) => (
                <input
                    id={id}
                    aria-describedby={help}
                    type="file"
                    onChange={(event) => choose(event.currentTarget.files?.[0])}
                />
            )}
        </Field>
    );
}
