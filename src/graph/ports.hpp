// Where a graph meets its caller: tensors that the caller fills, and tensors that it reads.
#pragma once

#include <cstdint>
#include <map>

namespace bitr::graph {

using TensorId = int;
constexpr TensorId no_tensor = -1;

/// Filled by the caller before a run.
enum class Input : std::uint8_t {
  positions,
  normals,
  colors,
  offsets,  ///< from the cloud's centroid, over the root mean square of their lengths
  truth,    ///< a training graph's true poses (ops/loss.hpp)
};

/// Read by the caller after a run.
enum class Output : std::uint8_t {
  key_points,
  pose,
  result,  ///< what a graph that is not the network's computes
  loss,    ///< a training graph's terms of the loss (ops/loss.hpp)
};

/// The tensors of those roles that a graph has; as a range, pairs (role, tensor) in the order of the roles.
template <class Role>
class Ports {
 public:
  /// no_tensor when the graph has none of that role.
  TensorId operator[](Role role) const {
    const auto found = tensors_.find(role);
    return found == tensors_.end() ? no_tensor : found->second;
  }
  bool has(Role role) const { return tensors_.count(role) != 0; }
  bool holds(TensorId id) const {
    for (const auto& [role, tensor] : tensors_)
      if (tensor == id) return true;
    return false;
  }
  /// Returns `id`.
  TensorId set(Role role, TensorId id) { return tensors_[role] = id; }
  /// Gives every tensor the number `to(old number)`.
  template <class To>
  void renumber(To to) {
    for (auto& [role, tensor] : tensors_) tensor = to(tensor);
  }

  auto begin() const { return tensors_.begin(); }
  auto end() const { return tensors_.end(); }

 private:
  std::map<Role, TensorId> tensors_;
};

}  // namespace bitr::graph
