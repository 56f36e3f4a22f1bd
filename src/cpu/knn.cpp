// Compiled without contraction into fused multiply-adds, so that brute force and the tree see the same bits
// and ties are ties in both.
#include <algorithm>
#include <limits>
#include <nanoflann.hpp>

#include "cpu/nearest_set.hpp"

namespace bitr::cpu {
namespace {

// Above this many references per cloud a k-d tree is used: it beats brute force from here on where many
// neighbours are wanted, from 1000 on where few are (docs/performance.md).
constexpr std::size_t brute_force_limit = 200;
constexpr std::size_t leaf_points = 20;

// Fewer than k are found only when distances are not finite. Any valid row will do then: the numbers that
// made them reach the pose and mark it as failed.
template <class T>
void write_nearest(const std::vector<Candidate<T>>& found, const ops::Knn& op, std::uint32_t base,
                   std::uint32_t* out) {
  for (int i = 0; i < op.k; ++i) {
    const auto at = static_cast<std::size_t>((i + 1) * op.dilation - 1);
    out[i] = base + (at < found.size() ? index_of<T>(found[at]) : 0);
  }
}

// Structure of arrays, padded to whole lanes with points at infinity.
template <class T>
struct Coordinates {
  int dim;
  std::size_t count, padded;
  std::vector<T> values;

  Coordinates(const T* points, std::size_t n, int dimension)
      : dim(dimension),
        count(n),
        padded((n + 4 * lane_count - 1) / (4 * lane_count) * (4 * lane_count)),
        values(padded * dimension, std::numeric_limits<T>::infinity()) {
    for (std::size_t i = 0; i < n; ++i)
      for (int a = 0; a < dim; ++a) values[a * padded + i] = points[i * dim + a];
  }
};

template <class T>
class BruteForce {
 public:
  BruteForce(const Coordinates<T>& points, const ops::Knn& op)
      : points_(points), op_(op), k_(op.k * op.dilation), distance_(points.padded), near_(points.count + 1) {}

  // `self`: reference to leave out; ≥ count for none.
  void search(const T* query, std::size_t self, std::uint32_t base, std::uint32_t* out) {
    distances(query);
    if (self < points_.count) distance_[self] = std::numeric_limits<T>::infinity();
    const T limit = bound();
    // Without branches: whether a point is a candidate is not predictable.
    std::size_t count = 0;
    const T* distance = distance_.data();
    std::uint32_t* near = near_.data();
    for (std::size_t j = 0; j < points_.count; ++j) {
      near[count] = static_cast<std::uint32_t>(j);
      count += distance[j] <= limit;
    }
    found_.clear();
    for (std::size_t i = 0; i < count; ++i) found_.emplace_back(Candidate<T>{distance_[near_[i]], near_[i]});
    sort_(found_, limit);
    write_nearest(found_, op_, base, out);
  }

 private:
  void distances(const T* query) {
    for (std::size_t i = 0; i < points_.padded; i += lane_count) {
      Lanes<T> sum = Lanes<T>::Zero();
      for (int a = 0; a < points_.dim; ++a) {
        const Lanes<T> d =
            query[a] - Eigen::Map<const Lanes<T>>(points_.values.data() + a * points_.padded + i);
        sum += d * d;
      }
      Eigen::Map<Lanes<T>>(distance_.data() + i) = sum;
    }
  }

  // An upper bound of the k-th smallest distance: split the points into at least k groups; k group minima are
  // k distances. Without enough groups every point is a candidate.
  T bound() {
    const std::size_t vectors = points_.padded / lane_count;
    const std::size_t span =
        std::max<std::size_t>(1, vectors * lane_count / (static_cast<std::size_t>(k_) * 2));
    const std::size_t chunks = (vectors + span - 1) / span;
    if (chunks * lane_count < static_cast<std::size_t>(k_)) return std::numeric_limits<T>::infinity();
    minima_.resize(chunks * lane_count);
    for (std::size_t c = 0; c < chunks; ++c) {
      Lanes<T> least = Lanes<T>::Constant(std::numeric_limits<T>::infinity());
      for (std::size_t v = c * span; v < std::min(vectors, (c + 1) * span); ++v)
        least = least.min(Eigen::Map<const Lanes<T>>(distance_.data() + v * lane_count));
      Eigen::Map<Lanes<T>>(minima_.data() + c * lane_count) = least;
    }
    std::nth_element(minima_.begin(), minima_.begin() + (k_ - 1), minima_.end());
    return minima_[k_ - 1];
  }

  const Coordinates<T>& points_;
  const ops::Knn& op_;
  const int k_;
  std::vector<T> distance_, minima_;
  std::vector<std::uint32_t> near_;
  std::vector<Candidate<T>> found_;
  CandidateSort<T> sort_;
};

// nanoflann's view of the points.
template <class T>
struct PointRows {
  const T* points;
  std::size_t count;
  std::size_t kdtree_get_point_count() const { return count; }
  T kdtree_get_pt(std::size_t i, std::size_t axis) const { return points[3 * i + axis]; }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

// Σ (a − b)² in the order of BruteForce.
template <class T>
struct SquaredDistance {
  using ElementType = T;
  using DistanceType = T;
  const PointRows<T>& rows;
  explicit SquaredDistance(const PointRows<T>& source) : rows(source) {}
  T evalMetric(const T* a, std::size_t b, std::size_t) const {
    T sum = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const T d = a[axis] - rows.kdtree_get_pt(b, axis);
      sum += d * d;
    }
    return sum;
  }
  template <class U, class V>
  T accum_dist(U a, V b, std::size_t) const {
    return (a - b) * (a - b);
  }
};

template <class T>
using Tree = nanoflann::KDTreeSingleIndexAdaptor<SquaredDistance<T>, PointRows<T>, 3, std::uint32_t>;

template <class T>
class KnnKernel : public Kernel<T> {
 public:
  explicit KnnKernel(const ops::Knn& op) : op_(op) {}

  void run(const Arguments& args) const override {
    const Slot queries = args.in[0], references = args.in[1];
    for (std::uint32_t segment = 0; segment < args.layout.segments(queries.rows); ++segment) {
      const std::size_t q0 = args.layout.begin(queries.rows, segment),
                        q1 = args.layout.begin(queries.rows, segment + 1);
      const std::size_t r0 = args.layout.begin(references.rows, segment);
      const std::size_t n = args.layout.begin(references.rows, segment + 1) - r0;
      search(args.pool, queries.as<T>() + q0 * op_.dim, q1 - q0, references.as<T>() + r0 * op_.dim, n,
             static_cast<std::uint32_t>(r0), args.out[0].as<std::uint32_t>() + q0 * op_.k);
    }
  }

 private:
  void search(ThreadPool& pool, const T* queries, std::size_t query_count, const T* references,
              std::size_t count, std::uint32_t base, std::uint32_t* out) const {
    if (wants_tree(query_count, count))
      return search_tree(pool, queries, query_count, references, count, base, out);
    const Coordinates<T> points(references, count, op_.dim);
    pool.parallel_for(query_count, std::clamp<std::size_t>(query_count / 8, 1, 64),
                      [&](std::size_t q0, std::size_t q1) {
                        BruteForce<T> search(points, op_);
                        for (std::size_t q = q0; q < q1; ++q)
                          search.search(queries + q * op_.dim, self(q), base, out + q * op_.k);
                      });
  }
  void search_tree(ThreadPool& pool, const T* queries, std::size_t query_count, const T* references,
                   std::size_t count, std::uint32_t base, std::uint32_t* out) const {
    const PointRows<T> rows{references, count};
    const Tree<T> tree(3, rows, {leaf_points});
    // A cloud that searches itself does so in the order of the tree's leaves: near queries visit the same
    // nodes, and bound each other.
    const bool leaf_order = op_.exclude_self;
    const auto k = static_cast<std::size_t>(op_.k * op_.dilation);
    pool.parallel_for(query_count, std::clamp<std::size_t>(query_count / 16, 16, 512),
                      [&](std::size_t first, std::size_t last) {
                        NearestSet<T> nearest(k);
                        RecentQueries<T> recent;
                        for (std::size_t i = first; i < last; ++i) {
                          const std::size_t q = leaf_order ? tree.vAcc[i] : i;
                          const T* query = queries + 3 * q;
                          nearest.reset(static_cast<std::uint32_t>(self(q)), recent.bound(query));
                          tree.findNeighbors(nearest, query, {});
                          const std::vector<Candidate<T>>& found = nearest.finish();
                          write_nearest(found, op_, base, out + q * op_.k);
                          if (nearest.full()) recent.add(query, distance_of<T>(found[k - 1]));
                        }
                      });
  }
  // The reference that a query is itself.
  std::size_t self(std::size_t query) const {
    return op_.exclude_self ? query : std::numeric_limits<std::uint32_t>::max();
  }
  bool wants_tree(std::size_t queries, std::size_t references) const {
    if (op_.dim != 3) return false;
    if (op_.exclude_self && op_.search != NeighborSearch::automatic)
      return op_.search == NeighborSearch::tree;
    return references > brute_force_limit && queries * 64 >= references;
  }

  const ops::Knn op_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::Knn& op) {
  return std::make_unique<KnnKernel<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::Knn& op) {
  return std::make_unique<KnnKernel<double>>(op);
}

}  // namespace bitr::cpu
