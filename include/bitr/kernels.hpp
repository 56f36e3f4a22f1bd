// The network's kernels on their own, without a model: nearest neighbours, Clebsch–Gordan products of
// features, attention over neighbour lists. The same call runs on every device: in float anywhere, in double
// on the CPU. Arrays are row-major in the caller's memory, [rows, …, numbers]; results do not depend on the
// number of threads, nor a row's on what else is in the call.
//
// knn(), cg_product() and attention() are one call each. Who calls again and again keeps a kernel instead
// (make_knn() and so on): it is compiled once, and so is its memory, which grows when a call is larger than
// all before it. A kept kernel belongs to one thread at a time.
//
// Errors of all of them: `invalid_argument` when a number of the shape is out of its range, sizes do not fit
// together, a row of an index does not exist, or there are more than 2³²/64 rows; `unsupported` for double on
// a Vulkan device; `invalid_argument` when an array is larger than the device can bind, `internal` when
// memory runs out; `device_lost`. Numbers are not looked at, but for knn's: what is not finite goes the way
// of arithmetic.
#pragma once

#include <bitr/degree.hpp>
#include <bitr/device.hpp>
#include <bitr/neighbor_search.hpp>
#include <bitr/result.hpp>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace bitr {

template <class T>
concept Real = std::same_as<T, float> || std::same_as<T, double>;

/// What every kept kernel is.
class KeptKernel {
 public:
  const Device& device() const;
  /// Held for arrays, on a Vulkan device with buffers for input and output; 0 before the first call.
  std::size_t workspace_bytes() const;

  struct Impl;
  explicit KeptKernel(std::unique_ptr<Impl> impl);
  KeptKernel(KeptKernel&&) noexcept;
  KeptKernel& operator=(KeptKernel&&) noexcept;
  ~KeptKernel();

 protected:
  std::unique_ptr<Impl> impl_;
};

// ---- Nearest neighbours

struct KnnShape {
  int k = 24;                                         ///< neighbours of a point, 1 … 64
  int dim = 3;                                        ///< coordinates of a point, 1 … 8
  NeighborSearch search = NeighborSearch::automatic;  ///< for points among themselves, where dim is 3
};

/// Points in segments that never see each other (clouds of a batch): segment s owns rows
/// offsets[s] … offsets[s+1] − 1, so offsets ascend from 0 to the number of points. Without offsets all
/// points are one segment.
template <Real T>
struct Segments {
  std::span<const T> points;  ///< [points, dim], in units of the caller's
  std::span<const std::uint32_t> offsets = {};
};

/// Exact nearest neighbours by Euclidean distance: for every query k rows of the references, all of the
/// query's segment, ascending by distance and equally far ones by row. Distances are sums of squared
/// differences, axis by axis in T, nothing fused: ties are the same on every device, unless a square is too
/// small for T (below 1e-38 in float).
/// More errors: `invalid_argument` for a segment with queries but too few references, which it names, and for
/// a coordinate that is not finite or beyond 1e18 (1e150 in double), whose square would be infinite.
template <Real T = float>
class KnnKernel : public KeptKernel {
 public:
  using KeptKernel::KeptKernel;
  /// Neighbours of every point among the others of its segment, of which there are at least k: a point is not
  /// its own neighbour, but one at the same place is. index: [points, k].
  Result<void> run(const Segments<T>& points, std::span<std::uint32_t> index);
  /// Neighbours of points among others: segment s of the queries looks in segment s of the references. There
  /// are as many of both, and at least k references wherever there is a query. index: [queries, k].
  Result<void> run(const Segments<T>& queries, const Segments<T>& references, std::span<std::uint32_t> index);
};

template <Real T = float>
Result<KnnKernel<T>> make_knn(const Device& device, const KnnShape& shape);
template <Real T = float>
Result<std::vector<std::uint32_t>> knn(const Device& device, const KnnShape& shape,
                                       const Segments<T>& points);
template <Real T = float>
Result<std::vector<std::uint32_t>> knn(const Device& device, const KnnShape& shape,
                                       const Segments<T>& queries, const Segments<T>& references);

// ---- Clebsch–Gordan products

struct CgProductShape {
  Degree a, b, out;       ///< 0 … 2 each; |a − b| ≤ out ≤ a + b for p and for q
  int channels = 1;       ///< in a and in the result, 1 … 1024
  bool shared_b = false;  ///< b has one channel, which meets all of a's; otherwise as many as a
  int k = 0;              ///< 0: row by row; 1 … 64: along the edges from every row to k neighbours
};

template <Real T>
struct CgProductInput {
  std::span<const T> a;  ///< [P, channels, dim of a]
  std::span<const T> b;  ///< [P, channels or 1, dim of b]; along edges [Q, k, channels or 1, dim of b]
  std::span<const std::uint32_t> index = {};  ///< along edges [Q, k], the neighbours: rows of a; else empty
};

/// For every channel's features a and b, the part of a ⊗ b that turns as degree `out`:
///   out_m = Σ_ij Q[(i, j), m] a_i b_j
/// with Q the orthonormal columns of the Clebsch–Gordan matrix that belong to D^out (Racah's formula); on
/// both sides, the product of two such. 1 ⊗ 1 → 0 is −a·b/√3, 1 ⊗ 1 → 1 is a×b/√2. Under all rotations,
/// turning a and b turns out. Along edges, edge (n, j) takes the a of row index[n, j] and a b of its own, as
/// the messages of an equivariant convolution do. Result: [P, channels, dim of out], along edges [Q, k,
/// channels, dim of out]. Error in float: 1e-6 of the largest Σ_ij |Q a b|.
template <Real T = float>
class CgProductKernel : public KeptKernel {
 public:
  using KeptKernel::KeptKernel;
  Result<void> run(const CgProductInput<T>& input, std::span<T> out);
};

template <Real T = float>
Result<CgProductKernel<T>> make_cg_product(const Device& device, const CgProductShape& shape);
template <Real T = float>
Result<std::vector<T>> cg_product(const Device& device, const CgProductShape& shape,
                                  const CgProductInput<T>& input);

// ---- Attention over neighbour lists

struct AttentionShape {
  int heads = 1;        ///< 1 … 64; they do not see each other
  int key_width = 1;    ///< D, numbers of a query or key per head, 1 … 1024
  int value_width = 1;  ///< V, numbers of a value per head, 1 … 1024
  int k = 24;           ///< neighbours of a query, 1 … 64
  double scale = 1;     ///< factor of the logits, often 1/√D; finite
};

template <Real T>
struct AttentionInput {
  std::span<const T> queries;            ///< [Q, heads, D]
  std::span<const T> keys;               ///< [P, heads, D]
  std::span<const T> values;             ///< [P, heads, V]
  std::span<const std::uint32_t> index;  ///< [Q, k], each query's neighbours: rows of keys and values
};

/// Every query attends to its own neighbours, with e_j = scale · ⟨query, key_j⟩ (as in the SE(3)-Transformer,
/// NeurIPS 2020, whose keys and values come from products like the above):
///   out = Σ_j softmax_j(e) value_j
/// Keys and values that belong to edges and not to points are rows like any other: P = Q·k, index 0, 1, 2, …
/// Result: [Q, heads, V]. Error in float: 1e-5 of the largest |value| where |e| ≤ 30 and D ≤ 256; it grows
/// with both.
template <Real T = float>
class AttentionKernel : public KeptKernel {
 public:
  using KeptKernel::KeptKernel;
  Result<void> run(const AttentionInput<T>& input, std::span<T> out);
};

template <Real T = float>
Result<AttentionKernel<T>> make_attention(const Device& device, const AttentionShape& shape);
template <Real T = float>
Result<std::vector<T>> attention(const Device& device, const AttentionShape& shape,
                                 const AttentionInput<T>& input);

}  // namespace bitr
