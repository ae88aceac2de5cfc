import { Unreadable } from "./ply-header";
import type { Surface } from "./surface";

/** Reads the first three numbers of each line; lines of words are passed over. */
export function readXyz(buffer: ArrayBuffer): Surface {
    const found: number[] = [];
    for (const line of new TextDecoder().decode(buffer).split("\n")) {
        const numbers = line
            .trim()
            .split(/[\s,;]+/)
            .slice(0, 3)
            .map((word) => (word === "" ? NaN : Number(word)));
        if (numbers.length === 3 && numbers.every(Number.isFinite)) found.push(...numbers);
    }
    if (found.length === 0) throw new Unreadable("the file holds no points");
    const origin: [number, number, number] = [found[0] as number, found[1] as number, found[2] as number];
    const positions = Float32Array.from(found, (value, index) => value - (origin[index % 3] as number));
    return { origin, positions };
}
