import {
    AmbientLight,
    Box3,
    BufferAttribute,
    BufferGeometry,
    DirectionalLight,
    DoubleSide,
    Mesh,
    MeshLambertMaterial,
    PerspectiveCamera,
    Plane,
    Points,
    PointsMaterial,
    Scene,
    Sphere,
    Spherical,
    SRGBColorSpace,
    Vector3,
    WebGLRenderer,
    type Group,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

import { Budget, leastWhileMoving } from "./budget";
import { colour, markDropped, shade, type ColourMode } from "./colours";
import type { Facing } from "./facing";
import type { Linked, View } from "./link";
import { noMarkers, type Markers, type Place } from "./marker-types";
import { dispose, markerGroup } from "./markers";
import { overlayPoints, type Overlay } from "./overlay";
import { pickCloud, pickMesh, type Spot } from "./picking";
import { shuffled, type Bounds, type Surface } from "./surface";

/** After so long without a movement all is drawn. */
const rest = 160;

export interface Cut {
    axis: 0 | 1 | 2;
    /** 0 to 1 across the model, or across these bounds. */
    at: number;
    across?: Bounds | undefined;
    isFlipped: boolean;
}

export interface Label {
    text: string;
    x: number;
    y: number;
    /** Whether an earlier one stands there. */
    isCovered: boolean;
}

/** A place that was picked, and the way from it to the eye: what was seen lies on that side. */
export interface Pick {
    place: Place;
    toEye: Place;
}

/** Whether a place, in the frame of the model, is to be left out. */
export type IsDropped = (x: number, y: number, z: number) => boolean;

/** How much room a text takes, in pixels. */
const letterWidth = 7;
const lineHeight = 18;

/** Draws one surface with what stands beside it, and only when something has changed. */
export class Stage implements Linked {
    private readonly renderer: WebGLRenderer;
    private readonly scene = new Scene();
    private readonly camera = new PerspectiveCamera(40, 1, 0.01, 100);
    private controls: OrbitControls;
    private readonly sizes: ResizeObserver;
    private surface: Surface | undefined;
    private mesh: Mesh | undefined;
    private points: Points | undefined;
    private order = new Uint32Array();
    private shown = new Uint32Array();
    private bounds = new Sphere(new Vector3(), 1);
    private box = new Box3();
    private cut: Plane | undefined;
    private markers: Markers = noMarkers;
    private group: Group | undefined;
    private overlay: Points | undefined;
    private frame = 0;
    private requestedAt = 0;
    private budget = new Budget();
    private isMoving = false;
    private wasMoving = false;
    private timer: ReturnType<typeof setTimeout> | undefined;
    /** How often the view was drawn. Tests look at this, and at where the eye is. */
    drawn = 0;
    onLabels: (labels: Label[]) => void = () => undefined;
    /** Called when the eye has moved, by whomsoever. */
    onView: (view: View) => void = () => undefined;

    constructor(private readonly canvas: HTMLCanvasElement) {
        this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true, powerPreference: "low-power" });
        this.renderer.outputColorSpace = SRGBColorSpace;
        this.renderer.localClippingEnabled = true;
        this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
        const lamp = new DirectionalLight(0xffffff, 2.1);
        lamp.position.set(0.35, 0.6, 1);
        // the lamp goes with the eye: whatever is looked at is lit
        this.camera.add(lamp);
        this.scene.add(new AmbientLight(0xffffff, 1.0), this.camera);
        this.controls = this.newControls();
        this.sizes = new ResizeObserver(() => this.resized());
        this.sizes.observe(canvas);
        this.resized();
    }

    /** Puts another surface on; the view stays if `keepView`. */
    show(surface: Surface, mode: ColourMode, facing: Facing, keepView: boolean): void {
        this.clear();
        // each surface has its own origin: the eye stays where it was in the frame of the model
        const shift = this.local(surface.origin).negate();
        this.surface = surface;
        if (keepView) {
            this.camera.position.add(shift);
            this.controls.target.add(shift);
        }
        const geometry = new BufferGeometry();
        geometry.setAttribute("position", new BufferAttribute(surface.positions, 3));
        if (surface.normals) geometry.setAttribute("normal", new BufferAttribute(surface.normals, 3));
        geometry.computeBoundingBox();
        this.box = geometry.boundingBox ?? new Box3();
        this.bounds = this.box.getBoundingSphere(new Sphere());
        this.bounds.radius = Math.max(this.bounds.radius, Number.EPSILON);
        this.budget = new Budget();
        this.order = shuffled(surface.positions.length / 3);
        this.shown = this.order;
        if (surface.triangles) {
            geometry.setIndex(new BufferAttribute(surface.triangles, 1));
            if (!surface.normals) geometry.computeVertexNormals();
            this.mesh = new Mesh(geometry, new MeshLambertMaterial({ vertexColors: true, side: DoubleSide }));
            this.scene.add(this.mesh);
        }
        // a mesh that is too large for this machine is shown by its vertices while it moves
        if (!surface.triangles || surface.triangles.length / 3 > leastWhileMoving) {
            const cloud = new BufferGeometry();
            cloud.setAttribute("position", geometry.getAttribute("position"));
            cloud.setIndex(new BufferAttribute(this.order, 1));
            this.points = new Points(
                cloud,
                new PointsMaterial({ vertexColors: true, sizeAttenuation: false, size: this.pointSize() }),
            );
            this.points.visible = !this.mesh;
            this.scene.add(this.points);
        }
        this.paint(mode, facing.axis);
        this.setMarkers(this.markers);
        if (!keepView) this.fit(facing);
        this.request();
    }

    /** Colours it anew; answers which values the ends of the scale stand for. */
    paint(mode: ColourMode, axis: 0 | 1 | 2, isDropped?: IsDropped): [number, number] | undefined {
        if (!this.surface) return undefined;
        const { colors, range } = colour(this.surface, mode, axis);
        if (isDropped) markDropped(colors, this.surface, isDropped);
        const painted = this.mesh ? colors : shade(colors, this.surface.normals);
        // eyes see steps of brightness as screens write them, lights add up otherwise
        const attribute = new BufferAttribute(linear(painted), 3, true);
        this.mesh?.geometry.setAttribute("color", attribute);
        this.points?.geometry.setAttribute("color", attribute);
        this.request();
        return range;
    }

    /** Shows the points of these scans alone. */
    showViews(hidden: ReadonlySet<number>): void {
        const views = this.surface?.views;
        if (!this.points || this.mesh || !views) return;
        this.shown = hidden.size === 0 ? this.order : this.order.filter((index) => !hidden.has(views[index] as number));
        this.points.geometry.setIndex(new BufferAttribute(this.shown, 1));
        this.request();
    }

    setCut(cut: Cut | undefined): void {
        const axes = ["x", "y", "z"] as const;
        if (cut) {
            const axis = axes[cut.axis];
            const [low, high] = cut.across
                ? cut.across.map((corner) => this.local(corner)[axis])
                : [this.box.min[axis], this.box.max[axis]];
            const at = (low as number) + ((high as number) - (low as number)) * cut.at;
            const side = cut.isFlipped ? 1 : -1;
            this.cut = new Plane(new Vector3().setComponent(cut.axis, side), -side * at);
        } else {
            this.cut = undefined;
        }
        for (const object of [this.mesh, this.points]) {
            const material = object?.material as MeshLambertMaterial | PointsMaterial | undefined;
            if (!material) continue;
            material.clippingPlanes = this.cut ? [this.cut] : [];
            material.needsUpdate = true;
        }
        this.request();
    }

    setMarkers(markers: Markers): void {
        this.markers = markers;
        if (this.group) {
            this.scene.remove(this.group);
            dispose(this.group);
        }
        this.group = markerGroup(markers, (place) => this.local(place), this.bounds.radius);
        this.scene.add(this.group);
        this.request();
    }

    /** Shows the points of another scan beside it, or none. */
    setOverlay(overlay: Overlay | undefined): void {
        if (this.overlay) {
            this.scene.remove(this.overlay);
            this.overlay.geometry.dispose();
            (this.overlay.material as PointsMaterial).dispose();
        }
        this.overlay =
            overlay && overlayPoints(overlay, (place) => this.local(place), 3 * Math.min(devicePixelRatio, 2));
        if (this.overlay) this.scene.add(this.overlay);
        this.request();
    }

    ball(): { center: Place; radius: number } {
        return { center: this.inModel(this.bounds.center), radius: this.bounds.radius };
    }

    view(): View {
        return { eye: this.inModel(this.camera.position), target: this.inModel(this.controls.target) };
    }

    /** Looks from elsewhere, as another viewer does. */
    lookFrom({ eye, target }: View): void {
        this.camera.position.copy(this.local(eye));
        this.controls.target.copy(this.local(target));
        this.controls.update();
        this.moved();
    }

    /** Looks at all of it. */
    fit(facing: Facing): void {
        const upward = new Vector3(...facing.up);
        const front = new Vector3(...facing.front);
        const side = upward.clone().cross(front);
        const toEye = front.addScaledVector(side, facing.aside).addScaledVector(upward, facing.above).normalize();
        this.camera.up.copy(upward);
        // the controls take the upward direction when they are made
        this.controls.dispose();
        this.controls = this.newControls();
        const half = Math.min(this.camera.fov, this.camera.fov * this.camera.aspect) / 2;
        const distance = (this.bounds.radius * 0.95) / Math.sin((half * Math.PI) / 180);
        this.controls.target.copy(this.bounds.center);
        this.camera.position.copy(this.bounds.center).addScaledVector(toEye, distance);
        this.camera.lookAt(this.bounds.center);
        this.controls.minDistance = this.bounds.radius * 0.02;
        this.controls.maxDistance = this.bounds.radius * 30;
        this.controls.update();
        this.moved();
    }

    /** Turns the eye about what it looks at, by angles in radians. */
    turn(about: number, over: number): void {
        const offset = this.camera.position.clone().sub(this.controls.target);
        const toY = new Vector3(0, 1, 0);
        const upward = this.camera.up.clone().normalize();
        const quaternion = this.camera.quaternion.clone().setFromUnitVectors(upward, toY);
        const place = new Spherical().setFromVector3(offset.applyQuaternion(quaternion));
        place.theta += about;
        place.phi += over;
        place.makeSafe();
        offset.setFromSpherical(place).applyQuaternion(quaternion.invert());
        this.camera.position.copy(this.controls.target).add(offset);
        this.camera.lookAt(this.controls.target);
        this.moved();
    }

    /** Moves by shares of what is seen. */
    pan(right: number, upward: number): void {
        const reach = this.camera.position.distanceTo(this.controls.target);
        const shift = new Vector3(right, upward, 0).multiplyScalar(reach * 0.6).applyQuaternion(this.camera.quaternion);
        this.camera.position.add(shift);
        this.controls.target.add(shift);
        this.moved();
    }

    zoom(factor: number): void {
        const offset = this.camera.position.clone().sub(this.controls.target);
        const length = Math.max(
            this.controls.minDistance,
            Math.min(this.controls.maxDistance, offset.length() * factor),
        );
        this.camera.position.copy(this.controls.target).add(offset.setLength(length));
        this.moved();
    }

    /** What of the surface is under a spot of the canvas, in the coordinates of the model. */
    pick(x: number, y: number): Pick | undefined {
        if (!this.surface) return undefined;
        this.camera.updateMatrixWorld();
        const spot: Spot = { x, y, width: this.canvas.clientWidth, height: this.canvas.clientHeight };
        const found = this.mesh
            ? pickMesh(this.mesh, spot, this.camera, this.cut)
            : pickCloud(this.surface.positions, this.shown, spot, this.camera, this.cut);
        if (!found) return undefined;
        const toEye = this.camera.position.clone().sub(found).normalize();
        return { place: this.inModel(found), toEye: [toEye.x, toEye.y, toEye.z] };
    }

    dispose(): void {
        clearTimeout(this.timer);
        this.sizes.disconnect();
        this.controls.dispose();
        this.clear();
        if (this.group) dispose(this.group);
        this.setOverlay(undefined);
        cancelAnimationFrame(this.frame);
        this.renderer.dispose();
    }

    private newControls(): OrbitControls {
        const controls = new OrbitControls(this.camera, this.canvas);
        controls.addEventListener("change", () => this.moved());
        return controls;
    }

    private clear(): void {
        for (const object of [this.mesh, this.points]) {
            if (!object) continue;
            this.scene.remove(object);
            object.geometry.dispose();
            (object.material as MeshLambertMaterial | PointsMaterial).dispose();
        }
        this.mesh = undefined;
        this.points = undefined;
    }

    private local(place: Place): Vector3 {
        const origin = this.surface?.origin ?? [0, 0, 0];
        return new Vector3(place[0] - origin[0], place[1] - origin[1], place[2] - origin[2]);
    }

    private inModel({ x, y, z }: Vector3): Place {
        const origin = this.surface?.origin ?? [0, 0, 0];
        return [x + origin[0], y + origin[1], z + origin[2]];
    }

    private pointSize(): number {
        const count = this.order.length;
        return (count > 400_000 ? 1.6 : count > 60_000 ? 2.2 : 3.2) * Math.min(devicePixelRatio, 2);
    }

    private moved(): void {
        this.onView(this.view());
        this.isMoving = true;
        clearTimeout(this.timer);
        this.timer = setTimeout(() => {
            this.isMoving = false;
            this.request();
        }, rest);
        this.request();
    }

    private resized(): void {
        const { clientWidth, clientHeight } = this.canvas;
        if (clientWidth === 0 || clientHeight === 0) return;
        this.renderer.setSize(clientWidth, clientHeight, false);
        this.camera.aspect = clientWidth / clientHeight;
        this.camera.updateProjectionMatrix();
        this.request();
    }

    private request(): void {
        if (this.frame !== 0) return;
        this.requestedAt = performance.now();
        this.frame = requestAnimationFrame(() => this.draw());
    }

    private draw(): void {
        this.frame = 0;
        this.drawn += 1;
        // the one before was drawn in the movement, too: while it is under way this one has to wait
        if (this.isMoving && this.wasMoving) this.budget.waited(performance.now() - this.requestedAt);
        this.wasMoving = this.isMoving;
        if (this.points) {
            const triangles = (this.surface?.triangles?.length ?? 0) / 3;
            const isRough = this.isMoving && triangles > this.budget.points;
            this.points.visible = !this.mesh || isRough;
            if (this.mesh) this.mesh.visible = !isRough;
            this.points.geometry.setDrawRange(0, this.isMoving ? Math.floor(this.budget.points) : Infinity);
        }
        const distance = this.camera.position.distanceTo(this.bounds.center);
        this.camera.near = Math.max(distance - this.bounds.radius * 12, this.bounds.radius * 0.005);
        this.camera.far = distance + this.bounds.radius * 12;
        this.camera.updateProjectionMatrix();
        this.renderer.render(this.scene, this.camera);
        this.canvas.dataset["drawn"] = String(this.drawn);
        this.canvas.dataset["eye"] = this.view()
            .eye.map((value) => value.toPrecision(6))
            .join(" ");
        this.onLabels(this.labels());
    }

    private labels(): Label[] {
        const { clientWidth, clientHeight } = this.canvas;
        const taken: [number, number, number][] = [];
        return this.markers.points.flatMap(({ at, text }) => {
            if (!text) return [];
            const place = this.local(at).project(this.camera);
            if (place.z > 1 || Math.abs(place.x) > 1 || Math.abs(place.y) > 1) return [];
            const [x, y] = [((place.x + 1) / 2) * clientWidth, ((1 - place.y) / 2) * clientHeight];
            const end = x + (text.length + 2) * letterWidth;
            const isCovered = taken.some(
                ([from, to, height]) => Math.abs(height - y) < lineHeight && x < to && end > from,
            );
            if (!isCovered) taken.push([x, end, y]);
            return [{ text, x, y, isCovered }];
        });
    }
}

/** From how screens write brightness to how lights add up. */
function linear(colors: Uint8Array): Uint16Array {
    const table = Uint16Array.from({ length: 256 }, (_, value) => {
        const share = value / 255;
        return Math.round(65535 * (share <= 0.04045 ? share / 12.92 : ((share + 0.055) / 1.055) ** 2.4));
    });
    return Uint16Array.from(colors, (value) => table[value] as number);
}
