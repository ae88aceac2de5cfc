import { Fragment } from "preact";

import { t } from "../texts";
import { followed, typeOf, type Contract, type Schema } from "./contract";
import { Prose } from "./prose";

/** So deep fields are opened: below it their types are named. */
const deepest = 3;

/** The fields of a body or an answer. */
export function SchemaView({
    contract,
    schema: given,
    depth = 0,
}: {
    contract: Contract;
    schema: Schema;
    depth?: number;
}) {
    const { schema } = followed(contract, given);
    const parts = schema.allOf ?? [];
    const inner = schema.items ?? (schema.oneOf ?? schema.anyOf)?.find((choice) => choice.type !== "null");
    return (
        <>
            {parts.map((part, index) => (
                <SchemaView key={index} contract={contract} schema={part} depth={depth} />
            ))}
            {schema.properties && (
                <ul class="plain schema">
                    {Object.entries(schema.properties).map(([name, property]) => (
                        <li key={name}>
                            <code>
                                <strong>{name}</strong>
                            </code>{" "}
                            <span class="quiet small">
                                {typeOf(contract, property)}
                                {schema.required?.includes(name) ? ` · ${t.reference.required}` : ""}
                            </span>
                            {property.description && (
                                <div class="small">
                                    <Prose text={property.description} />
                                </div>
                            )}
                            {depth + 1 < deepest && hasFields(contract, property) && (
                                <details>
                                    <summary class="small">{typeOf(contract, property)}</summary>
                                    <SchemaView contract={contract} schema={property} depth={depth + 1} />
                                </details>
                            )}
                        </li>
                    ))}
                </ul>
            )}
            {!schema.properties && inner && <SchemaView contract={contract} schema={inner} depth={depth} />}
            {!schema.properties && !inner && parts.length === 0 && (
                <Fragment>
                    <code class="small">{typeOf(contract, given)}</code>
                </Fragment>
            )}
        </>
    );
}

function hasFields(contract: Contract, given: Schema): boolean {
    const { schema } = followed(contract, given);
    if (schema.properties || schema.allOf) return true;
    const inner = schema.items ?? (schema.oneOf ?? schema.anyOf)?.find((choice) => choice.type !== "null");
    return inner !== undefined && hasFields(contract, inner);
}
