// Where the scene is seen from, by mouse, touch and keys.
import { Box3, Matrix3, PerspectiveCamera, Vector3 } from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';

const step = Math.PI / 36;

/** `view`: rows of the camera's right, its up and the direction towards the viewer. */
export class Camera {
  constructor(canvas, view, changed) {
    this.view = new Matrix3().set(...view);
    this.towards = new Vector3(...view.slice(6));
    this.camera = new PerspectiveCamera(30, 1, 0.01, 100);
    this.camera.up.set(...view.slice(3, 6));
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = false;
    this.controls.addEventListener('change', changed);
    this.taken = false; // by somebody who looks
    this.controls.addEventListener('start', () => (this.taken = true));
    canvas.addEventListener('keydown', (event) => this.key(event));
  }

  /** All of the points, from the first direction. */
  frame(points) {
    const { camera, controls } = this;
    const seen = new Box3().setFromPoints(points.map((point) => point.clone().applyMatrix3(this.view)));
    const half = seen.getSize(new Vector3()).multiplyScalar(0.5);
    const tangent = Math.tan((camera.fov * Math.PI) / 360);
    const distance = 1.08 * Math.max(half.y / tangent, half.x / tangent / camera.aspect, 1e-3) + half.z;
    controls.minDistance = distance / 200;
    controls.maxDistance = 20 * distance;
    controls.target.copy(seen.getCenter(new Vector3())).applyMatrix3(this.view.clone().transpose());
    camera.position.copy(this.towards).multiplyScalar(distance).add(controls.target);
    controls.update();
  }

  /** Depths that hold the sphere, as near together as they may be. */
  fit(centre, radius) {
    const depth = this.camera.position.distanceTo(centre);
    this.camera.far = depth + 1.1 * radius;
    this.camera.near = Math.max(depth - 1.1 * radius, this.camera.far / 2000);
    this.camera.updateProjectionMatrix();
    return [this.camera.near, this.camera.far];
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const { controls } = this;
    const across = { ArrowLeft: 1, ArrowRight: -1 }[event.key] ?? 0;
    const up = { ArrowUp: 1, ArrowDown: -1 }[event.key] ?? 0;
    if (across || up) {
      if (event.shiftKey) {
        controls.pan(20 * across, 20 * up);
      } else {
        controls.rotateLeft(step * across);
        controls.rotateUp(step * up);
      }
    } else if (event.key === '+' || event.key === '=') {
      controls.dollyIn(1.1);
    } else if (event.key === '-') {
      controls.dollyOut(1.1);
    } else if (event.key === 'Home') {
      this.reset?.();
    } else {
      return;
    }
    this.taken = event.key !== 'Home';
    event.preventDefault();
    controls.update();
  }
}
