import { api, ok } from "../api/client";
import { useLoad } from "./use-load";

/** Limits, formats and options of the server. */
export function useInfo() {
    return useLoad(() => ok(api.GET("/v1/info")), []);
}
