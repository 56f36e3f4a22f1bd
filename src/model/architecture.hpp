// The layers of the network for a configuration: fibers, sizes and the official names of their parameters
// (model of the paper's §4–5; names are the official state dict's).
#pragma once

#include <bitr/model.hpp>
#include <string>
#include <vector>

#include "irreps/fiber.hpp"
#include "ops/input_features.hpp"
#include "ops/radial.hpp"

namespace bitr::model {

/// One attention layer.
struct LayerSpec {
  std::string prefix;  ///< official module name, e.g. "feature_extract.Gblock.0."
  std::string stage;   ///< name of its stage, e.g. "fe.g0"
  std::string output;  ///< name of the tensor it makes, e.g. "fe.g0" or "key.logit"
  irreps::Fiber in, out;
  int div = 1;
  int heads = 1;
  int sides = 1;
  int scale_degree = 0;
  bool zero_centre = false;

  irreps::Fiber value_fiber() const;  ///< channels of `out` divided by div
  irreps::Fiber key_fiber() const;    ///< the same, degrees of `in` only
};

/// A projected ReLU behind a hidden layer.
struct ReluSpec {
  std::string prefix;
  std::string stage;
  irreps::Fiber fiber;

  irreps::Fiber turned() const;  ///< the degrees other than (0, 0), which have planes
};

struct Architecture {
  ops::InputFeatures input;
  std::vector<LayerSpec> extractor;  ///< hidden layers and the last one
  std::vector<ReluSpec> extractor_relu;
  LayerSpec pool, regress, extract;
  std::vector<LayerSpec> pair_network;
  std::vector<ReluSpec> pair_relu;
  irreps::Fiber head;
};

Architecture architecture(const ModelConfig& config);

/// A radial network's place in a convolution: the pair of degrees, its channels and how it is tied; `owner`
/// is the official name of the pair that has the parameters, e.g. "((0, 1),(0, 0))".
struct RadialSpec {
  ops::RadialBlock block;  ///< without its network
  std::string owner;
};

/// Every (degree in, degree out), both sorted, in slow.
std::vector<RadialSpec> radial_specs(const irreps::Fiber& in, const irreps::Fiber& out, int sides);

/// The degree whose matrix serves `degree` in a fiber where (p, q) and (q, p) share one.
irreps::Degree matrix_owner(const irreps::Fiber& fiber, irreps::Degree degree);

}  // namespace bitr::model
