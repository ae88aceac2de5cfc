import { useState } from "preact/hooks";

import { signIn } from "../lib/session";
import { t } from "../texts";
import { Field, PageTitle, Trouble } from "./pieces";

/** Where a key is shown, before anything else of a server that wants one. */
export function SignIn() {
    const [key, setKey] = useState("");
    const [error, setError] = useState<unknown>();
    const [isAsking, setAsking] = useState(false);
    const submit = async (event: Event) => {
        event.preventDefault();
        setAsking(true);
        setError(undefined);
        try {
            await signIn(key.trim());
        } catch (fault) {
            setError(fault);
        }
        setAsking(false);
    };
    return (
        <>
            <PageTitle title={t.signIn.title} />
            <p>{t.signIn.lead}</p>
            <Trouble error={error} />
            <form onSubmit={submit}>
                <Field label={t.signIn.key} help={t.signIn.help}>
                    {(id, help) => (
                        <input
                            id={id}
                            aria-describedby={help}
                            type="password"
                            value={key}
                            required
                            autocomplete="current-password"
                            onInput={(event) => setKey(event.currentTarget.value)}
                        />
                    )}
                </Field>
                <button type="submit" class="main" disabled={isAsking}>
                    {t.signIn.action}
                </button>
            </form>
        </>
    );
}
