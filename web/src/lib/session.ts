import { api, ok, type Schema } from "../api/client";
import { createStore } from "./store";

/** Who one is to the server; nothing until it has said so. Without a scope a key has to be shown first. */
export const session = createStore<Schema["Session"] | undefined>(undefined);

/** Asks who one is. */
export async function look(): Promise<void> {
    session.set(await ok(api.GET("/v1/session")));
}

/** Shows a key once; from then on the browser is known by a cookie that no script can read. */
export async function signIn(key: string): Promise<void> {
    session.set(await ok(api.POST("/v1/session", { headers: { Authorization: `Bearer ${key}` } })));
}

/** Ends the session, here and on the server. */
export async function signOut(): Promise<void> {
    await ok(api.DELETE("/v1/session"));
    await look();
}

// a session may end while the page is open
api.use({
    onResponse({ response, schemaPath }) {
        if (response.status === 401 && schemaPath !== "/v1/session") look().catch(() => undefined);
    },
});
