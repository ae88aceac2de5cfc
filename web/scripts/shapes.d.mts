export interface Ball {
    places: Float32Array;
    normals: Float32Array;
    triangles: Uint32Array | undefined;
}
export function ball(count: number, isMesh: boolean): Ball;
export function ply(ball: Ball): Uint8Array<ArrayBuffer>;
export function obj(ball: Ball): Uint8Array<ArrayBuffer>;
export function stl(ball: Ball): Uint8Array<ArrayBuffer>;
export function xyz(ball: Ball): Uint8Array<ArrayBuffer>;
