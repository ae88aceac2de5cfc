import { useEffect, useState } from "preact/hooks";

import { at } from "../lib/address";
import { useLoad } from "../lib/use-load";
import { t } from "../texts";
import { Loading, PageTitle, TextField, Trouble } from "../ui/pieces";
import { Settings } from "../ui/settings";
import { callsByTag, type Call, type Contract } from "./contract";
import { Prose } from "./prose";
import { Runner } from "./runner";
import { SchemaView } from "./schema-view";

/** The contract as the running server has it. */
async function contract(): Promise<Contract> {
    const response = await fetch(at("/openapi.json"));
    if (!response.ok) throw new Error(`HTTP ${response.status}`);
    return response.json();
}

export function Reference() {
    const { data, error } = useLoad(contract, []);
    return (
        <>
            <header class="top">
                <div class="top-inner">
                    <a class="brand" href={at("/")}>
                        <img src={at("/favicon.svg")} alt="" />
                        visage
                    </a>
                    <nav aria-label={t.nav.label}>
                        <a href={at("/")}>{t.reference.back}</a>
                        <a href={at("/openapi.yaml")}>{t.reference.download}</a>
                    </nav>
                    <Settings />
                </div>
            </header>
            <main>
                <PageTitle title={t.reference.title} />
                <Trouble error={error} />
                {data ? <Contents contract={data} /> : !error && <Loading />}
            </main>
        </>
    );
}

function Contents({ contract }: { contract: Contract }) {
    const [wanted, setWanted] = useState("");
    const words = wanted.toLowerCase();
    const fits = (call: Call) =>
        `${call.method} ${call.path} ${call.operationId} ${call.summary}`.toLowerCase().includes(words);
    const groups = callsByTag(contract)
        .map(([tag, calls]) => [tag, calls.filter(fits)] as const)
        .filter(([, calls]) => calls.length > 0);
    // the address may name an operation that was not there when the browser looked
    useEffect(() => document.getElementById(location.hash.slice(1))?.scrollIntoView(), []);
    return (
        <>
            <div class="quiet">
                <Prose text={contract.info.description ?? ""} />
            </div>
            <div class="reference">
                <nav class="contents" aria-label={t.reference.contents}>
                    <TextField label={t.reference.filter} type="search" value={wanted} onInput={setWanted} />
                    {groups.map(([tag, calls]) => (
                        <div key={tag}>
                            <p class="label">{tag}</p>
                            {calls.map((call) => (
                                <a key={call.operationId} href={`#${call.operationId}`}>
                                    {call.summary}
                                </a>
                            ))}
                        </div>
                    ))}
                </nav>
                <div>
                    {groups.map(([tag, calls]) => (
                        <section key={tag} aria-label={tag}>
                            <h2>{tag}</h2>
                            {calls.map((call) => (
                                <OperationView key={call.operationId} contract={contract} call={call} />
                            ))}
                        </section>
                    ))}
                </div>
            </div>
        </>
    );
}

function OperationView({ contract, call }: { contract: Contract; call: Call }) {
    const [isOpen, setOpen] = useState(() => location.hash === `#${call.operationId}`);
    const body = Object.entries(call.requestBody?.content ?? {})[0];
    return (
        <article class="panel operation" id={call.operationId}>
            <h3>
                <span class={`method ${call.method}`}>{call.method.toUpperCase()}</span> <code>{call.path}</code>
            </h3>
            <p>{call.summary}</p>
            {call.description && (
                <div class="quiet small">
                    <Prose text={call.description} />
                </div>
            )}
            <details open={isOpen} onToggle={(event) => setOpen(event.currentTarget.open)}>
                <summary>
                    {t.reference.run} · {t.reference.answers}
                    <span class="unseen">: {call.operationId}</span>
                </summary>
                {isOpen && (
                    <div class="stack">
                        <Runner contract={contract} call={call} />
                        {body && (
                            <details>
                                <summary>
                                    {t.reference.body}: {body[0]}
                                </summary>
                                {call.requestBody?.description && <Prose text={call.requestBody.description} />}
                                <SchemaView contract={contract} schema={body[1].schema ?? {}} />
                            </details>
                        )}
                        <div>
                            <p class="label">{t.reference.answers}</p>
                            {Object.entries(call.responses).map(([status, answer]) => {
                                const [type, media] = Object.entries(answer.content ?? {})[0] ?? [];
                                const line = (
                                    <>
                                        <code>{status}</code> <Prose text={answer.description} />
                                    </>
                                );
                                return status.startsWith("2") && media?.schema ? (
                                    <details key={status}>
                                        <summary class="answer-line">
                                            {line} <span class="quiet small">{type}</span>
                                        </summary>
                                        <SchemaView contract={contract} schema={media.schema} />
                                    </details>
                                ) : (
                                    <div class="answer-line small quiet" key={status}>
                                        {line}
                                    </div>
                                );
                            })}
                        </div>
                    </div>
                )}
            </details>
        </article>
    );
}
