import type { ComponentChildren } from "preact";
import { useEffect, useRef } from "preact/hooks";

import { BinPage } from "./bin/page";
import { ComparePage } from "./compare/page";
import { Gallery } from "./gallery/gallery";
import { EvaluationPage } from "./gallery/evaluation";
import { StandardsPage } from "./gallery/standards";
import { HintsPage } from "./hints/page";
import { JobPage } from "./jobs/job";
import { JobList } from "./jobs/list";
import { at } from "./lib/address";
import { announce, announcement } from "./lib/announce";
import { connection } from "./lib/connection";
import { href, place, type Place } from "./lib/router";
import { look, session, signOut } from "./lib/session";
import { useStore } from "./lib/store";
import { ModelPage } from "./model/page";
import { ScanSetList } from "./scan-sets/list";
import { ScanSetPage } from "./scan-sets/scan-set";
import { t } from "./texts";
import { PageTitle } from "./ui/pieces";
import { Settings } from "./ui/settings";
import { SignIn } from "./ui/sign-in";

export function App() {
    const where = useStore(place);
    const who = useStore(session);
    const { epoch } = useStore(connection);
    useEffect(() => {
        // without an answer there is a banner, and the server is asked again when it is back
        look().catch(() => undefined);
    }, [epoch]);
    const content = who?.scope ? page(where) : who ? <SignIn /> : <p>{t.loading}</p>;
    return (
        <Frame current={where.parts[0] ?? "scan-sets"}>
            <div key={who?.scope ? where.parts.join("/") : "sign-in"}>{content}</div>
        </Frame>
    );
}

/** The table of contents: which address shows what. */
function page({ parts, query }: Place): ComponentChildren {
    const [kind, id, more] = parts;
    if (kind === undefined) return <ScanSetList />;
    if (kind === "scan-sets")
        return id === undefined ? <ScanSetList /> : more === "hints" ? <HintsPage id={id} /> : <ScanSetPage id={id} />;
    if (kind === "jobs") return id === undefined ? <JobList /> : <JobPage id={id} />;
    if (kind === "models" && id !== undefined) return <ModelPage id={id} query={query} />;
    if (kind === "compare") return <ComparePage query={query} />;
    if (kind === "gallery") return <Gallery query={query} />;
    if (kind === "evaluation") return <EvaluationPage />;
    if (kind === "bin") return <BinPage />;
    if (kind === "standards") return <StandardsPage />;
    return <PageTitle title={t.notFound} />;
}

function Frame({ current, children }: { current: string; children: ComponentChildren }) {
    const spoken = useStore(announcement);
    const { isLost, epoch } = useStore(connection);
    const who = useStore(session);
    const content = useRef<HTMLElement>(null);
    useEffect(() => {
        if (epoch > 0) announce(t.back);
    }, [epoch]);
    const skip = (event: Event) => {
        event.preventDefault();
        content.current?.querySelector<HTMLElement>("h1")?.focus();
    };
    const areas: [string, string, string][] = [
        ["scan-sets", t.nav.scanSets, href("scan-sets")],
        ["jobs", t.nav.jobs, href("jobs")],
        ["gallery", t.nav.gallery, href("gallery")],
        ["standards", t.nav.standards, href("standards")],
    ];
    const isIn = (area: string) =>
        area === current || (area === "gallery" && ["models", "compare", "evaluation"].includes(current));
    return (
        <>
            <a class="skip" href="#content" onClick={skip}>
                {t.skip}
            </a>
            <header class="top">
                <div class="top-inner">
                    <a class="brand" href={href("scan-sets")}>
                        <img src={at("/favicon.svg")} alt="" />
                        visage
                    </a>
                    <nav aria-label={t.nav.label}>
                        {areas.map(([area, text, address]) => (
                            <a key={area} href={address} aria-current={isIn(area) ? "page" : undefined}>
                                {text}
                            </a>
                        ))}
                        <a href={at("/docs")}>{t.nav.docs}</a>
                    </nav>
                    <Settings />
                    {who?.key && (
                        <button type="button" title={who.key} onClick={() => void signOut()}>
                            {t.signIn.out}
                        </button>
                    )}
                </div>
            </header>
            {isLost && (
                <div class="banner" role="alert">
                    {t.lost}
                </div>
            )}
            <main ref={content} id="content" tabIndex={-1}>
                {children}
            </main>
            <footer>
                <a href={href("bin")}>{t.bin.title}</a> <a href={at("/licenses.txt")}>{t.licences}</a>
            </footer>
            <div class="unseen" role="status" aria-live="polite">
                {spoken}
            </div>
        </>
    );
}
