// Push constants, once for GLSL and for C++ (src/vk/parameters.hpp): four-byte members only, so that both lay
// them out alike.
#ifndef BITR_PARAMETERS
#define BITR_PARAMETERS

struct KnnParameters {
  uint first_tile;
  uint first_row;      // where the index tensor as bound begins
  uint first_reference;  // within the segment: one dispatch takes at most `references` of them
  uint references;
};

// Kernels with an invocation per point.
struct PointParameters {
  uint first_tile;
  uint first_row;  // where the tensors that are bound in part begin
};

struct CloudParameters {
  uint clouds;
};

struct MergeParameters {
  uint first_item;  // the first invocation's
  uint nodes;
};

// Kernels that go by tiles and read no index.
struct TileParameters {
  uint first_tile;
};

// Kernels with a work group, or an invocation, per cloud or pair.
struct SegmentParameters {
  uint first;     // the first work group's
  uint segments;  // in the batch
};

struct HeadParameters {
  uint first_pair;
  uint keys;  // key points of a pair
};

// A run of nodes of the two-sided graph.
struct PairParameters {
  uint first_node;
  uint nodes;
};

// Kernels that take rows one by one, all tensors bound from the first of them on.
struct RowParameters {
  uint rows;
};

struct NeighbourAttentionParameters {
  uint rows;
  float scale;
};

// The gradient of a one-sided layer, of a run of whole clouds.
struct PointGradientParameters {
  uint first_tile;
  uint tiles;
  uint first_row;  // where the run's rows as bound begin
};

// A run of edges.
struct EdgeParameters {
  uint first;  // the first invocation's
  uint edges;  // past the last
};

// What edges send to their neighbours, summed up.
struct GatherParameters {
  uint first_tile;
  uint first_row;   // where the rows' records as bound begin
  uint first_edge;  // where the edges' as bound begin
};

// Sums of outer products over the tiles of a run, and over tiles.
struct OuterParameters {
  uint first_tile;
  uint first_row;  // where the rows' records as bound begin
  uint jobs;
};
struct OuterTotalParameters {
  uint tiles;
  uint jobs;
  uint first_segment;
  uint begin;  // where the first number goes in the result
};

// A run of edges of the two-sided graph, where a layer's gradient is made.
struct PairGradientParameters {
  uint first_node;
  uint edges;
  uint first_block;  // among the parts of the kernel, of which a dispatch takes some
  uint add;          // 1: to what earlier runs left
};

// Kernels with a work group per cloud or pair that reads its key points.
struct KeyParameters {
  uint first;  // the first work group's
  uint pairs;  // in the batch
  uint keys;   // key points of a cloud
};

// Kernels that take the numbers of a tensor one by one.
struct ItemParameters {
  uint items;
};

struct RowSumParameters {
  uint rows;
  uint vectors;  // vec4s of a row
};

// Kernels that work on transport plans.
struct SinkhornParameters {
  uint first;      // tile, or plan, of the first work group
  uint iteration;  // from 1; the last one, where that is over
  uint rows;       // as many as all points
};

#endif
