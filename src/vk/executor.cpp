#include "vk/executor.hpp"

#include <algorithm>
#include <cstring>
#include <map>
#include <set>
#include <utility>

#include "core/failure.hpp"
#include "vk/memory.hpp"

namespace bitr::vk {
namespace {

using graph::Rows;
using graph::TensorId;

constexpr std::uint32_t guard_pattern = 0xa5a5a5a5;

std::size_t row_bytes(const graph::TensorInfo& info) {
  const bool index = info.kind == graph::ElementKind::index;
  const auto width = index ? static_cast<std::uint32_t>(info.width) : padded(info.width);
  return sizeof(float) * static_cast<std::size_t>(info.per_row) * width;
}

// The first cloud owns what all clouds do: no other batch within the capacity has a larger one.
graph::BatchLayout gathered(graph::BatchLayout layout) {
  for (auto* offsets : {&layout.cloud_offset, &layout.key_offset})
    if (offsets->size() > 1) std::fill(offsets->begin() + 1, offsets->end(), offsets->back());
  return layout;
}

// The least layout that holds both, as the executor understands layouts: by their totals. `growth`: room for
// that many times the points of `layout`.
graph::BatchLayout joined(const graph::BatchLayout& largest, const graph::BatchLayout& layout,
                          double growth) {
  const std::size_t clouds = std::max(largest.clouds(), layout.clouds());
  const auto points = static_cast<std::size_t>(growth * static_cast<double>(layout.rows(Rows::point)));
  const auto offsets = [&](std::size_t total) {
    std::vector<std::uint32_t> all(clouds + 1, static_cast<std::uint32_t>(total));
    all.front() = 0;
    return all;
  };
  graph::BatchLayout both;
  both.cloud_offset = offsets(std::max(largest.rows(Rows::point), points));
  both.key_points = layout.key_points;
  if (!layout.key_offset.empty() || !largest.key_offset.empty())
    both.key_offset = offsets(std::max(largest.rows(Rows::key), layout.rows(Rows::key)));
  return both;
}

// For every node, the one that is its gradient or that it is the gradient of; −1: none.
std::vector<int> gradients(const graph::Graph& graph) {
  std::vector<int> partner(graph.nodes.size(), -1), made_by(graph.tensors.size(), -1);
  for (int n = 0; n < static_cast<int>(graph.nodes.size()); ++n) {
    for (const TensorId id : graph.nodes[n].outputs) made_by[id] = n;
    std::visit(
        [&](const auto& op) {
          if constexpr (requires { op.grad_output_at(0); })
            if (const int of = made_by[graph.nodes[n].inputs[op.inputs]]; of >= 0) {
              partner[n] = of;
              partner[of] = n;
            }
        },
        graph.nodes[n].op);
  }
  return partner;
}

constexpr Rows table_rows[] = {Rows::point, Rows::key, Rows::pair_key};

std::size_t largest_tile_count(const graph::BatchLayout& layout, Rows rows) {
  return layout.rows(rows) / tile_rows + layout.segments(rows);
}

}  // namespace

graph::BatchLayout Capacity::layout() const {
  std::vector<std::uint32_t> sizes(2 * pairs, 0);
  sizes.front() = static_cast<std::uint32_t>(points);
  return {sizes, key_points};
}

Executor::Executor(std::shared_ptr<const Context> context, graph::Graph graph,
                   const graph::BatchLayout& largest, const ExecutorOptions& options)
    : context_(std::move(context)),
      largest_(gathered(largest)),
      options_(options),
      schedule_(context_->capabilities().groups),
      host_schedule_(context_->capabilities().groups),
      recorder_(*context_),
      host_recorder_(*context_),
      milliseconds_(graph.nodes.size()),
      starts_(graph.nodes.size()),
      timestamps_(*context_, graph.nodes.size()),
      commands_(*context_) {
  load(std::move(graph));
  allocate(1);
  upload_constants();
  constant_staging_ = {};
}

void Executor::replace(graph::Graph graph) {
  if (graph.nodes.size() != graph_.nodes.size() || graph.tensors.size() != own_tensors_)
    throw Failure(ErrorCode::internal, "the graph to go on with has other operations");
  load(std::move(graph));
  const bool roomy = fits();
  if (roomy)
    place_constants();
  else
    allocate(1.25);  // they will change again
  upload_constants();
  prepared_ = false;
  recorded_ = recorded_ && roomy;
}

void Executor::load(graph::Graph graph) {
  graph_ = std::move(graph);
  own_tensors_ = graph_.tensors.size();
  kernels_.clear();
  const std::vector<int> differentiated = gradients(graph_);
  for (std::size_t n = 0; n < graph_.nodes.size(); ++n) {
    const graph::Node& node = graph_.nodes[n];
    KernelContext site{*context_, {}, {}, largest_};
    for (TensorId id : node.inputs) site.in.push_back(graph_.tensors[id]);
    for (TensorId id : node.outputs) site.out.push_back(graph_.tensors[id]);
    const int partner = differentiated[n];
    site.saved =
        partner > static_cast<int>(n) || (partner >= 0 && kernels_[partner]->saved_bytes(largest_) > 0);
    kernels_.push_back(kernel_for(site, node.op));
  }
  find_inputs();
  add_memory(differentiated);
}

// Without what add_memory() added.
graph::Graph Executor::own_graph() const {
  graph::Graph graph = graph_;
  graph.tensors.resize(own_tensors_);
  for (std::size_t n = 0; n < graph.nodes.size(); ++n) {
    graph.nodes[n].inputs.resize(memory_[n].inputs);
    graph.nodes[n].outputs.resize(memory_[n].outputs);
  }
  return graph;
}

TensorId Executor::add_tensor(const std::string& name) {
  return graph_.add({.name = name, .rows = Rows::pair, .fiber = {}});
}

void Executor::add_memory(const std::vector<int>& differentiated) {
  memory_.assign(graph_.nodes.size(), {});
  std::map<std::pair<TensorId, std::string>, TensorId> lists;  // by index tensor and name
  for (std::size_t n = 0; n < graph_.nodes.size(); ++n) {
    graph::Node& node = graph_.nodes[n];
    NodeMemory& memory = memory_[n];
    memory.inputs = node.inputs.size();
    memory.outputs = node.outputs.size();
    if (const int partner = differentiated[n]; partner > static_cast<int>(n)) {
      memory.saves = kernels_[n]->saved_bytes(largest_) > 0;
      if (memory.saves) memory.saved = add_tensor(node.name + ".saved");
    } else if (partner >= 0) {
      memory.saved = memory_[partner].saved;
    }
    if (const int input = kernels_[n]->listed_input(); input >= 0) {
      const auto [place, added] =
          lists.emplace(std::pair(node.inputs[input], kernels_[n]->list_name()), graph::no_tensor);
      if (added) place->second = add_tensor(node.name + ".lists");
      memory.lists = place->second;
      memory.makes_lists = added;
    }
    memory.scratch = add_tensor(node.name + ".scratch");
    node.outputs.push_back(memory.scratch);
    if (memory.saved != graph::no_tensor) (memory.saves ? node.outputs : node.inputs).push_back(memory.saved);
    if (memory.lists != graph::no_tensor)
      (memory.makes_lists ? node.outputs : node.inputs).push_back(memory.lists);
  }
}

void Executor::upload_constants() {
  if (constant_buffer_.size() == 0) return;
  if (constant_staging_.size() < constant_buffer_.size())
    constant_staging_ = Buffer(*context_, constant_buffer_.size(), true);
  for (std::size_t i = 0; i < kernels_.size(); ++i)
    if (const auto& numbers = kernels_[i]->constants(); !numbers.empty())
      std::memcpy(constant_staging_.data() + constants_[i].offset, numbers.data(),
                  numbers.size() * sizeof(std::uint32_t));
  const std::size_t bytes = constant_bytes();
  commands_.copy({constant_staging_.handle(), 0, bytes}, {constant_buffer_.handle(), 0, bytes});
}

void Executor::find_inputs() {
  inputs_.clear();
  std::set<TensorId> made, read;
  for (const graph::Node& node : graph_.nodes) {
    made.insert(node.outputs.begin(), node.outputs.end());
    read.insert(node.inputs.begin(), node.inputs.end());
  }
  for (TensorId id : read)
    if (!made.count(id)) inputs_.push_back(id);
  outputs_ = graph_.readable();
}

std::vector<std::size_t> Executor::tensor_bytes(const graph::BatchLayout& layout) const {
  std::vector<std::size_t> sizes;
  for (std::size_t i = 0; i < own_tensors_; ++i)
    sizes.push_back(layout.rows(graph_.tensors[i].rows) * row_bytes(graph_.tensors[i]));
  sizes.resize(graph_.tensors.size(), 0);
  for (std::size_t n = 0; n < kernels_.size(); ++n) {
    const NodeMemory& memory = memory_[n];
    sizes[memory.scratch] = kernels_[n]->scratch_bytes(layout);
    if (memory.saves) sizes[memory.saved] = kernels_[n]->saved_bytes(layout);
    if (memory.makes_lists) sizes[memory.lists] = kernels_[n]->list_bytes(layout);
  }
  return sizes;
}

bool Executor::fits() const {
  const std::vector<std::size_t> sizes = tensor_bytes(largest_);
  for (std::size_t i = 0; i < sizes.size(); ++i)
    if (sizes[i] > 0 && sizes[i] + options_.guard_bytes > capacities_[i]) return false;
  return constant_bytes() <= constant_buffer_.size();
}

std::size_t Executor::constant_bytes() const {
  std::size_t bytes = 0;
  for (const KernelPtr& kernel : kernels_)
    bytes += aligned(kernel->constants().size() * sizeof(std::uint32_t), context_->capabilities().alignment);
  return bytes;
}

void Executor::place_constants() {
  constants_.clear();
  std::size_t at = 0;
  for (const KernelPtr& kernel : kernels_) {
    const std::size_t bytes = kernel->constants().size() * sizeof(std::uint32_t);
    constants_.push_back({constant_buffer_.handle(), at, bytes});
    at += aligned(bytes, context_->capabilities().alignment);
  }
}

// `slack`: more memory by this factor for what depends on the constants.
void Executor::allocate(double slack) {
  const std::size_t alignment = context_->capabilities().alignment;
  const auto generous = [slack](std::size_t bytes) {
    return static_cast<std::size_t>(slack * static_cast<double>(bytes));
  };
  std::vector<std::size_t> sizes = tensor_bytes(largest_);
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    if (i >= own_tensors_ || graph_.tensors[i].rows == Rows::one) sizes[i] = generous(sizes[i]);
    if (sizes[i] > 0) sizes[i] = aligned(sizes[i] + options_.guard_bytes, alignment);
  }
  capacities_ = sizes;
  const graph::MemoryPlan plan =
      graph::plan_memory(graph_, sizes, options_.retain || options_.guard_bytes > 0);
  offsets_ = plan.offset;
  arena_ = Buffer(*context_, std::max<std::size_t>(plan.bytes, alignment), false);

  if (const std::size_t bytes = aligned(generous(constant_bytes()), alignment); bytes > 0)
    constant_buffer_ = Buffer(*context_, bytes, false);
  place_constants();

  table_bytes_ = 0;
  for (Rows rows : table_rows)
    table_bytes_ += aligned(16 * largest_tile_count(largest_, rows), alignment) +
                    aligned(sizeof(std::uint32_t) * (largest_.segments(rows) + 1), alignment);
  const std::size_t centroid_bytes = 16 * largest_.clouds();
  table_buffer_ = Buffer(*context_, table_bytes_ + centroid_bytes, false);
  centroids_ = {table_buffer_.handle(), table_bytes_, centroid_bytes};

  input_offset_.clear();
  std::size_t staging = table_bytes_, readback = 0;
  for (TensorId id : inputs_) {
    input_offset_.push_back(staging);
    staging += aligned(sizes[id], alignment);
  }
  for (TensorId id : outputs_) readback += aligned(sizes[id], alignment);
  staging_ = Buffer(*context_, staging, true);
  if (readback > 0) readback_ = Buffer(*context_, readback, true);

  if (options_.guard_bytes > 0) {
    Buffer pattern(*context_, arena_.size(), true);
    std::fill_n(reinterpret_cast<std::uint32_t*>(pattern.data()), arena_.size() / sizeof(guard_pattern),
                guard_pattern);
    commands_.copy({pattern.handle(), 0, pattern.size()}, {arena_.handle(), 0, pattern.size()});
  }
}

std::size_t Executor::workspace_bytes() const {
  return arena_.size() + table_buffer_.size() + constant_buffer_.size() + constant_staging_.size() +
         staging_.size() + readback_.size();
}

bool Executor::holds(const graph::BatchLayout& layout) const {
  return layout.clouds() <= largest_.clouds() && layout.rows(Rows::point) <= largest_.rows(Rows::point) &&
         layout.rows(Rows::key) <= largest_.rows(Rows::key) && layout.key_points == largest_.key_points;
}

void Executor::check_capacity(const graph::BatchLayout& layout) const {
  if (holds(layout)) return;
  throw Failure(ErrorCode::invalid_argument,
                "the batch has " + std::to_string(layout.pairs()) + " pairs and " +
                    std::to_string(layout.rows(Rows::point)) + " points, the plan holds " +
                    std::to_string(largest_.pairs()) + " and " + std::to_string(largest_.rows(Rows::point)));
}

// Room for what it held and for `layout`.
void Executor::grow(const graph::BatchLayout& layout) {
  const bool staged = constant_staging_.size() > 0;
  graph::Graph graph = own_graph();
  largest_ = joined(largest_, layout, options_.growth);
  prepared_ = recorded_ = false;
  // Before the new ones are taken.
  arena_ = {};
  staging_ = {};
  readback_ = {};
  try {
    load(std::move(graph));
    allocate(1);
    upload_constants();
  } catch (...) {
    largest_ = {};  // it holds nothing now
    throw;
  }
  if (!staged) constant_staging_ = {};
}

void Executor::prepare(const graph::BatchLayout& layout) {
  if (options_.growth > 0 && !holds(layout)) grow(layout);
  check_capacity(layout);
  if (prepared_ && layout == layout_) return;
  prepared_ = false;
  lay_out(layout);
  const std::vector<Dispatch> before = std::exchange(schedule_.dispatches(), {});
  make_schedule();
  if (!recorded_ || schedule_.dispatches() != before) {
    recorded_ = false;
    record_all();
    recorded_ = true;
  }
  prepared_ = true;
}

void Executor::lay_out(const graph::BatchLayout& layout) {
  layout_ = layout;
  const auto sizes = tensor_bytes(layout_);
  slots_.clear();
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    const graph::TensorInfo& info = graph_.tensors[i];
    slots_.push_back({{arena_.handle(), offsets_[i], sizes[i]}, info.rows, info.per_row, info.width});
  }
  lay_out_tables();
}

void Executor::lay_out_tables() {
  const std::size_t alignment = context_->capabilities().alignment;
  std::size_t at = 0;
  const auto place = [&](std::size_t bytes, std::size_t most) {
    const Range range{table_buffer_.handle(), at, bytes};
    at += aligned(most, alignment);
    return range;
  };
  for (const Rows rows : table_rows) {
    RowTable table;
    const std::uint32_t segments = layout_.segments(rows);
    std::vector<std::uint32_t> offsets;
    for (std::uint32_t s = 0; s <= segments; ++s)
      offsets.push_back(static_cast<std::uint32_t>(layout_.begin(rows, s)));
    for (std::uint32_t s = 0; s < segments; ++s)
      for (std::uint32_t row = offsets[s], i = 0; row < offsets[s + 1]; row += tile_rows, ++i)
        table.host_tiles.push_back({s, row, std::min(row + tile_rows, offsets[s + 1]), i});
    table.tiles = place(16 * table.host_tiles.size(), 16 * largest_tile_count(largest_, rows));
    table.offsets = place(4 * offsets.size(), 4 * (largest_.segments(rows) + 1));
    if (!table.host_tiles.empty())  // not every batch has rows of every kind
      std::memcpy(staging_.data() + table.tiles.offset, table.host_tiles.data(), table.tiles.size);
    std::memcpy(staging_.data() + table.offsets.offset, offsets.data(), table.offsets.size);
    (rows == Rows::point ? tables_.point
     : rows == Rows::key ? tables_.key
                         : tables_.pair_key) = std::move(table);
  }
}

void Executor::add_tables(Schedule& schedule) const {
  schedule.begin_node(-1);
  schedule.copy({staging_.handle(), 0, table_bytes_}, {table_buffer_.handle(), 0, table_bytes_});
}

void Executor::add_nodes(Schedule& schedule) const {
  std::vector<Slot> in, out;
  const auto range = [&](TensorId id) { return id == graph::no_tensor ? Range{} : slots_[id].range; };
  for (std::size_t n = 0; n < kernels_.size(); ++n) {
    const graph::Node& node = graph_.nodes[n];
    const NodeMemory& memory = memory_[n];
    in.clear();
    out.clear();
    for (std::size_t i = 0; i < memory.inputs; ++i) in.push_back(slots_[node.inputs[i]]);
    for (std::size_t i = 0; i < memory.outputs; ++i) out.push_back(slots_[node.outputs[i]]);
    schedule.begin_node(static_cast<int>(n));
    kernels_[n]->record({schedule, layout_, tables_, constants_[n], range(memory.scratch),
                         range(memory.saved), range(memory.lists), memory.makes_lists, in, out});
  }
  schedule.begin_node(-1);
}

void Executor::make_schedule() {
  schedule_.clear();
  add_tables(schedule_);
  for (std::size_t i = 0; i < inputs_.size(); ++i)
    schedule_.copy({staging_.handle(), input_offset_[i], slots_[inputs_[i]].range.size},
                   slots_[inputs_[i]].range);
  add_nodes(schedule_);
  std::size_t at = 0;
  for (TensorId id : outputs_) {
    const Range& range = slots_[id].range;
    schedule_.copy(range, {readback_.handle(), at, range.size});
    at += aligned(range.size, context_->capabilities().alignment);
  }
  if (options_.shuffle) schedule_.shuffle(*options_.shuffle);
}

void Executor::record(VkCommandBuffer commands, const graph::BatchLayout& layout, const HostBuffers& host) {
  check_capacity(layout);
  if (inputs_.size() != 1)
    throw Failure(ErrorCode::unsupported,
                  "the model reads normals or colours; recording passes positions only");
  prepared_ = prepared_ && layout == layout_;
  if (!prepared_) lay_out(layout);
  host_schedule_.clear();
  add_tables(host_schedule_);
  import_positions(*context_, host_schedule_, layout_, host, tables_.point.offsets,
                   slots_[graph_.input(graph::Input::positions)].range, centroids_);
  add_nodes(host_schedule_);
  export_poses(*context_, host_schedule_, layout_, host, slots_[graph_.output(graph::Output::pose)].range,
               centroids_);
  host_recorder_.bind(host_schedule_);
  host_recorder_.restart();
  host_recorder_.barrier(commands);  // the command buffer may run again and again
  host_recorder_.record(commands, host_schedule_, 0, host_schedule_.dispatches().size(), {});
}

void Executor::record_all() {
  submissions_.clear();
  const auto& dispatches = schedule_.dispatches();
  std::size_t begin = 0;
  double cost = 0;
  for (std::size_t w = 0; w < dispatches.size(); ++w) {
    if (w > begin && cost + dispatches[w].cost > options_.submission_cost) {
      submissions_.push_back({VK_NULL_HANDLE, begin, w});
      begin = w;
      cost = 0;
    }
    cost += dispatches[w].cost;
  }
  submissions_.push_back({VK_NULL_HANDLE, begin, dispatches.size()});
  const auto& buffers = commands_.buffers(submissions_.size());
  recorder_.bind(schedule_);
  recorder_.restart();
  for (std::size_t i = 0; i < submissions_.size(); ++i) {
    Submission& submission = submissions_[i];
    submission.commands = buffers[i];
    commands_.begin(submission.commands);
    if (i == 0) timestamps_.reset(submission.commands);
    recorder_.record(submission.commands, schedule_, submission.begin, submission.end,
                     {options_.barriers, options_.shuffle ? VK_NULL_HANDLE : timestamps_.pool()});
    if (i + 1 == submissions_.size()) recorder_.show_host(submission.commands);
    commands_.end(submission.commands);
  }
  counters_ = recorder_.counters();
  counters_.submissions = submissions_.size();
}

graph::TensorView Executor::view(TensorId id, std::byte* data) const {
  using Number = graph::TensorView::Number;
  const graph::TensorInfo& info = graph_.tensors[id];
  const bool index = info.kind == graph::ElementKind::index;
  const auto width = static_cast<std::size_t>(info.width);
  return {data, index ? Number::u32 : Number::f32,
          layout_.rows(info.rows) * static_cast<std::size_t>(info.per_row), width,
          index ? width : padded(info.width)};
}

graph::TensorView Executor::input(TensorId id) const {
  const auto at = std::find(inputs_.begin(), inputs_.end(), id) - inputs_.begin();
  return view(id, staging_.data() + input_offset_.at(static_cast<std::size_t>(at)));
}

graph::TensorView Executor::output(TensorId id) const {
  const Range& range = slots_[id].range;
  if (const auto out = std::find(outputs_.begin(), outputs_.end(), id); out != outputs_.end()) {
    std::size_t at = 0;
    for (auto other = outputs_.begin(); other != out; ++other)
      at += aligned(slots_[*other].range.size, context_->capabilities().alignment);
    return view(id, readback_.data() + at);
  }
  fetched_ = Buffer(*context_, range.size, true);
  commands_.copy(range, {fetched_.handle(), 0, range.size});
  return view(id, fetched_.data());
}

void Executor::run() {
  const char* last = "none";
  try {
    for (const Submission& submission : submissions_) {
      for (std::size_t w = submission.begin; w < submission.end; ++w)
        if (schedule_.dispatches()[w].pipeline) last = schedule_.dispatches()[w].name();
      commands_.submit(submission.commands);
    }
    commands_.wait();
  } catch (const Failure& failure) {
    throw Failure(failure.error().code, failure.error().message + "; last dispatched kernel: " + last);
  }
  // Shuffled work has no order of nodes to measure.
  if (!options_.shuffle) timestamps_.read(milliseconds_, starts_);
}

bool Executor::guards_hold() const {
  const Buffer host(*context_, arena_.size(), true);
  commands_.copy({arena_.handle(), 0, arena_.size()}, {host.handle(), 0, arena_.size()});
  std::vector<bool> owned(arena_.size(), false);
  for (const Slot& slot : slots_)
    std::fill_n(owned.begin() + static_cast<std::ptrdiff_t>(slot.range.offset), slot.range.size, true);
  for (std::size_t i = 0; i < owned.size(); ++i)
    if (!owned[i] && host.data()[i] != std::byte{0xa5}) return false;
  return true;
}

}  // namespace bitr::vk
