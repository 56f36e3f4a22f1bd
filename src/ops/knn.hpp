// knn: the k nearest references of every query, within the query's own cloud (or pair).
// Distances are Σ (q − p)² in T, differences taken first. Every segment of references holds more than
// k · dilation rows (k · dilation when the query is not among them).
// in  queries T[Q, dim]
// in  references T[P, dim]      the same tensor if `exclude_self`
// out index u32[Q, k]
//       global rows of `references`, ascending (distance, index); ties → lower index
// error float_error() is 0: the lists are exact for distances in T
#pragma once

#include <bitr/neighbor_search.hpp>

namespace bitr::ops {

struct Knn {
  int k = 24;
  int dilation = 1;          ///< every so many of the nearest k · dilation, the last included
  int dim = 3;               ///< 3, or 6 for pairs of key points
  bool exclude_self = true;  ///< query row i is reference row i and never its own neighbour
  NeighborSearch search = NeighborSearch::automatic;  ///< for 3-D points among themselves

  double float_error() const { return 0; }
};

}  // namespace bitr::ops
