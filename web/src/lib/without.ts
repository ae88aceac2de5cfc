/** The list without one of its items. */
export function without<T>(list: readonly T[], index: number): T[] {
    return list.filter((_, other) => other !== index);
}
