// The search for the nearest in a tree of boxes (common/knn_tree.glsl). Before it is included: NEAREST, how many; the
// buffers `sorted` (xyz as bits, row) and `boxes` (low corner, 0, high corner, 0).
const int BATCH = 8;
const uint MOST_LOOPS = 20000;
#define INFINITY uintBitsToFloat(0x7f800000u)

float nearest[NEAREST];
uint nearest_row[NEAREST];

bool before(float d, uint row, float other, uint other_row) {
  return d < other || (d == other && row < other_row);
}

// Never contracted into fused multiply-adds: ties must be ties on every device, and no box farther than a point
// in it.
float squared(vec3 difference) {
  precise vec3 square = difference * difference;
  precise float sum = square.x + square.y;
  sum = sum + square.z;
  return sum;
}

float squared_to_box(vec3 query, uint node) {
  const vec3 low = boxes[2 * node].xyz, high = boxes[2 * node + 1].xyz;
  precise vec3 below = low - query, above = query - high;
  return squared(max(max(below, above), vec3(0)));
}

// True where the node has to be looked at.
bool any_reached(bool reached) {
#ifdef SHUFFLE
  return subgroupAny(reached);
#else
  return reached;
#endif
}

uvec4 candidate(uvec4 loaded, uint slot, int i) {
#ifdef SHUFFLE
  return subgroupShuffle(loaded, i);
#else
  return sorted[slot];
#endif
}

// The nearest in the cloud of slots begin … end − 1 with its tree's blocks from first_node on, into nearest and
// nearest_row, but for the row `self`. First the blocks known[0] … known[1] − 1, which leaves the walk a short reach.
// With subgroups all but the query and `self` is the same for a subgroup. False where it gave up: tens of thousands of
// points in reach.
bool find_nearest(vec3 query, uint self, uint begin, uint end, uint first_node, uvec2 known) {
  const uint blocks = cloud_blocks(begin, end);
  [[unroll]] for (int j = 0; j < NEAREST; ++j) {
    nearest[j] = INFINITY;
    nearest_row[j] = begin;
  }

  uint top = 0, level_first = first_node;
  while (level_nodes(blocks, top) > 1) {
    level_first += level_nodes(blocks, top);
    ++top;
  }

  // Rows still to look at; the walk goes on when there are none.
  uint base = begin + known.x * BLOCK, block_end = min(begin + known.y * BLOCK, end);
  uint level = top, node = 0;
  uint steps = 0, insertions = 0;
  for (; steps < MOST_LOOPS; ++steps) {
    if (base >= block_end) {
      if (node >= level_nodes(blocks, level)) {
        if (level == top) break;
        level_first += level_nodes(blocks, level);
        ++level;
        node = node / 8 + 1;
        continue;
      }
      const bool reached = any_reached(squared_to_box(query, level_first + node) <= nearest[NEAREST - 1]);
      if (reached && level > 0) {
        --level;
        level_first -= level_nodes(blocks, level);
        node *= 8;
        continue;
      }
      if (reached && (node < known.x || node >= known.y)) {
        base = begin + node * BLOCK;
        block_end = min(base + BLOCK, end);
      }
      ++node;
      while (node % 8 == 0 && level < top) {
        level_first += level_nodes(blocks, level);
        ++level;
        node /= 8;
      }
      continue;
    }

    float d[BATCH];
    uint rows[BATCH];
#ifdef SHUFFLE
    const uvec4 loaded = sorted[min(base + (gl_SubgroupInvocationID & 7u), block_end - 1)];
#else
    const uvec4 loaded = uvec4(0);
#endif
    [[unroll]] for (int i = 0; i < BATCH; ++i) {
      const uvec4 point = candidate(loaded, min(base + i, block_end - 1), i);
      precise vec3 difference = query - uintBitsToFloat(point.xyz);
      rows[i] = point.w;
      d[i] = base + i < block_end && point.w != self ? squared(difference) : INFINITY;
    }
    base += BATCH;
    for (; insertions < MOST_LOOPS; ++insertions) {
      float least = INFINITY;
      uint found = 0xffffffffu;
      [[unroll]] for (int i = 0; i < BATCH; ++i) {
        const bool first = before(d[i], rows[i], least, found);
        found = first ? rows[i] : found;
        least = first ? d[i] : least;
      }
      if (least == INFINITY || !before(least, found, nearest[NEAREST - 1], nearest_row[NEAREST - 1])) break;
      [[unroll]] for (int j = NEAREST - 1; j > 0; --j) {
        const bool shift = before(least, found, nearest[j - 1], nearest_row[j - 1]);
        const bool here = before(least, found, nearest[j], nearest_row[j]);
        nearest_row[j] = shift ? nearest_row[j - 1] : here ? found : nearest_row[j];
        nearest[j] = shift ? nearest[j - 1] : here ? least : nearest[j];
      }
      if (before(least, found, nearest[0], nearest_row[0])) {
        nearest[0] = least;
        nearest_row[0] = found;
      }
      [[unroll]] for (int i = 0; i < BATCH; ++i) d[i] = rows[i] == found ? INFINITY : d[i];
    }
  }
  return max(steps, insertions) < MOST_LOOPS;
}
