import { length } from "../lib/format";
import { t } from "../texts";
import { Check, Choice, Field } from "../ui/pieces";
import type { Cut } from "../viewer/scene";
import type { Bounds } from "../viewer/surface";

interface Props {
    cut: Cut | undefined;
    onChange: (cut: Cut | undefined) => void;
    /** Across which it is cut, if that is known, and in which unit. */
    across?: Bounds | undefined;
    unit: string;
}

/** Where the surface is cut open. */
export function CutControls({ cut, onChange, across, unit }: Props) {
    const axes = [["off", t.viewer.sectionOff] as const, ["0", "X"] as const, ["1", "Y"] as const, ["2", "Z"] as const];
    const choose = (value: (typeof axes)[number][0]) =>
        onChange(
            value === "off" ? undefined : { at: 0.5, isFlipped: false, ...cut, axis: Number(value) as Cut["axis"] },
        );
    return (
        <fieldset class="stack">
            <legend>{t.viewer.section}</legend>
            <Choice
                label={t.viewer.sectionAxis}
                value={cut ? (String(cut.axis) as "0" | "1" | "2") : "off"}
                choices={axes}
                onChange={choose}
            />
            {cut && (
                <>
                    <Field label={t.viewer.sectionAt}>
                        {(id) => (
                            <input
                                id={id}
                                type="range"
                                min={0}
                                max={1}
                                step={0.005}
                                value={cut.at}
                                onInput={(event) => onChange({ ...cut, at: event.currentTarget.valueAsNumber })}
                            />
                        )}
                    </Field>
                    {across && (
                        <p class="quiet small">
                            {"XYZ"[cut.axis]} = {length(placeOf(cut, across), unit)}
                        </p>
                    )}
                    <Check
                        label={t.viewer.sectionFlip}
                        isOn={cut.isFlipped}
                        onChange={(isFlipped) => onChange({ ...cut, isFlipped })}
                    />
                </>
            )}
        </fieldset>
    );
}

function placeOf({ axis, at }: Cut, [low, high]: Bounds): number {
    return low[axis] + (high[axis] - low[axis]) * at;
}
