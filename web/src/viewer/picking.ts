import { Matrix4, Raycaster, Vector2, Vector3, type Camera, type Mesh, type Plane } from "three";

export interface Spot {
    /** Where on the screen, in pixels of the canvas. */
    x: number;
    y: number;
    width: number;
    height: number;
}

/** How far from the spot a point of a cloud may be to be meant, in pixels: a finger hides more than a pointer. */
const reach = 12;

/** The place of the mesh under the spot that is not cut away. */
export function pickMesh(mesh: Mesh, spot: Spot, camera: Camera, cut: Plane | undefined): Vector3 | undefined {
    const raycaster = new Raycaster();
    raycaster.setFromCamera(new Vector2((spot.x / spot.width) * 2 - 1, 1 - (spot.y / spot.height) * 2), camera);
    const hits = raycaster.intersectObject(mesh, false);
    return hits.find(({ point }) => !cut || cut.distanceToPoint(point) >= 0)?.point;
}

/** The nearest of the points about the spot: of those close to it the one in front. */
export function pickCloud(
    positions: Float32Array,
    shown: Uint32Array,
    spot: Spot,
    camera: Camera,
    cut: Plane | undefined,
): Vector3 | undefined {
    const m = new Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse).elements;
    const normal = cut?.normal ?? new Vector3();
    let best = -1;
    let bestRank = Infinity;
    for (const index of shown) {
        const [x, y, z] = [
            positions[index * 3] as number,
            positions[index * 3 + 1] as number,
            positions[index * 3 + 2] as number,
        ];
        const w = m[3] * x + m[7] * y + m[11] * z + m[15];
        if (w <= 0) continue;
        const dx = ((m[0] * x + m[4] * y + m[8] * z + m[12]) / w / 2 + 0.5) * spot.width - spot.x;
        const dy = (0.5 - (m[1] * x + m[5] * y + m[9] * z + m[13]) / w / 2) * spot.height - spot.y;
        const distance = Math.hypot(dx, dy);
        if (distance > reach) continue;
        if (cut && normal.x * x + normal.y * y + normal.z * z + cut.constant < 0) continue;
        // a pixel off weighs as much as a thousandth of the way to the eye: the back of a thing is never meant
        const rank = w * (1 + distance / 1000);
        if (rank < bestRank) [best, bestRank] = [index, rank];
    }
    return best < 0 ? undefined : new Vector3(positions[best * 3], positions[best * 3 + 1], positions[best * 3 + 2]);
}
