// Which parameter of the official state dict is which constant of an operation. One statement of it serves
// both ways: values into a graph, and gradients out of one.
#pragma once

#include "model/architecture.hpp"
#include "ops/attention_layer.hpp"
#include "ops/constants.hpp"
#include "ops/head.hpp"
#include "ops/projected_relu.hpp"

namespace bitr::model {

// visit(official name, matrix): a parameter that is tied is visited once for every place it has.

template <class Visit>
void visit_parameters(const std::string& prefix, ops::RadialNetwork& net, Visit visit) {
  visit(prefix + "net.0.weight", net.w1);
  visit(prefix + "net.3.weight", net.w2);
  visit(prefix + "net.6.weight", net.w3);
  if (net.scale_degree == 1) return;
  visit(prefix + "net.1.normalization.weight", net.gain1);
  visit(prefix + "net.1.normalization.bias", net.bias1);
  visit(prefix + "net.3.bias", net.c2);
  visit(prefix + "net.4.normalization.weight", net.gain2);
  visit(prefix + "net.4.normalization.bias", net.bias2);
  visit(prefix + "net.6.bias", net.c3);
}

template <class Visit>
void visit_parameters(const std::string& prefix, ops::Convolve& op, Visit visit) {
  std::map<const ops::RadialNetwork*, std::string> owners;
  const auto specs = radial_specs(op.fiber_in, op.fiber_out, op.sides);
  for (std::size_t i = 0; i < op.blocks.size(); ++i)
    owners.emplace(op.blocks[i].network.get(), prefix + "rp." + specs[i].owner + ".");
  for (ops::RadialNetwork* network : ops::networks_of(op))
    visit_parameters(owners.at(network), *network, visit);
}

template <class Visit>
void visit_parameters(const std::string& prefix, const irreps::Fiber& fiber, ops::DegreeMatrices& matrices,
                      Visit visit) {
  for (const auto& [d, m] : fiber) visit(prefix + matrix_owner(fiber, d).str(), matrices[d]);
}

template <class Visit>
void visit_parameters(const LayerSpec& spec, ops::AttentionLayer& op, Visit visit) {
  const std::string attention = spec.prefix + "GMAB.";
  if (spec.scale_degree == 0) {
    visit_parameters(attention + "vk.", op.values_keys, visit);
  } else {
    visit_parameters(attention + "v.", op.values, visit);
    visit_parameters(attention + "k.", op.keys, visit);
  }
  visit_parameters(attention + "q.transform.", op.key_fiber, op.query.weights, visit);
  visit_parameters(spec.prefix + (spec.scale_degree == 0 ? "project.1.transform." : "project.0.transform."),
                   spec.out, op.project.weights, visit);
}

template <class Visit>
void visit_parameters(const ReluSpec& spec, ops::ProjectedRelu& op, Visit visit) {
  visit_parameters(spec.prefix + "param_dict.plane_", spec.turned(), op.planes, visit);
}

template <class Visit>
void visit_parameters(ops::Head& op, Visit visit) {
  const std::string prefix = "predict_head.", norm = prefix + "weight_logit_layer.0.normalization.";
  visit(norm + "weight", op.norm_weight);
  visit(norm + "bias", op.norm_bias);
  visit(norm + "mean_scale", op.mean_scale);
  visit(prefix + "weight_logit_layer.1.weight", op.logit_weight);
  visit(prefix + "weight_logit_layer.1.bias", op.logit_bias);
  visit(prefix + "linear_head.transform.(0, 1)", op.vector_mix);
  visit(prefix + "linear_head.transform.(1, 1)", op.matrix_mix);
}

}  // namespace bitr::model
