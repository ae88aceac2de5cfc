import { defineConfig } from "@playwright/test";

// Debian's Chromium; another one is named by CHROMIUM
const executablePath = process.env["CHROMIUM"] ?? "/usr/bin/chromium";

export default defineConfig({
    testDir: "e2e",
    // each file has a server of its own, and a registration takes what the machine has
    workers: 1,
    timeout: 180_000,
    expect: { timeout: 20_000 },
    reporter: [["list"]],
    outputDir: "test-results",
    use: {
        browserName: "chromium",
        trace: "retain-on-failure",
        launchOptions: {
            executablePath,
            args: [
                "--no-sandbox",
                "--disable-gpu",
                "--disable-quic",
                "--no-first-run",
                "--disable-background-networking",
                "--disable-component-update",
                "--disable-sync",
                "--use-gl=angle",
                "--use-angle=swiftshader",
                "--enable-unsafe-swiftshader",
            ],
        },
    },
});
