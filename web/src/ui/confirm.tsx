import { useEffect, useId, useRef, useState } from "preact/hooks";

import { announce } from "../lib/announce";
import { useInfo } from "../lib/use-info";
import { t } from "../texts";
import { Trouble } from "./pieces";

interface Props {
    name: string;
    consequence: string;
    /** Whether the recycle bin takes it, if the server has one. */
    goesToBin?: boolean;
    text?: string;
    label?: string;
    className?: string;
    onConfirm: () => Promise<unknown>;
    onDone: () => void;
}

/** Whether a deletion can be taken back on this server. */
function Fate() {
    const info = useInfo();
    const days = info.data?.limits.bin_days;
    return <>{days === undefined ? "" : days > 0 ? t.confirm.kept(days) : t.confirm.final}</>;
}

/** A button that deletes, once that was confirmed. */
export function DeleteButton({ name, consequence, goesToBin, text, label, className, onConfirm, onDone }: Props) {
    const [isOpen, setOpen] = useState(false);
    const [error, setError] = useState<unknown>();
    const [isBusy, setBusy] = useState(false);
    const dialog = useRef<HTMLDialogElement>(null);
    const title = useId();
    useEffect(() => {
        if (isOpen) dialog.current?.showModal();
    }, [isOpen]);
    const confirm = async () => {
        setBusy(true);
        setError(undefined);
        try {
            await onConfirm();
            announce(t.deleted(name));
            setOpen(false);
            onDone();
        } catch (fault) {
            setError(fault);
        } finally {
            setBusy(false);
        }
    };
    return (
        <>
            <button type="button" class={className ?? "risky"} aria-label={label} onClick={() => setOpen(true)}>
                {text ?? t.remove}
            </button>
            {isOpen && (
                <dialog ref={dialog} aria-labelledby={title} onClose={() => setOpen(false)}>
                    <h2 id={title}>{t.confirm.title(name)}</h2>
                    <p>
                        {consequence} {goesToBin ? <Fate /> : t.confirm.final}
                    </p>
                    <Trouble error={error} />
                    <div class="row end">
                        <button type="button" autofocus onClick={() => dialog.current?.close()}>
                            {t.cancel}
                        </button>
                        <button type="button" class="risky" disabled={isBusy} onClick={confirm}>
                            {t.remove}
                        </button>
                    </div>
                </dialog>
            )}
        </>
    );
}
