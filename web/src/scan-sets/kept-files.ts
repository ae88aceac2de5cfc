/** Files that were stored from this page, by set and scan: hints can show them, since the server does not give scans back. */
const kept = new Map<string, File>();

const key = (set: string, scan: string) => `${set}/${scan}`;

export function keepFile(set: string, scan: string, file: File): void {
    kept.set(key(set, scan), file);
}

export function keptFile(set: string, scan: string): File | undefined {
    return kept.get(key(set, scan));
}
