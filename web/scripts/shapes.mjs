// Code-made surfaces of any size, as files: what thumbnails and first views are measured with.

/** A ball with waves on it: places, outward directions, and triangles if it is to be a mesh. */
export function ball(count, isMesh) {
    const rows = Math.max(3, Math.round(Math.sqrt(count / (isMesh ? 4 : 2))));
    const columns = 2 * rows;
    const places = new Float32Array(3 * rows * columns);
    const normals = new Float32Array(3 * rows * columns);
    for (let row = 0, at = 0; row < rows; row += 1) {
        const polar = (Math.PI * (row + 0.5)) / rows;
        for (let column = 0; column < columns; column += 1, at += 3) {
            const around = (2 * Math.PI * column) / columns;
            const direction = [Math.sin(polar) * Math.cos(around), Math.cos(polar), Math.sin(polar) * Math.sin(around)];
            const radius = 80 + 6 * Math.sin(5 * around) * Math.sin(4 * polar);
            normals.set(direction, at);
            places.set(
                direction.map((x) => x * radius),
                at,
            );
        }
    }
    if (!isMesh) return { places, normals, triangles: undefined };
    const triangles = new Uint32Array(6 * (rows - 1) * columns);
    for (let row = 0, at = 0; row + 1 < rows; row += 1) {
        for (let column = 0; column < columns; column += 1, at += 6) {
            const [a, b] = [row * columns + column, row * columns + ((column + 1) % columns)];
            triangles.set([a, b, a + columns, b, b + columns, a + columns], at);
        }
    }
    return { places, normals, triangles };
}

/** Binary PLY; clouds have normals. */
export function ply({ places, normals, triangles }) {
    const points = places.length / 3;
    const faces = triangles ? triangles.length / 3 : 0;
    const names = triangles ? ["x", "y", "z"] : ["x", "y", "z", "nx", "ny", "nz"];
    const header = [
        "ply",
        "format binary_little_endian 1.0",
        `element vertex ${points}`,
        ...names.map((name) => `property float ${name}`),
        ...(triangles ? [`element face ${faces}`, "property list uchar int vertex_indices"] : []),
        "end_header\n",
    ].join("\n");
    const bytes = Buffer.alloc(header.length + 4 * names.length * points + 13 * faces);
    bytes.write(header, "latin1");
    let at = header.length;
    for (let point = 0; point < points; point += 1) {
        for (const values of triangles ? [places] : [places, normals])
            for (let axis = 0; axis < 3; axis += 1) at = bytes.writeFloatLE(values[3 * point + axis], at);
    }
    for (let face = 0; face < faces; face += 1) {
        at = bytes.writeUInt8(3, at);
        for (let corner = 0; corner < 3; corner += 1) at = bytes.writeInt32LE(triangles[3 * face + corner], at);
    }
    return bytes;
}

/** The same as lines of text. */
export function obj({ places, triangles }) {
    const lines = [];
    for (let at = 0; at < places.length; at += 3)
        lines.push(`v ${places[at].toFixed(4)} ${places[at + 1].toFixed(4)} ${places[at + 2].toFixed(4)}`);
    for (let at = 0; at < triangles.length; at += 3)
        lines.push(`f ${triangles[at] + 1} ${triangles[at + 1] + 1} ${triangles[at + 2] + 1}`);
    return Buffer.from(`${lines.join("\n")}\n`);
}

/** Each triangle by itself. */
export function stl({ places, triangles }) {
    const faces = triangles.length / 3;
    const bytes = Buffer.alloc(84 + 50 * faces);
    bytes.writeUInt32LE(faces, 80);
    for (let face = 0, at = 84; face < faces; face += 1, at += 50)
        for (let corner = 0; corner < 3; corner += 1)
            for (let axis = 0; axis < 3; axis += 1)
                bytes.writeFloatLE(places[3 * triangles[3 * face + corner] + axis], at + 12 + 12 * corner + 4 * axis);
    return bytes;
}

/** A line a point. */
export function xyz({ places }) {
    const lines = [];
    for (let at = 0; at < places.length; at += 3)
        lines.push(`${places[at].toFixed(4)} ${places[at + 1].toFixed(4)} ${places[at + 2].toFixed(4)}`);
    return Buffer.from(`${lines.join("\n")}\n`);
}
