import type { Place } from "./marker-types";

/** From where something is looked at, in the frame of the model. */
export interface View {
    eye: Place;
    target: Place;
}

/** What shows a model, and can be looked at from elsewhere. */
export interface Linked {
    /** The ball about what it shows. */
    ball(): { center: Place; radius: number };
    view(): View;
    lookFrom(view: View): void;
}

/** Several viewers that look from the same side: whichever is moved, the others follow. */
export class CameraLink {
    private readonly members = new Set<Linked>();
    private isPassing = false;

    /** In one frame places are the same for all; else each looks at its own model from as far, in its size. */
    constructor(readonly isOneFrame: boolean) {}

    /** Who comes looks from where the others do. */
    join(member: Linked): void {
        const [other] = this.members;
        if (other) this.moved(other, other.view(), [member]);
        this.members.add(member);
    }

    leave(member: Linked): void {
        this.members.delete(member);
    }

    /** A member was moved. What the others do then is no movement of theirs. */
    moved(from: Linked, view: View, followers: Iterable<Linked> = this.members): void {
        if (this.isPassing) return;
        this.isPassing = true;
        for (const member of followers) if (member !== from) member.lookFrom(this.seenBy(member, from, view));
        this.isPassing = false;
    }

    private seenBy(member: Linked, from: Linked, view: View): View {
        if (this.isOneFrame) return view;
        const [its, others] = [member.ball(), from.ball()];
        const factor = its.radius / others.radius;
        const moved = (place: Place) =>
            [0, 1, 2].map(
                (axis) =>
                    (its.center[axis] as number) + ((place[axis] as number) - (others.center[axis] as number)) * factor,
            ) as unknown as Place;
        return { eye: moved(view.eye), target: moved(view.target) };
    }
}
