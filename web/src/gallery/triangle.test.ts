import { expect, test } from "vitest";

import { triangleAddress, triangleOf } from "./triangle";

test("a triangle comes back from its address", () => {
    const toEye = [0, 0, 1] as const;
    const places = [
        [1, 2.5, -3],
        [4e-7, 5, 6],
        [7, 8, 9],
    ] as const;
    const address = triangleAddress(
        places.map((place) => ({ place, toEye })),
        "mm",
    );
    const query = new URLSearchParams(address.split("?")[1]);
    expect(triangleOf(query)).toEqual({ corners: places, outward: [0, 0, 3], unit: "mm" });
});

test("what was typed by hand is a triangle or is none", () => {
    const of = (text: string) => triangleOf(new URLSearchParams(text));
    expect(of("triangle=1,2,3&outward=0,0,1")).toBeUndefined();
    expect(of("triangle=1,2,3,4,5,6,7,8,x&outward=0,0,1")).toBeUndefined();
    expect(of("triangle=1,2,3,4,5,6,7,8,&outward=0,0,1")).toBeUndefined();
    expect(of("triangle=0,0,0,1,0,0,0,1,0&outward=0,0,1&unit=%3Cb%3E")?.unit).toBe("unknown");
});
