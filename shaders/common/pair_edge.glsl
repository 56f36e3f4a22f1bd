// Edges of the two-sided graph. Per side, the length and an orthonormal, right-handed frame whose first axis is the
// direction from neighbour to centre; the angle about it cancels in the messages, and so does the whole frame at
// length zero. Needs positions[] (or POSITION(at), one of its vec4s) and features[].
#ifndef POSITION
#define POSITION(at) positions[at]
#endif

const float DIRECTION_EPS = 1e-12;  // ops::direction_eps

struct Side {
  vec3 axes[3];  // in the order (y, z, x) of degree 1
  float norm;
};

struct PairEdge {
  Side source, reference;
};

Side side_between(vec3 centre, vec3 neighbour) {
  const vec3 d = (centre - neighbour).yzx;
  Side side;
  side.norm = sqrt(dot(d, d));
  const vec3 v = side.norm > 0.0 ? d / side.norm : vec3(0, 0, 1);
  const float sign = v.z >= 0.0 ? 1.0 : -1.0;
  const float a = -1.0 / (sign + v.z), b = v.x * v.y * a;
  side.axes[0] = v;
  side.axes[1] = vec3(1.0 + sign * v.x * v.x * a, sign * b, -sign * v.x);
  side.axes[2] = vec3(b, sign + v.y * v.y * a, -v.y);
  return side;
}

PairEdge pair_edge(uint centre, uint neighbour) {
  const vec4 centre0 = POSITION(2u * centre), centre1 = POSITION(2u * centre + 1u);
  const vec4 neighbour0 = POSITION(2u * neighbour), neighbour1 = POSITION(2u * neighbour + 1u);
  return PairEdge(side_between(centre0.xyz, neighbour0.xyz),
                  side_between(vec3(centre0.w, centre1.xy), vec3(neighbour0.w, neighbour1.xy)));
}

vec3 vector_feature(uint at) { return vec3(features[at], features[at + 1u], features[at + 2u]); }

// A vector into a frame, and back.
vec3 turn_into(vec3 v, vec3 x, vec3 y, vec3 z) { return vec3(dot(x, v), dot(y, v), dot(z, v)); }
vec3 turn_back(vec3 v, vec3 x, vec3 y, vec3 z) { return v.x * x + v.y * y + v.z * z; }
