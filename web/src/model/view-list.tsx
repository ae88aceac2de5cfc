import { t } from "../texts";

interface Props {
    names: readonly string[];
    hidden: ReadonlySet<number>;
    colourOf: ((index: number) => string) | undefined;
    onChange: (hidden: ReadonlySet<number>) => void;
}

/** Which scans are shown. */
export function ViewList({ names, hidden, colourOf, onChange }: Props) {
    const toggle = (index: number, isOn: boolean) => {
        const next = new Set(hidden);
        if (isOn) next.delete(index);
        else next.add(index);
        onChange(next);
    };
    return (
        <div role="group" aria-label={t.viewer.views}>
            <div class="row spread">
                <span class="label">{t.viewer.views}</span>
                <span class="row">
                    <button type="button" class="bare" onClick={() => onChange(new Set())}>
                        {t.viewer.allViews}
                    </button>
                    <button type="button" class="bare" onClick={() => onChange(new Set(names.keys()))}>
                        {t.viewer.noViews}
                    </button>
                </span>
            </div>
            <div class="views">
                {names.map((name, index) => (
                    <label class="check" key={name}>
                        <input
                            type="checkbox"
                            checked={!hidden.has(index)}
                            onChange={(event) => toggle(index, event.currentTarget.checked)}
                        />
                        {colourOf && <span class="swatch" style={{ background: colourOf(index) }} />}
                        <span>{name}</span>
                    </label>
                ))}
            </div>
        </div>
    );
}
