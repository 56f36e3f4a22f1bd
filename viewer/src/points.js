// Clouds and key points as three.js objects.
import { BufferAttribute, BufferGeometry, Color, Points, ShaderMaterial } from 'three';

// Light comes from the upper left and from the viewer, on whichever side of a surface is seen. Where two
// surfaces coincide, the lifted one shows in cubes of a chessboard: point by point the two would mix to grey.
const cloudVertex = /* glsl */ `
  attribute vec3 color;
  uniform vec3 piece;
  uniform vec3 paper;
  uniform float own;       // 1: the cloud's colours
  uniform float diameter;  // of a point, in units of the scene
  uniform float pixels;    // of one unit at distance one
  uniform float least, most;
  uniform float lift;
  uniform vec2 range;      // distances of the nearest and the farthest point
  varying vec3 tint;
  varying float relief;
  void main() {
    vec4 seen = modelViewMatrix * vec4(position, 1.0);
    gl_Position = projectionMatrix * seen;
    if (lift > 0.0) {
      vec3 cell = floor(position / (12.0 * lift));
      float side = mod(cell.x + cell.y + cell.z, 2.0) < 0.5 ? 1.0 : -1.0;
      vec4 lifted = projectionMatrix * (seen * vec4(vec3(1.0 + side * lift / seen.z), 1.0));
      gl_Position.z = lifted.z / lifted.w * gl_Position.w;
    }
    gl_PointSize = clamp(diameter * pixels / -seen.z, least, most);
    vec3 facing = normalMatrix * normal / max(length(normal), 0.1);
    if (dot(facing, seen.xyz) > 0.0) facing = -facing;
    float lambert = max(0.0, dot(facing, normalize(vec3(-0.4, 0.55, 0.73))));
    float light = 0.6 + 0.45 * lambert;
    float pale = 0.35 * clamp((-seen.z - range.x) / (range.y - range.x), 0.0, 1.0);
    tint = mix(mix(piece, color, own) * light, paper, pale);
    relief = clamp((gl_PointSize - 6.0) / 20.0, 0.0, 0.35);
  }`;
const cloudFragment = /* glsl */ `
  varying vec3 tint;
  varying float relief;
  void main() {
    vec2 at = 2.0 * gl_PointCoord - 1.0;
    float squared = dot(at, at);
    if (squared > 1.0) discard;
    gl_FragColor = vec4(tint * (1.0 - relief * squared), 1.0);
  }`;

const keyVertex = /* glsl */ `
  uniform float size;
  void main() {
    gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
    gl_PointSize = size;
  }`;
const keyFragment = /* glsl */ `
  uniform vec3 fill;
  uniform vec3 rim;
  uniform float size;
  void main() {
    float radius = length(2.0 * gl_PointCoord - 1.0);
    float edge = 2.0 / size;
    if (radius > 1.0) discard;
    vec3 colour = mix(fill, rim, smoothstep(0.68 - edge, 0.68, radius));
    gl_FragColor = vec4(colour, 1.0 - smoothstep(1.0 - edge, 1.0, radius));
  }`;

const uniforms = (values) => Object.fromEntries(Object.entries(values).map(([name, value]) => [name, { value }]));

function pointsOf(positions, material) {
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new BufferAttribute(positions, 3));
  const points = new Points(geometry, material);
  points.frustumCulled = false;
  points.matrixAutoUpdate = false;
  return points;
}

/** `lift`: how far this cloud stands out, in units of the scene, where it coincides with the other. */
export function cloudPoints(cloud, lift) {
  const material = new ShaderMaterial({
    vertexShader: cloudVertex,
    fragmentShader: cloudFragment,
    uniforms: uniforms({
      piece: new Color(),
      paper: new Color(),
      own: 0,
      diameter: cloud.spacing,
      pixels: 1,
      least: 1,
      most: 64,
      lift,
      range: [0, 1],
    }),
  });
  const points = pointsOf(cloud.positions, material);
  const { geometry } = points;
  geometry.setAttribute('normal', new BufferAttribute(cloud.normals, 3, true));
  geometry.setAttribute('color', new BufferAttribute(cloud.colors ?? new Uint8Array(cloud.positions.length), 3, true));
  return points;
}

/** Discs over everything, because key points lie inside the shapes. */
export function keyPoints(positions, order) {
  const material = new ShaderMaterial({
    vertexShader: keyVertex,
    fragmentShader: keyFragment,
    uniforms: uniforms({ fill: new Color(), rim: new Color(), size: 10 }),
    depthTest: false,
    depthWrite: false,
    transparent: true,
  });
  const points = pointsOf(positions, material);
  points.renderOrder = order;
  return points;
}
