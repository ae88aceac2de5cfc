import { defineConfig } from "vitest/config";

// where the server listens while the page is worked on (`npm run dev`)
const server = process.env["VISAGE_URL"] ?? "http://127.0.0.1:8080";

export default defineConfig({
    // the page is served at / or below a path: what it loads stands beside it
    base: "./",
    oxc: { jsx: { runtime: "automatic", importSource: "preact" } },
    build: {
        target: "es2022",
        // the licences of what is bundled go with it
        license: { fileName: "licenses.txt" },
        // nothing may stand in the text as a data address or an inline script: the policy of the server forbids it
        assetsInlineLimit: 0,
        modulePreload: { polyfill: false },
        rolldownOptions: { input: ["index.html", "docs.html"] },
        // three.js is what it is, and comes only with the first model
        chunkSizeWarningLimit: 900,
    },
    worker: { format: "es" },
    server: { proxy: { "/v1": server, "/openapi.json": server, "/healthz": server } },
    test: { include: ["src/**/*.test.ts"] },
});
