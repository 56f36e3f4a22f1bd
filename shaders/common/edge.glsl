// An edge of a cloud's graph, from neighbour to centre.
const float DIRECTION_EPS = 1e-12;

struct Edge {
  vec3 direction;  // unit, in the order (y, z, x) of degree 1; zero where the length is zero
  float square;    // the squared norm of `direction`: 1, but for edges shorter than DIRECTION_EPS
  bool zero;
};

Edge edge_between(vec3 centre, vec3 neighbour) {
  const vec3 d = (centre - neighbour).yzx;
  const float square = dot(d, d);
  Edge edge;
  edge.zero = !(square > 0.0);
  const float scale = edge.zero ? 0.0 : 1.0 / max(sqrt(square), DIRECTION_EPS);
  edge.direction = d * scale;
  edge.square = square * scale * scale;
  return edge;
}
