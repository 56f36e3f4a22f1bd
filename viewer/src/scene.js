// The clouds, their key points and the camera, drawn when something has changed and not otherwise.
import { Color, ColorManagement, Scene, Sphere, Vector3, WebGLRenderer } from 'three';
import { Camera } from './camera.js';
import { cloudPoints, keyPoints } from './points.js';

// Colours are those of the style sheet, as they are.
ColorManagement.enabled = false;

const roles = ['source', 'reference'];
/** What can be shown and hidden, by name. */
export const layers = [...roles, ...roles.map((role) => `${role}-keys`)];

/** Some two thousand of the points, those that are farthest out among them, and the key points. */
function outlineOf({ positions, keyPoints: keys }) {
  const chosen = new Set();
  const step = 3 * Math.max(1, Math.round(positions.length / 6000));
  for (let i = 0; i < positions.length; i += step) chosen.add(i);
  const least = [0, 0, 0], most = [0, 0, 0];
  for (let i = 0; i < positions.length; i += 3) {
    for (let axis = 0; axis < 3; ++axis) {
      if (positions[i + axis] < positions[least[axis] + axis]) least[axis] = i;
      if (positions[i + axis] > positions[most[axis] + axis]) most[axis] = i;
    }
  }
  for (const i of [...least, ...most]) chosen.add(i);
  const outline = [...chosen].map((i) => new Vector3().fromArray(positions, i));
  for (let i = 0; i < keys.length; i += 3) outline.push(new Vector3().fromArray(keys, i));
  return outline;
}

export class Stage {
  constructor(canvas, data, motion) {
    this.canvas = canvas;
    this.data = data;
    this.motion = motion;
    this.renderer = new WebGLRenderer({ canvas, antialias: true });
    this.scene = new Scene();
    this.scene.matrixAutoUpdate = false;
    const spacing = Math.max(data.source.spacing, data.reference.spacing);
    this.clouds = {
      source: cloudPoints(data.source, 0.75 * spacing),
      reference: cloudPoints(data.reference, 0),
    };
    this.keys = {
      source: keyPoints(data.source.keyPoints, 2),
      reference: keyPoints(data.reference.keyPoints, 1),
    };
    this.objects = Object.fromEntries(
      roles.flatMap((role) => [[role, this.clouds[role]], [`${role}-keys`, this.keys[role]]]),
    );
    this.scene.add(...Object.values(this.objects));
    this.pointSize = 1;
    this.outline = { source: outlineOf(data.source), reference: outlineOf(data.reference) };

    this.camera = new Camera(canvas, data.view, () => this.draw());
    this.camera.reset = () => this.resetView();
    this.move(1);
    this.recolour();
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
  }

  /** The source to where it is at s; the camera follows until somebody takes it. */
  move(s) {
    const matrix = this.motion.matrixAt(s);
    const source = this.outline.source.map((point) => point.clone().applyMatrix4(matrix));
    this.points = source.concat(this.outline.reference);
    this.sphere = new Sphere().setFromPoints(this.points);
    this.sphere.radius = Math.max(this.sphere.radius, 1e-3);
    if (!this.camera.taken) this.camera.frame(this.points);
    for (const object of [this.clouds.source, this.keys.source]) {
      object.matrix.copy(matrix);
      object.matrixWorldNeedsUpdate = true;
    }
    this.draw();
  }

  /** Another way for the source, seen from where it is now. */
  follow(motion, s) {
    this.motion = motion;
    this.move(s);
  }

  show(layer, shown) {
    this.objects[layer].visible = shown;
    this.draw();
  }

  useOwnColours(own) {
    for (const role of roles)
      this.clouds[role].material.uniforms.own.value = own && this.data[role].colors ? 1 : 0;
    this.draw();
  }

  scalePoints(factor) {
    this.pointSize = factor;
    this.draw();
  }

  recolour() {
    const style = getComputedStyle(document.documentElement);
    const colour = (name) => new Color(style.getPropertyValue(`--${name}`).trim());
    const paper = colour('paper');
    this.renderer.setClearColor(paper);
    for (const role of roles) {
      const cloud = this.clouds[role].material.uniforms;
      const keys = this.keys[role].material.uniforms;
      cloud.piece.value = colour(role);
      cloud.paper.value = paper;
      keys.fill.value = colour(role).multiplyScalar(0.62);
      keys.rim.value = new Color(0xffffff);
    }
    this.draw();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    this.renderer.setPixelRatio(window.devicePixelRatio);
    this.renderer.setSize(width, height, false);
    this.camera.camera.aspect = width / height;
    this.camera.camera.updateProjectionMatrix();
    if (!this.camera.taken) this.camera.frame(this.points);
    this.draw();
  }

  resetView() {
    this.camera.taken = false;
    this.camera.frame(this.points);
    this.draw();
  }

  draw() {
    this.frame ??= requestAnimationFrame(() => {
      this.frame = undefined;
      this.drawNow();
    });
  }

  drawNow() {
    const { camera } = this.camera;
    const range = this.camera.fit(this.sphere.center, this.sphere.radius);
    const ratio = this.renderer.getPixelRatio();
    const pixels = this.renderer.domElement.height / (2 * Math.tan((camera.fov * Math.PI) / 360));
    for (const role of roles) {
      const { uniforms } = this.clouds[role].material;
      uniforms.pixels.value = pixels;
      uniforms.diameter.value = 1.6 * this.data[role].spacing * this.pointSize;
      uniforms.least.value = 1.5 * ratio * Math.min(1, this.pointSize);
      uniforms.most.value = 14 * ratio * this.pointSize; // few points stay points
      uniforms.range.value = range;
      this.keys[role].material.uniforms.size.value = (role === 'source' ? 8 : 11) * ratio;
    }
    this.renderer.render(this.scene, camera);
  }
}
