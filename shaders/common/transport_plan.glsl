// Terms of a transport plan, P = exp(u + v − |x − y|²) with coordinates in kernel widths: potentials are in the thousands
// and their sums with squared distances small, so that single precision alone would lose what matters. Potentials are
// kept as a multiple of 1/1024 and a rest; so are squared distances, whose coarse part is a sum of squares of multiples of
// 1/32. Coarse parts add up exactly below 16384; beyond that terms do not matter.
//
// Before it is included: NORMALS; the buffers `points` (xyz, the normal if NORMALS) and `potentials` (coarse, rest, last
// change, –).
const uint BLOCK = 64;
const int BATCH = 8;
const uint WIDTH = NORMALS ? 2 : 1;  // vec4s of a point
// Terms so much smaller than the largest, e⁻⁴⁰ of it, do not matter; coarse parts differ from terms by 10 at most.
const float NEGLIGIBLE = 40;
#define INFINITY_BOUND 3.4e38

struct Term {
  float coarse, rest;
  float change;  // the change of the other side's potential
  vec3 away, turned;  // y − x
};

void add_square(inout Term term, float difference) {
  const float coarse = round(difference * 32.0) * (1.0 / 32.0);
  term.coarse -= coarse * coarse;
  term.rest -= (difference - coarse) * (difference + coarse);
}

struct Loaded {
  vec4 position, normal, potential;
};

Loaded load(uint row, uint potential) {
  return Loaded(points[row * WIDTH], NORMALS ? points[row * WIDTH + 1] : vec4(0), potentials[potential]);
}

// In front of a batch of rows: what this invocation loads for its neighbours.
Loaded load_batch(uint base, uint end, uint potentials_from) {
#ifdef SHUFFLE
  const uint row = min(base + (gl_SubgroupInvocationID & 7u), end - 1);
  return load(row, row + potentials_from);
#else
  return Loaded(vec4(0), vec4(0), vec4(0));
#endif
}

Loaded candidate(Loaded loaded, uint row, uint potentials_from, int i) {
#ifdef SHUFFLE
  return Loaded(subgroupShuffle(loaded.position, i),
                NORMALS ? subgroupShuffle(loaded.normal, i) : vec4(0), subgroupShuffle(loaded.potential, i));
#else
  return load(row, row + potentials_from);
#endif
}

// The term of the point at (position, normal) and the i-th row of a batch; a row past the last adds nothing.
Term term_of(vec3 position, vec3 normal, Loaded loaded, uint base, uint end, uint potentials_from, int i) {
  const Loaded other = candidate(loaded, min(base + i, end - 1), potentials_from, i);
  Term term;
  term.coarse = other.potential.x;
  term.rest = other.potential.y;
  term.change = other.potential.z;
  term.away = other.position.xyz - position;
  term.turned = other.normal.xyz - normal;
  add_square(term, term.away.x);
  add_square(term, term.away.y);
  add_square(term, term.away.z);
  if (NORMALS) {
    add_square(term, term.turned.x);
    add_square(term, term.turned.y);
    add_square(term, term.turned.z);
  }
  if (base + i >= end) term.coarse = -1e30;
  return term;
}

// Between the nearest points of two boxes.
float squared_gap(vec3 low, vec3 high, vec3 other_low, vec3 other_high) {
  const vec3 gap = max(max(other_low - high, low - other_high), vec3(0));
  return dot(gap, gap);
}
