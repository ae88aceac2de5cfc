/** Below this share nothing can be said of the rest. */
const leastKnown = 0.05;

/** Seconds until the end if it goes on as it went: `progress` runs from 0 to 1 over all stages and never falls. */
export function secondsLeft(progress: number, elapsed: number): number | undefined {
    if (progress < leastKnown || progress >= 1 || elapsed <= 0) return undefined;
    return (elapsed * (1 - progress)) / progress;
}
