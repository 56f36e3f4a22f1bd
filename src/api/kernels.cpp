#include <bitr/kernels.hpp>
#include <cmath>
#include <limits>
#include <string>

#include "api/kernel_runner.hpp"
#include "core/guarded.hpp"

namespace bitr {

struct KeptKernel::Impl {
  Device device;
  explicit Impl(Device where) : device(std::move(where)) {}
  virtual ~Impl() = default;
  virtual std::size_t workspace_bytes() const = 0;
};

KeptKernel::KeptKernel(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
KeptKernel::KeptKernel(KeptKernel&&) noexcept = default;
KeptKernel& KeptKernel::operator=(KeptKernel&&) noexcept = default;
KeptKernel::~KeptKernel() = default;
const Device& KeptKernel::device() const { return impl_->device; }
std::size_t KeptKernel::workspace_bytes() const { return impl_->workspace_bytes(); }

namespace {

using graph::ElementKind;
using graph::Rows;
using Index = std::span<const std::uint32_t>;

constexpr int most_neighbors = 64;
constexpr std::size_t most_rows = std::numeric_limits<std::uint32_t>::max() / most_neighbors;

std::size_t size(int x) { return static_cast<std::size_t>(x); }

// Checks throw Failure (`invalid_argument`).
void check_range(const char* name, int value, int low, int high) {
  if (value < low || value > high)
    refuse(std::string(name) + " is " + std::to_string(value) + ", must be " + std::to_string(low) + " … " +
           std::to_string(high));
}

// How many rows of `width` numbers there are.
std::size_t count_rows(const char* name, std::size_t numbers, std::size_t width) {
  if (numbers % width != 0)
    refuse(std::string(name) + ": " + std::to_string(numbers) + " numbers are not rows of " +
           std::to_string(width));
  if (numbers / width > most_rows)
    refuse(std::string(name) + ": " + std::to_string(numbers / width) + " rows, at most " +
           std::to_string(most_rows));
  return numbers / width;
}

void check_size(const char* name, std::size_t numbers, std::size_t needed) {
  if (numbers != needed)
    refuse(std::string(name) + " has " + std::to_string(numbers) + " numbers, must have " +
           std::to_string(needed));
}

void check_index(Index index, std::size_t rows) {
  for (std::size_t i = 0; i < index.size(); ++i)
    if (index[i] >= rows)
      refuse("index: entry " + std::to_string(i) + " is " + std::to_string(index[i]) + ", of " +
             std::to_string(rows) + " rows");
}

// Inputs are added in the order in which a run gets them, then the result.
graph::TensorId add(graph::Graph& graph, const char* name, Rows rows, int per_row, int width) {
  return graph.add({.name = name,
                    .rows = rows,
                    .per_row = per_row,
                    .width = width,
                    .kind = ElementKind::real,
                    .fiber = {}});
}

graph::TensorId add_index(graph::Graph& graph, Rows rows, int k) {
  return graph.add(
      {.name = "index", .rows = rows, .per_row = k, .width = 1, .kind = ElementKind::index, .fiber = {}});
}

graph::Graph finished(graph::Graph graph, ops::Op op, std::vector<graph::TensorId> inputs,
                      graph::TensorId result) {
  graph.outputs.set(graph::Output::result, result);
  graph.append(graph.tensors[result].name, std::move(op), std::move(inputs), {result});
  return graph;
}

// `points` and the rows that look at them, which are Rows::key, in one segment.
graph::BatchLayout layout_of(std::size_t points, std::size_t rows) {
  graph::BatchLayout layout;
  layout.cloud_offset = {0, static_cast<std::uint32_t>(points)};
  layout.key_offset = {0, static_cast<std::uint32_t>(rows)};
  return layout;
}

template <class T, class Shape>
struct Kept : KeptKernel::Impl {
  Shape shape;
  std::vector<KernelRunner<T>> runners;  // one per graph

  Kept(const Device& where, const Shape& what, std::vector<graph::Graph> graphs) : Impl(where), shape(what) {
    for (graph::Graph& graph : graphs) runners.emplace_back(device, std::move(graph));
  }
  std::size_t workspace_bytes() const override {
    std::size_t bytes = 0;
    for (const auto& runner : runners) bytes += runner.workspace_bytes();
    return bytes;
  }
};

// Runs a kept kernel; what it throws becomes the result.
template <class T, class Shape, class Body>
Result<void> run_kept(KeptKernel::Impl& impl, Body body) {
  return guarded([&]() -> Result<void> {
    body(static_cast<Kept<T, Shape>&>(impl));
    return {};
  });
}

// One call of a kernel; `numbers()` in its result, if the shape is right.
template <class Number, class Kernel, class Size, class Run>
Result<std::vector<Number>> once(Result<Kernel> kernel, Size numbers, Run run) {
  if (!kernel) return tl::unexpected(kernel.error());
  return guarded([&]() -> Result<std::vector<Number>> {
    std::vector<Number> result(numbers());
    if (const auto done = run(*kernel, std::span<Number>(result)); !done) return tl::unexpected(done.error());
    return result;
  });
}

// ---- Nearest neighbours

void check(const KnnShape& shape) {
  check_range("k", shape.k, 1, most_neighbors);
  check_range("dim", shape.dim, 1, 8);
}

// Two graphs: points among themselves, and queries among references.
std::vector<graph::Graph> graphs_of(const KnnShape& shape) {
  graph::Graph own, asked;
  const auto points = add(own, "points", Rows::point, 1, shape.dim);
  const auto references = add(asked, "references", Rows::point, 1, shape.dim);
  const auto queries = add(asked, "queries", Rows::key, 1, shape.dim);
  const auto index = add_index(own, Rows::point, shape.k), found = add_index(asked, Rows::key, shape.k);
  const ops::Knn op{.k = shape.k, .dim = shape.dim, .exclude_self = true, .search = shape.search};
  return {finished(std::move(own), op, {points, points}, index),
          finished(std::move(asked), ops::Knn{.k = op.k, .dim = op.dim, .exclude_self = false},
                   {queries, references}, found)};
}

// What lies in float's or double's range when squared and summed.
template <class T>
constexpr double most_coordinate = std::is_same_v<T, float> ? 1e18 : 1e150;

// The offsets, whole even if the caller gives none.
template <class T>
std::vector<std::uint32_t> checked(const char* name, const Segments<T>& segments, int dim) {
  const std::size_t rows = count_rows(name, segments.points.size(), size(dim));
  for (std::size_t i = 0; i < segments.points.size(); ++i)
    if (const T x = segments.points[i]; !(std::abs(x) <= T(most_coordinate<T>)))
      refuse(std::string(name) + ": point " + std::to_string(i / size(dim)) + " has a coordinate of " +
             std::to_string(x) + ", must be finite and within ±" +
             (std::is_same_v<T, float> ? "1e18" : "1e150"));
  const Index offsets = segments.offsets;
  if (offsets.empty()) return {0, static_cast<std::uint32_t>(rows)};
  const auto wrong = [&](std::size_t i, const std::string& must) {
    refuse(std::string(name) + ": offset " + std::to_string(i) + " is " + std::to_string(offsets[i]) +
           ", must be " + must);
  };
  if (offsets.front() != 0) wrong(0, "0");
  for (std::size_t i = 1; i < offsets.size(); ++i)
    if (offsets[i] < offsets[i - 1])
      wrong(i, "at least the one before it, " + std::to_string(offsets[i - 1]));
  if (offsets.back() != rows) wrong(offsets.size() - 1, "the number of points, " + std::to_string(rows));
  return {offsets.begin(), offsets.end()};
}

template <class T>
void search(Kept<T, KnnShape>& kept, const Segments<T>* queries, const Segments<T>& references,
            std::span<std::uint32_t> index) {
  const int k = kept.shape.k, dim = kept.shape.dim;
  const char* name = queries ? "references" : "points";
  graph::BatchLayout layout;
  layout.cloud_offset = checked(name, references, dim);
  layout.key_offset = queries ? checked("queries", *queries, dim) : layout.cloud_offset;
  if (layout.key_offset.size() != layout.cloud_offset.size())
    refuse("queries have " + std::to_string(layout.key_offset.size() - 1) + " segments, references " +
           std::to_string(layout.clouds()));
  const std::size_t least = size(queries ? k : k + 1);
  for (std::uint32_t s = 0; s < layout.clouds(); ++s) {
    const std::size_t count = layout.cloud_offset[s + 1] - layout.cloud_offset[s];
    if (layout.key_offset[s + 1] > layout.key_offset[s] && count < least)
      refuse("segment " + std::to_string(s) + " has " + std::to_string(count) + " " + name +
             ", k = " + std::to_string(k) + " needs at least " + std::to_string(least));
  }
  check_size("index", index.size(), layout.rows(Rows::key) * size(k));
  if (index.empty()) return;
  std::vector<Numbers<T>> inputs = {references.points};
  if (queries) inputs.emplace_back(queries->points);
  kept.runners[queries ? 1 : 0].run(layout, inputs, index);
}

// ---- Clebsch–Gordan products

void check(const CgProductShape& shape) {
  check_range("channels", shape.channels, 1, 1024);
  check_range("k", shape.k, 0, most_neighbors);
  const auto side = [](const std::string& name, int a, int b, int out) {
    check_range((name + " of a").c_str(), a, 0, 2);
    check_range((name + " of b").c_str(), b, 0, 2);
    check_range((name + " of out").c_str(), out, std::abs(a - b), std::min(a + b, 2));
  };
  side("p", shape.a.p, shape.b.p, shape.out.p);
  side("q", shape.a.q, shape.b.q, shape.out.q);
}

// Numbers of a row's entry.
struct Widths {
  int a, b, out;
  explicit Widths(const CgProductShape& shape)
      : a(shape.channels * shape.a.dim()),
        b((shape.shared_b ? 1 : shape.channels) * shape.b.dim()),
        out(shape.channels * shape.out.dim()) {}
};

std::vector<graph::Graph> graphs_of(const CgProductShape& shape) {
  graph::Graph graph;
  const Widths widths(shape);
  const bool edges = shape.k > 0;
  const Rows rows = edges ? Rows::key : Rows::point;
  const int per_row = edges ? shape.k : 1;
  std::vector<graph::TensorId> inputs = {add(graph, "a", Rows::point, 1, widths.a),
                                         add(graph, "b", rows, per_row, widths.b)};
  if (edges) inputs.push_back(add_index(graph, rows, shape.k));
  const auto out = add(graph, "out", rows, per_row, widths.out);
  return {finished(std::move(graph),
                   ops::CgProduct{shape.a, shape.b, shape.out, shape.channels, shape.shared_b}, inputs, out)};
}

template <class T>
void multiply(Kept<T, CgProductShape>& kept, const CgProductInput<T>& input, std::span<T> out) {
  const Widths widths(kept.shape);
  const std::size_t k = size(kept.shape.k), rows = count_rows("a", input.a.size(), size(widths.a));
  if (k == 0 && !input.index.empty()) refuse("there is an index, but k is 0");
  const std::size_t results = k ? count_rows("index", input.index.size(), k) : rows;
  const std::size_t entries = k ? input.index.size() : rows;
  check_size("b", input.b.size(), entries * size(widths.b));
  check_size("the result", out.size(), entries * size(widths.out));
  check_index(input.index, rows);
  if (out.empty()) return;
  std::vector<Numbers<T>> inputs = {input.a, input.b};
  if (k) inputs.emplace_back(input.index);
  kept.runners.front().run(layout_of(rows, results), inputs, out);
}

// ---- Attention

void check(const AttentionShape& shape) {
  check_range("heads", shape.heads, 1, 64);
  check_range("key_width", shape.key_width, 1, 1024);
  check_range("value_width", shape.value_width, 1, 1024);
  check_range("k", shape.k, 1, most_neighbors);
  if (!std::isfinite(shape.scale)) refuse("scale is " + std::to_string(shape.scale) + ", must be finite");
}

std::vector<graph::Graph> graphs_of(const AttentionShape& shape) {
  graph::Graph graph;
  const std::vector<graph::TensorId> inputs = {
      add(graph, "queries", Rows::key, shape.heads, shape.key_width),
      add(graph, "keys", Rows::point, shape.heads, shape.key_width),
      add(graph, "values", Rows::point, shape.heads, shape.value_width),
      add_index(graph, Rows::key, shape.k)};
  const auto out = add(graph, "out", Rows::key, shape.heads, shape.value_width);
  return {finished(std::move(graph), ops::NeighbourAttention{shape.scale}, inputs, out)};
}

template <class T>
void attend(Kept<T, AttentionShape>& kept, const AttentionInput<T>& input, std::span<T> out) {
  const AttentionShape& shape = kept.shape;
  const std::size_t key = size(shape.heads * shape.key_width), value = size(shape.heads * shape.value_width);
  const std::size_t rows = count_rows("keys", input.keys.size(), key);
  const std::size_t queries = count_rows("index", input.index.size(), size(shape.k));
  check_size("values", input.values.size(), rows * value);
  check_size("queries", input.queries.size(), queries * key);
  check_size("the result", out.size(), queries * value);
  check_index(input.index, rows);
  if (out.empty()) return;
  const std::vector<Numbers<T>> inputs = {input.queries, input.keys, input.values, input.index};
  kept.runners.front().run(layout_of(rows, queries), inputs, out);
}

template <class Kernel, class T, class Shape>
Result<Kernel> make(const Device& device, const Shape& shape) {
  return guarded([&]() -> Result<Kernel> {
    check(shape);
    return Kernel(std::make_unique<Kept<T, Shape>>(device, shape, graphs_of(shape)));
  });
}

}  // namespace

template <Real T>
Result<KnnKernel<T>> make_knn(const Device& device, const KnnShape& shape) {
  return make<KnnKernel<T>, T>(device, shape);
}
template <Real T>
Result<void> KnnKernel<T>::run(const Segments<T>& points, std::span<std::uint32_t> index) {
  return run_kept<T, KnnShape>(*impl_, [&](auto& kept) { search<T>(kept, nullptr, points, index); });
}
template <Real T>
Result<void> KnnKernel<T>::run(const Segments<T>& queries, const Segments<T>& references,
                               std::span<std::uint32_t> index) {
  return run_kept<T, KnnShape>(*impl_, [&](auto& kept) { search<T>(kept, &queries, references, index); });
}
template <Real T>
Result<std::vector<std::uint32_t>> knn(const Device& device, const KnnShape& shape,
                                       const Segments<T>& points) {
  return once<std::uint32_t>(
      make_knn<T>(device, shape), [&] { return points.points.size() / size(shape.dim) * size(shape.k); },
      [&](auto& kernel, auto index) { return kernel.run(points, index); });
}
template <Real T>
Result<std::vector<std::uint32_t>> knn(const Device& device, const KnnShape& shape,
                                       const Segments<T>& queries, const Segments<T>& references) {
  return once<std::uint32_t>(
      make_knn<T>(device, shape), [&] { return queries.points.size() / size(shape.dim) * size(shape.k); },
      [&](auto& kernel, auto index) { return kernel.run(queries, references, index); });
}

template <Real T>
Result<CgProductKernel<T>> make_cg_product(const Device& device, const CgProductShape& shape) {
  return make<CgProductKernel<T>, T>(device, shape);
}
template <Real T>
Result<void> CgProductKernel<T>::run(const CgProductInput<T>& input, std::span<T> out) {
  return run_kept<T, CgProductShape>(*impl_, [&](auto& kept) { multiply<T>(kept, input, out); });
}
template <Real T>
Result<std::vector<T>> cg_product(const Device& device, const CgProductShape& shape,
                                  const CgProductInput<T>& input) {
  const auto numbers = [&] {
    const Widths widths(shape);
    return (shape.k > 0 ? input.index.size() : input.a.size() / size(widths.a)) * size(widths.out);
  };
  return once<T>(make_cg_product<T>(device, shape), numbers,
                 [&](auto& kernel, auto out) { return kernel.run(input, out); });
}

template <Real T>
Result<AttentionKernel<T>> make_attention(const Device& device, const AttentionShape& shape) {
  return make<AttentionKernel<T>, T>(device, shape);
}
template <Real T>
Result<void> AttentionKernel<T>::run(const AttentionInput<T>& input, std::span<T> out) {
  return run_kept<T, AttentionShape>(*impl_, [&](auto& kept) { attend<T>(kept, input, out); });
}
template <Real T>
Result<std::vector<T>> attention(const Device& device, const AttentionShape& shape,
                                 const AttentionInput<T>& input) {
  const auto numbers = [&] {
    return input.index.size() / size(shape.k) * size(shape.heads * shape.value_width);
  };
  return once<T>(make_attention<T>(device, shape), numbers,
                 [&](auto& kernel, auto out) { return kernel.run(input, out); });
}

#define BITR_KERNELS(T)                                                                                \
  template class KnnKernel<T>;                                                                         \
  template class CgProductKernel<T>;                                                                   \
  template class AttentionKernel<T>;                                                                   \
  template Result<KnnKernel<T>> make_knn(const Device&, const KnnShape&);                              \
  template Result<CgProductKernel<T>> make_cg_product(const Device&, const CgProductShape&);           \
  template Result<AttentionKernel<T>> make_attention(const Device&, const AttentionShape&);            \
  template Result<std::vector<std::uint32_t>> knn(const Device&, const KnnShape&, const Segments<T>&); \
  template Result<std::vector<std::uint32_t>> knn(const Device&, const KnnShape&, const Segments<T>&,  \
                                                  const Segments<T>&);                                 \
  template Result<std::vector<T>> cg_product(const Device&, const CgProductShape&,                     \
                                             const CgProductInput<T>&);                                \
  template Result<std::vector<T>> attention(const Device&, const AttentionShape&, const AttentionInput<T>&);
BITR_KERNELS(float)
BITR_KERNELS(double)

}  // namespace bitr
