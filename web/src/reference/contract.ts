/** As much of OpenAPI 3.1 as the contract of visage uses. */
export interface Schema {
    $ref?: string;
    type?: string | string[];
    format?: string;
    description?: string;
    enum?: unknown[];
    default?: unknown;
    example?: unknown;
    examples?: unknown[];
    minimum?: number;
    maximum?: number;
    required?: string[];
    properties?: Record<string, Schema>;
    additionalProperties?: boolean | Schema;
    items?: Schema;
    oneOf?: Schema[];
    anyOf?: Schema[];
    allOf?: Schema[];
    contentEncoding?: string;
    contentMediaType?: string;
}

export interface Media {
    schema?: Schema;
    example?: unknown;
    examples?: Record<string, { value?: unknown }>;
}

export interface Parameter {
    name: string;
    in: "query" | "path" | "header";
    description?: string;
    required?: boolean;
    schema?: Schema;
    example?: unknown;
}

export interface Answer {
    description: string;
    content?: Record<string, Media>;
}

export interface Operation {
    operationId: string;
    tags?: string[];
    summary?: string;
    description?: string;
    parameters?: Parameter[];
    requestBody?: { description?: string; content: Record<string, Media> };
    responses: Record<string, Answer>;
}

export interface Contract {
    info: { title: string; version: string; description?: string };
    tags?: { name: string; description?: string }[];
    paths: Record<string, Record<string, Operation>>;
    components: { schemas: Record<string, Schema> };
}

export interface Call extends Operation {
    method: string;
    path: string;
}

const methods = ["get", "head", "options", "post", "put", "patch", "delete"];

/** Whether a call leaves everything as it is. */
export function isSafe(call: Call): boolean {
    return ["get", "head", "options"].includes(call.method);
}

/** Every operation, by its tag, in the order of the contract. */
export function callsByTag(contract: Contract): [string, Call[]][] {
    const groups = new Map<string, Call[]>((contract.tags ?? []).map((tag) => [tag.name, []]));
    for (const [path, item] of Object.entries(contract.paths)) {
        for (const method of methods) {
            const operation = item[method];
            if (!operation) continue;
            const tag = operation.tags?.[0] ?? "";
            groups.set(tag, [...(groups.get(tag) ?? []), { ...operation, method, path }]);
        }
    }
    return [...groups].filter(([, calls]) => calls.length > 0);
}

/** The schema that a reference names. */
export function followed(contract: Contract, schema: Schema): { schema: Schema; name?: string } {
    const name = schema.$ref?.split("/").at(-1);
    const found = name === undefined ? undefined : contract.components.schemas[name];
    return name !== undefined && found ? { schema: found, name } : { schema };
}

/** A type in a few words. */
export function typeOf(contract: Contract, given: Schema): string {
    const { schema, name } = followed(contract, given);
    if (schema.enum) return schema.enum.map((value) => JSON.stringify(value)).join(" | ");
    if (name) return name;
    const choices = schema.oneOf ?? schema.anyOf;
    if (choices) return choices.map((choice) => typeOf(contract, choice)).join(" | ");
    if (schema.allOf) return schema.allOf.map((part) => typeOf(contract, part)).join(" & ");
    if (schema.items) return `${typeOf(contract, schema.items)}[]`;
    const types = [schema.type ?? "any"].flat().join(" | ");
    return schema.format ? `${types} (${schema.format})` : types;
}

/** JSON bodies to begin with: the contract's own examples by name, else one of the required fields. */
export function exampleBodies(contract: Contract, media: Media): [string, string][] {
    const written = (value: unknown) => JSON.stringify(value, null, 2);
    if (media.examples) return Object.entries(media.examples).map(([name, { value }]) => [name, written(value)]);
    return [["", written(media.example ?? exampleOf(contract, media.schema ?? {}, 3))]];
}

function exampleOf(contract: Contract, given: Schema, depth: number): unknown {
    const { schema } = followed(contract, given);
    if (schema.example !== undefined) return schema.example;
    if (schema.examples?.[0] !== undefined) return schema.examples[0];
    if (schema.default !== undefined) return schema.default;
    if (schema.enum) return schema.enum[0];
    const first = (schema.oneOf ?? schema.anyOf)?.[0];
    if (first) return exampleOf(contract, first, depth);
    if (depth === 0) return null;
    if (schema.items) return [];
    if (schema.properties) {
        const wanted = Object.entries(schema.properties).filter(([name]) => schema.required?.includes(name));
        return Object.fromEntries(wanted.map(([name, property]) => [name, exampleOf(contract, property, depth - 1)]));
    }
    const type = [schema.type].flat()[0];
    return { string: "", integer: 0, number: 0, boolean: false, object: {} }[type ?? ""] ?? null;
}

/** An address with its parameters filled in; empty ones are left out, in the path they stand as their names. */
export function addressOf(call: Pick<Call, "path" | "parameters">, values: Record<string, string>): string {
    const filled = call.path.replace(/\{(\w+)\}/g, (whole, name: string) =>
        values[name] ? encodeURIComponent(values[name]) : whole,
    );
    const query = (call.parameters ?? []).filter((parameter) => parameter.in === "query" && values[parameter.name]);
    const text = new URLSearchParams(
        query.map((parameter) => [parameter.name, values[parameter.name] ?? ""]),
    ).toString();
    return text ? `${filled}?${text}` : filled;
}

/** The same call for a shell. */
export function curl(
    contract: Contract,
    call: Call,
    values: Record<string, string>,
    body: string | undefined,
    origin: string,
): string {
    const parts = ["curl"];
    // after `-X HEAD` curl would wait for a body that does not come
    if (call.method === "head") parts.push("--head");
    else if (call.method !== "get") parts.push("-X", call.method.toUpperCase());
    parts.push(quoted(origin + addressOf(call, values)));
    const [type, media] = Object.entries(call.requestBody?.content ?? {})[0] ?? [];
    if (type === "application/json" && body !== undefined) {
        parts.push("-H", quoted("content-type: application/json"), "-d", quoted(body.replace(/\s*\n\s*/g, " ")));
    } else if (type === "multipart/form-data") {
        const { schema } = followed(contract, media?.schema ?? {});
        const required = Object.entries(schema.properties ?? {}).filter(
            ([name]) => schema.required?.includes(name) ?? false,
        );
        for (const [name, property] of required)
            parts.push("-F", quoted(isFile(property) ? `${name}=@FILE` : `${name}=VALUE`));
    } else if (type) {
        parts.push("--data-binary", "@FILE");
    }
    if (Object.keys(call.responses["200"]?.content ?? {}).some((name) => name === "text/event-stream"))
        parts.splice(1, 0, "-N");
    return parts.join(" ");
}

function isFile(schema: Schema): boolean {
    const inner = schema.items ?? schema;
    return inner.format === "binary" || inner.contentMediaType !== undefined || inner.contentEncoding !== undefined;
}

function quoted(text: string): string {
    return /^[\w:/.@=?&%-]+$/.test(text) && !/[?&]/.test(text) ? text : `'${text.replaceAll("'", `'\\''`)}'`;
}
