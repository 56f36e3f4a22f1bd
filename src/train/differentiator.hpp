// The loss of a batch of pairs with known poses, and its gradient for every parameter of the model.
#pragma once

#include <bitr/assemble.hpp>
#include <bitr/generate.hpp>

#include "model/weights.hpp"
#include "ops/loss.hpp"

namespace bitr::train {

/// Two clouds and the motion that joins them: x_reference = R x_source + t. Where the object has a symmetry,
/// the loss compares with the one of its true poses that is nearest (ops/loss.hpp).
struct TrainingPair {
  CloudView source, reference;
  Pose T_reference_source;
  Pose T_source_object = {};  ///< from the frame of the object, in which its symmetry is given
  Symmetry symmetry = {};
};

/// Means over the pairs of a batch (ops/loss.hpp).
struct LossTerms {
  double rotation = 0, translation = 0, spread = 0;
  double total() const { return rotation + translation + spread; }
};

/// By canonical official name, of the parameters' shapes.
using Gradients = std::map<std::string, Eigen::MatrixXd>;

struct DifferentiatorOptions {
  ops::LossKind loss = ops::LossKind::direct;
  Precision precision = Precision::f32;  ///< f64 on the CPU only
  bool as_defined = false;               ///< nothing folded: slow, the truth; on the CPU only
};

class Differentiator {
 public:
  virtual ~Differentiator() = default;
  /// The mean loss of the pairs; `gradients` is overwritten. The weights' values may differ from call to
  /// call, their configuration and mode may not. Same weights and pairs, same bits. Numbers that are not
  /// finite come out as such. Throws Failure (`invalid_argument` names a cloud that cannot be used).
  virtual LossTerms evaluate(const model::Weights& weights, std::span<const TrainingPair> pairs,
                             Gradients& gradients) = 0;
};

std::unique_ptr<Differentiator> make_differentiator(const Device& device, const model::Weights& weights,
                                                    const DifferentiatorOptions& options = {});

}  // namespace bitr::train
