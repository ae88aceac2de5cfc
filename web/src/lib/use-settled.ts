import { useEffect, useState } from "preact/hooks";

const wait = 250;

/** A text once nobody has typed for a moment. */
export function useSettled(text: string): string {
    const [settled, setSettled] = useState(text);
    useEffect(() => {
        const timer = setTimeout(() => setSettled(text), wait);
        return () => clearTimeout(timer);
    }, [text]);
    return settled;
}
