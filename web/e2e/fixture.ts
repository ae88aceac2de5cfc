import { AxeBuilder } from "@axe-core/playwright";
import { expect, test as base, type Page } from "@playwright/test";

import { Server } from "./server";

interface Watch {
    /** What the console has said that it should not, and who was asked that is not the server. */
    faults: string[];
    /** Browsers tell of each answer that is an error and of each that did not come: these are wanted. */
    allow(text: RegExp): void;
}

/** A server for those who ask for one, as long as they need it. */
async function serve({}, use: (server: Server) => Promise<void>): Promise<void> {
    const server = new Server();
    await server.start();
    await use(server);
    await server.remove();
}

/** Tests with a server for each file, and a page that is watched. */
export const test = base.extend<{ watch: Watch }, { server: Server }>({
    server: [serve, { scope: "worker" }],
    baseURL: async ({ server }, use) => use(server.url),
    watch: [
        async ({ page, server }, use) => {
            const faults: string[] = [];
            const wanted: RegExp[] = [];
            page.on("console", (message) => {
                // a model may be deleted while its thumbnail is asked for: the page shows a sign instead
                if (message.location().url.includes("/pictures/thumbnail")) return;
                if (message.type() === "error" && !wanted.some((text) => text.test(message.text())))
                    faults.push(message.text());
            });
            page.on("pageerror", (error) => faults.push(String(error)));
            page.on("request", (request) => {
                const url = new URL(request.url());
                if (url.protocol.startsWith("http") && url.origin !== server.url) faults.push(`asked ${request.url()}`);
            });
            await use({ faults, allow: (text) => void wanted.push(text) });
            expect(faults).toEqual([]);
        },
        { auto: true },
    ],
});

/** Tests with a server that no other file has: what is done to it stays. */
export const alone = test.extend<object, { server: Server }>({ server: [serve, { scope: "worker" }] });

export { expect };

/** Nothing that axe knows stands in the way of people who can't see, hear or point. */
export async function expectAccessible(page: Page): Promise<void> {
    const { violations } = await new AxeBuilder({ page }).analyze();
    expect(
        violations.map(({ id, nodes }) => `${id}: ${nodes.map((node) => node.html.slice(0, 120)).join(" | ")}`),
    ).toEqual([]);
}

/** Nothing is wider than the screen. */
export async function expectFits(page: Page): Promise<void> {
    const [content, screen] = await page.evaluate(() => [
        document.documentElement.scrollWidth,
        document.documentElement.clientWidth,
    ]);
    expect(content).toBeLessThanOrEqual(screen ?? 0);
}

/** How often the surface was drawn. */
export function drawn(page: Page): Promise<number> {
    return page
        .locator(".viewer canvas")
        .first()
        .evaluate((canvas) => Number((canvas as HTMLElement).dataset["drawn"] ?? 0));
}

/** A surface is on the screen. */
export async function expectSurface(page: Page): Promise<void> {
    const canvas = page.locator(".viewer canvas").first();
    await expect(canvas).toHaveAttribute("data-ready", "yes");
    await expect.poll(() => drawn(page)).toBeGreaterThan(0);
}
