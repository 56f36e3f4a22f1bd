// The source's way from where it was given to where it was assembled.
import { Matrix3, Matrix4, Quaternion, Vector3 } from 'three';

/**
 * A turn about the source's centre while the centre goes straight ahead: x ↦ R(s) x + place(s), of points
 * relative to that centre; s from 0, as given, to 1, assembled. `rotation` is row-major; `before` and
 * `after` are the centre's places. At 1 the rotation is the given one to the last bit.
 */
export class Motion {
  constructor(rotation, before, after) {
    this.rotation = new Matrix3().set(...rotation);
    this.turn = new Quaternion().setFromRotationMatrix(new Matrix4().setFromMatrix3(this.rotation)).normalize();
    this.before = new Vector3(...before);
    this.after = new Vector3(...after);
  }

  rotationAt(s) {
    if (s >= 1) return this.rotation.clone();
    const part = new Quaternion().slerp(this.turn, Math.max(0, s));
    return new Matrix3().setFromMatrix4(new Matrix4().makeRotationFromQuaternion(part));
  }

  placeAt(s) {
    return s >= 1 ? this.after.clone() : this.before.clone().lerp(this.after, Math.max(0, s));
  }

  matrixAt(s) {
    return new Matrix4().setFromMatrix3(this.rotationAt(s)).setPosition(this.placeAt(s));
  }
}

/** The motion in the clouds' units and frames, as rows of a 4 × 4 matrix: at 1 the pose that was found. */
export function poseAt(motion, data, s) {
  const rotation = motion.rotationAt(s);
  const centre = new Vector3(...data.source.centre);
  const shift = motion
    .placeAt(s)
    .multiplyScalar(data.length)
    .add(new Vector3(...data.reference.centre))
    .sub(centre.applyMatrix3(rotation));
  const r = rotation.clone().transpose().elements;
  return [[...r.slice(0, 3), shift.x], [...r.slice(3, 6), shift.y], [...r.slice(6), shift.z], [0, 0, 0, 1]];
}
