// The scans that a client sends: `head/*.ply` and `head/rough.json` of `visage demo --out`.
import { readFile, readdir } from "node:fs/promises";
import { join } from "node:path";

export type Scans = { scans: File[]; poses: File };

export async function read(folder: string): Promise<Scans> {
  const head = join(folder, "head");
  const file = async (name: string) => new File([await readFile(join(head, name))], name);
  const names = (await readdir(head)).filter((name) => name.endsWith(".ply")).sort();
  return { scans: await Promise.all(names.map(file)), poses: await file("rough.json") };
}

type Row = [number, number, number, number];
export const identity: [Row, Row, Row, Row] = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]];
