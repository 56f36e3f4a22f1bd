// The tree that large clouds are searched with. Points are sorted along the Morton curve through the cells of a
// grid; 32 of them in a row are a block, 8 blocks a node, 8 nodes a node, up to one. Order within a cell does not
// matter, and neither does the grid's fit: boxes are those of the points that are really there.
struct Grid {
  vec3 origin;
  float cell;  // edge length
  uint bits;   // in a cell's coordinate
};

const uint CELLS_PER_POINT = 8;
const uint MOST_BITS = 7;
const uint BLOCK = 32;

Grid stored_grid(vec4 first, vec4 second) { return Grid(first.xyz, first.w, floatBitsToUint(second.x)); }

uint spread(uint x) {
  x = (x | (x << 8)) & 0x0000f00fu;
  x = (x | (x << 4)) & 0x000c30c3u;
  return (x | (x << 2)) & 0x00249249u;
}

// Along the Morton curve. Points beyond the grid belong to the cells at its faces.
uint grid_index(Grid grid, vec3 point) {
  const uint last = (1u << grid.bits) - 1u;
  // Once more as integers: what a number that is none becomes is anyone's guess.
  const uvec3 cell = min(uvec3(clamp((point - grid.origin) / grid.cell, vec3(0), vec3(last))), uvec3(last));
  return spread(cell.x) | (spread(cell.y) << 1) | (spread(cell.z) << 2);
}

// Nodes of a level of a cloud's tree over so many blocks; level 0 are the blocks.
uint level_nodes(uint blocks, uint level) { return (blocks + (1u << (3 * level)) - 1u) >> (3 * level); }

uint cloud_blocks(uint begin, uint end) { return (end - begin + BLOCK - 1) / BLOCK; }

// Past the nodes of the clouds before this one, whatever their sizes.
uint first_node(uint begin, uint cloud) { return 2 * (begin / BLOCK + cloud) + 8 * cloud; }
