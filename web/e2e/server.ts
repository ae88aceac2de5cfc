import { spawn, spawnSync, type ChildProcess } from "node:child_process";
import { existsSync, mkdtempSync, readdirSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { createInterface } from "node:readline";

/** The program that is tried: `VISAGE_BIN`, or what was built last. */
const program = process.env["VISAGE_BIN"] ?? new URL("../../target/debug/visage", import.meta.url).pathname;

/** A server of its own, in a folder of its own. */
export class Server {
    private process: ChildProcess | undefined;
    private readonly folder = mkdtempSync(join(tmpdir(), "visage-page-"));
    url = "";

    /** Starts it, on the port that it had before if it had one. */
    async start(): Promise<void> {
        const address = this.url ? new URL(this.url).host : "127.0.0.1:0";
        const settings = ["--bin-days", "7", "--log", "warn"];
        this.process = spawn(program, ["serve", "--addr", address, "--data", this.folder, ...settings], {
            stdio: ["ignore", "pipe", "inherit"],
        });
        const lines = createInterface({ input: this.process.stdout! });
        for await (const line of lines) {
            const found = /^listening on (\S+)/.exec(line);
            if (!found?.[1]) continue;
            this.url = found[1];
            return;
        }
        throw new Error(`${program} ended before it listened`);
    }

    /** Makes a key: from then on nobody is let in without one. */
    key(scope: "read" | "write"): string {
        const made = spawnSync(program, [
            "key",
            "create",
            "--name",
            "a reader",
            "--scope",
            scope,
            "--data",
            this.folder,
        ]);
        if (made.status !== 0) throw new Error(String(made.stderr));
        return String(made.stdout).trim();
    }

    /** Stops it, in order or as a crash would. */
    async stop(signal: "SIGTERM" | "SIGKILL" = "SIGTERM"): Promise<void> {
        const ended = new Promise((resolve) => this.process?.once("exit", resolve));
        this.process?.kill(signal);
        await ended;
    }

    /** Stops it for good. */
    async remove(): Promise<void> {
        await this.stop();
        rmSync(this.folder, { recursive: true, force: true });
    }
}

/** The folder of code-made scans: `VISAGE_DEMO`, or made once beside the other results of tests. */
export function demo(): string {
    const given = process.env["VISAGE_DEMO"];
    const folder = given ?? join(tmpdir(), "visage-page-demo");
    if (!existsSync(join(folder, "head"))) {
        const made = spawnSync(program, ["demo", "--out", folder], { stdio: "inherit" });
        if (made.status !== 0) throw new Error("visage demo failed");
    }
    return folder;
}

/** The eight scans of the head that has a face. */
export function scansOfHead(): string[] {
    const folder = join(demo(), "head");
    return readdirSync(folder)
        .filter((name) => name.endsWith(".ply"))
        .sort()
        .map((name) => join(folder, name));
}
