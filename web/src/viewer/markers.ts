import {
    BufferGeometry,
    Color,
    Float32BufferAttribute,
    Group,
    Line,
    LineBasicMaterial,
    LineLoop,
    Mesh,
    MeshBasicMaterial,
    OctahedronGeometry,
    SphereGeometry,
    type Vector3,
} from "three";

import type { Markers, Place } from "./marker-types";

/** All of them as objects of the scene; `local` brings places into its frame. They are drawn over the surface. */
export function markerGroup(markers: Markers, local: (place: Place) => Vector3, radius: number): Group {
    const group = new Group();
    const ball = new SphereGeometry(radius * 0.014, 16, 12);
    const diamond = new OctahedronGeometry(radius * 0.035);
    for (const { kind, at, colour } of markers.points) {
        const material = new MeshBasicMaterial({ color: new Color(colour), depthTest: false });
        const mesh = new Mesh(kind === "point" ? ball : diamond, material);
        mesh.position.copy(local(at));
        mesh.renderOrder = 3;
        group.add(mesh);
    }
    for (const { places, isClosed, colour } of markers.lines) {
        const geometry = new BufferGeometry();
        geometry.setAttribute(
            "position",
            new Float32BufferAttribute(
                places.flatMap((place) => local(place).toArray()),
                3,
            ),
        );
        const material = new LineBasicMaterial({ color: new Color(colour), depthTest: false });
        const line = isClosed ? new LineLoop(geometry, material) : new Line(geometry, material);
        line.renderOrder = 2;
        group.add(line);
    }
    return group;
}

export function dispose(group: Group): void {
    group.traverse((object) => {
        if (object instanceof Mesh || object instanceof Line) {
            object.geometry.dispose();
            object.material.dispose();
        }
    });
}
