// What a plan asks of the device, as data: dispatches and copies with the memory each reads and writes. From
// that alone follow the barriers, the split into submissions, and which other orders are legal.
#pragma once

#include <array>
#include <cstring>
#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "graph/counters.hpp"
#include "vk/device.hpp"

namespace bitr::vk {

/// Part of a buffer.
struct Range {
  VkBuffer buffer = VK_NULL_HANDLE;
  VkDeviceSize offset = 0;
  VkDeviceSize size = 0;

  bool overlaps(const Range& other) const {
    return buffer == other.buffer && offset < other.offset + other.size && other.offset < offset + size;
  }
  Range sub(VkDeviceSize begin, VkDeviceSize bytes) const { return {buffer, offset + begin, bytes}; }
  bool operator==(const Range&) const = default;
};

struct Dispatch {
  const Pipeline* pipeline = nullptr;  ///< null: a copy from `ranges[0]` to `ranges[1]`
  std::vector<Range> ranges;           ///< in the order of the shader's bindings
  std::array<std::byte, 128> push{};
  std::array<std::uint32_t, 3> groups = {1, 1, 1};
  double cost = 0;  ///< floating-point operations, roughly
  int node = -1;    ///< index in the graph; −1: input and output

  bool writes(std::size_t i) const;
  const char* name() const { return pipeline ? pipeline->shader->name : "copy"; }
  bool operator==(const Dispatch&) const = default;
};

enum class Barriers {
  needed,         ///< before work whose memory meets what was touched since the last one
  after_all_work  ///< everywhere: the truth that `needed` is tested against
};

using graph::Counters;

class Schedule {
 public:
  /// `groups`: work groups that a dispatch may have along an axis.
  explicit Schedule(std::uint32_t groups = 65535) : most_groups_(groups) {}

  template <class Parameters>
  void dispatch(PipelineOf<Parameters> pipeline, std::vector<Range> ranges,
                const std::type_identity_t<Parameters>& parameters, std::array<std::uint32_t, 3> groups,
                double cost) {
    Dispatch work{&*pipeline, std::move(ranges), {}, groups, cost, node_};
    std::memcpy(work.push.data(), &parameters, push_bytes_of<Parameters>);
    add(std::move(work));
  }
  /// Dispatches a shader without parameters.
  void dispatch(PipelineOf<NoParameters> pipeline, std::vector<Range> ranges,
                std::array<std::uint32_t, 3> groups, double cost) {
    dispatch(pipeline, std::move(ranges), NoParameters{}, groups, cost);
  }
  void copy(const Range& from, const Range& to);

  /// Dispatch added from here on belongs to this node.
  void begin_node(int node) { node_ = node; }
  const std::vector<Dispatch>& dispatches() const { return dispatches_; }
  std::vector<Dispatch>& dispatches() { return dispatches_; }
  void clear() { dispatches_.clear(); }
  /// A random order in which everything still meets the data it met in the given one.
  void shuffle(std::uint64_t seed);

 private:
  void add(Dispatch work);
  std::vector<Dispatch> dispatches_;
  int node_ = -1;
  std::uint32_t most_groups_;
};

/// Records schedules into command buffers; owns the descriptor sets.
class Recorder {
 public:
  explicit Recorder(const Context& context) : context_(context) {}
  ~Recorder();
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  struct Options {
    Barriers barriers = Barriers::needed;
    VkQueryPool timestamps = VK_NULL_HANDLE;  ///< two a node, plus two
  };

  /// Descriptor sets for the whole schedule, replacing those of an earlier one.
  void bind(const Schedule& schedule);
  /// Records dispatches [begin, end) of the schedule last bound. Hazards carry over from one range to the next.
  void record(VkCommandBuffer commands, const Schedule& schedule, std::size_t begin, std::size_t end,
              const Options& options);
  /// Everything recorded before it happens before everything after it.
  void barrier(VkCommandBuffer commands);
  /// What copies wrote is then there for the host that waits.
  void show_host(VkCommandBuffer commands) const;
  /// Forgets pending hazards: before the first range.
  void restart() { pending_.clear(), counters_ = {}; }
  const Counters& counters() const { return counters_; }

 private:
  struct Touched {
    Range range;
    bool written;
  };
  bool conflicts(const Dispatch& work) const;
  VkBufferView view(const Range& range);
  void destroy_views();

  const Context& context_;
  VkDescriptorPool pool_ = VK_NULL_HANDLE;
  std::uint32_t pool_sets_ = 0, pool_storage_ = 0, pool_uniform_ = 0, pool_texels_ = 0;
  std::vector<VkDescriptorSet> sets_;  // per work; null for copies
  std::map<std::tuple<VkBuffer, VkDeviceSize, VkDeviceSize>, VkBufferView> views_;  // texel buffers'
  std::vector<Touched> pending_;                                                    // since the last barrier
  Counters counters_;
};

}  // namespace bitr::vk
