import { t } from "../texts";
import { Check } from "../ui/pieces";

export interface ShownBeside {
    scanners: boolean;
    landmarks: boolean;
    triangle: boolean;
}

interface Props {
    /** Which of them the model has. */
    has: ShownBeside;
    shown: ShownBeside;
    onChange: (shown: ShownBeside) => void;
}

const kinds = ["scanners", "landmarks", "triangle"] as const;

/** What stands beside the surface. */
export function ShownControls({ has, shown, onChange }: Props) {
    return (
        <>
            {kinds
                .filter((kind) => has[kind])
                .map((kind) => (
                    <Check
                        key={kind}
                        label={t.viewer[kind]}
                        isOn={shown[kind]}
                        onChange={(isOn) => onChange({ ...shown, [kind]: isOn })}
                    />
                ))}
        </>
    );
}
