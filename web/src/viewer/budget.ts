/** So many points are drawn while the view moves, and never more: a phone has to keep up. */
export const mostWhileMoving = 300_000;
/** Fewer would not show what it is. */
export const leastWhileMoving = 15_000;
/** A picture that has to wait longer than this is too slow: ten a second are wanted. */
const slow = 90;
/** One that has to wait no longer than this could have had more on it. */
const fast = 40;
/** What was too much once is kept away from. */
const caution = 0.8;

/** How many points are drawn while the view moves: as many as this machine can draw ten times a second. */
export class Budget {
    points = mostWhileMoving;
    private ceiling = mostWhileMoving;

    /** The last picture of a movement was ready so many milliseconds after it had been wanted. */
    waited(milliseconds: number): void {
        if (milliseconds > slow) {
            this.ceiling = Math.max(leastWhileMoving, this.points * caution);
            this.points = Math.max(leastWhileMoving, this.points * Math.max(0.25, (slow * caution) / milliseconds));
        } else if (milliseconds < fast) {
            this.points = Math.min(this.ceiling, this.points * 1.15);
        }
    }
}
