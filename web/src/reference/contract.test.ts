import { expect, test } from "vitest";

import { addressOf, callsByTag, curl, exampleBodies, typeOf, type Call, type Contract } from "./contract";

const contract: Contract = {
    info: { title: "t", version: "1" },
    tags: [{ name: "jobs" }, { name: "nothing" }],
    paths: { "/v1/jobs/{id}": { get: { operationId: "getJob", tags: ["jobs"], responses: {} } } },
    components: {
        schemas: {
            Unit: { enum: ["mm", "m"] },
            Job: {
                type: "object",
                required: ["id"],
                properties: { id: { type: "string", example: "x" }, more: { type: "string" } },
            },
        },
    },
};
const call: Call = {
    operationId: "x",
    method: "get",
    path: "/v1/jobs/{id}",
    parameters: [
        { name: "id", in: "path" },
        { name: "wait", in: "query" },
    ],
    responses: {},
};

test("operations stand under their tags", () => {
    expect(
        callsByTag(contract).map(([tag, calls]) => [tag, calls.map(({ method, path }) => `${method} ${path}`)]),
    ).toEqual([["jobs", ["get /v1/jobs/{id}"]]]);
});

test("types are told in a few words, references followed", () => {
    expect(typeOf(contract, { $ref: "#/components/schemas/Unit" })).toBe('"mm" | "m"');
    expect(typeOf(contract, { type: "array", items: { $ref: "#/components/schemas/Job" } })).toBe("Job[]");
    expect(typeOf(contract, { type: ["number", "null"] })).toBe("number | null");
});

test("addresses and commands are such that they run", () => {
    expect(addressOf(call, { id: "a/b", wait: "3" })).toBe("/v1/jobs/a%2Fb?wait=3");
    expect(curl(contract, call, { id: "1", wait: "3" }, undefined, "http://h")).toBe(
        "curl 'http://h/v1/jobs/1?wait=3'",
    );
    const post: Call = {
        ...call,
        method: "post",
        path: "/v1/queries",
        requestBody: { content: { "application/json": {} } },
    };
    expect(curl(contract, post, {}, '{"name": "it\'s"}', "http://h")).toBe(
        `curl -X POST http://h/v1/queries -H 'content-type: application/json' -d '{"name": "it'\\''s"}'`,
    );
});

test("a body begins with what is required", () => {
    const bodies = exampleBodies(contract, { schema: { $ref: "#/components/schemas/Job" } });
    expect(bodies.map(([name, body]) => [name, JSON.parse(body)])).toEqual([["", { id: "x" }]]);
    expect(
        exampleBodies(contract, { examples: { one: { value: 1 }, two: { value: 2 } } }).map(([name]) => name),
    ).toEqual(["one", "two"]);
});
