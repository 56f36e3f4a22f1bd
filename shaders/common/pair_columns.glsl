// The columns of radial tables, which invocations of a subgroup read together where they can: one sector after the other,
// ROWS_AT_ONCE vec4s at a time, which are handed round. Needs Sectors (common/texels.glsl). Loops here end with their
// condition: a processor goes once more through the body of one that begins with it.
#ifdef TEXELS
#define ROWS_AT_ONCE 8
#define LOADED vec4  // one vec4 an invocation
#else
#define ROWS_AT_ONCE 2
#define LOADED float
#endif

uint sector;  // whose turn it is
bool waits;   // this invocation

// Right whatever the subgroup's size, which is not gl_SubgroupSize on every driver.
uint subgroup_least(uint x) {
#ifdef SHUFFLE
  return subgroupMin(x);
#else
  return x;
#endif
}

// `at`: the sector of this invocation.
void first_sector(uint at) {
  sector = subgroup_least(at);
  waits = at != sector;
}

// False once all have had their turn.
bool next_sector(uint at) {
  sector = subgroup_least(waits ? at : 0xffffffffu);
  waits = waits && at != sector;
  return sector != 0xffffffffu;
}

// Vec4s from `i` on of `count`, `step` apart, of the sector.
LOADED load_rows(int i, int count, uint step) {
#ifdef TEXELS
  return VEC4_OF(Sectors, sector + min(uint(i) + (gl_SubgroupInvocationID & 7u), uint(count) - 1u) * step);
#elif defined(SHUFFLE)
  const uint lane = gl_SubgroupInvocationID & 7u;
  return VEC4_OF(Sectors, sector + min(uint(i) + lane / 4u, uint(count) - 1u) * step)[lane % 4u];
#else
  return 0.0;
#endif
}

// Vec4 `i` + `more` of them.
vec4 row_of(LOADED loaded, int i, int more, uint step) {
#ifdef TEXELS
  return subgroupShuffle(loaded, more);
#elif defined(SHUFFLE)
  return vec4(subgroupShuffle(loaded, 4u * more), subgroupShuffle(loaded, 4u * more + 1u),
              subgroupShuffle(loaded, 4u * more + 2u), subgroupShuffle(loaded, 4u * more + 3u));
#else
  return VEC4_OF(Sectors, sector + (i + more) * step);
#endif
}
