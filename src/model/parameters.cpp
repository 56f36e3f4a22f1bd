#include "model/parameters.hpp"

#include <cmath>

namespace bitr::model {
namespace {

using irreps::Degree;
using irreps::Fiber;
using Size = std::size_t;

class ParameterCollector {
 public:
  StateDict dict;

  void add(std::string name, std::vector<Size> shape, Initialisation init, double scale = 1) {
    dict.parameters.push_back({std::move(name), std::move(shape), init, scale});
  }

  void radial_network(const std::string& prefix, int inputs, int outputs, bool bias) {
    constexpr Size width = ops::radial_width;
    const Size n = static_cast<Size>(outputs);
    const auto norm = [&](const char* layer) {
      add(prefix + layer + ".normalization.weight", {width}, Initialisation::one);
      add(prefix + layer + ".normalization.bias", {width}, Initialisation::zero);
    };
    add(prefix + "net.0.weight", {width, static_cast<Size>(inputs)}, Initialisation::kaiming_uniform, inputs);
    norm("net.1");
    add(prefix + "net.3.weight", {width, width}, Initialisation::kaiming_uniform, width);
    if (bias) add(prefix + "net.3.bias", {width}, Initialisation::bias_uniform, width);
    norm("net.4");
    add(prefix + "net.6.weight", {n, width}, Initialisation::kaiming_uniform, width);
    if (bias) add(prefix + "net.6.bias", {n}, Initialisation::bias_uniform, width);
  }

  void convolution(const std::string& prefix, const Fiber& in, const Fiber& out, int sides,
                   int scale_degree) {
    for (const RadialSpec& spec : radial_specs(in, out, sides)) {
      const std::string owner = prefix + "rp." + spec.owner + ".";
      const ops::RadialBlock& block = spec.block;
      const Size first = dict.parameters.size();
      if (block.tying != ops::Tying::mirrored) {
        radial_network(owner, sides, block.out_channels * block.in_channels * block.freq(),
                       scale_degree == 0);
        for (Size i = first; i < dict.parameters.size(); ++i)
          leaves_[owner].push_back(dict.parameters[i].name);
      }
      const std::string alias = prefix + "kernel_unary.(" + block.in.str() + "," + block.out.str() + ").rp.";
      for (const std::string& name : leaves_[owner]) dict.aliases[alias + name.substr(owner.size())] = name;
    }
  }

  // One matrix per degree of `out` that `in` has; (p, q) and (q, p) share it.
  void matrices(const std::string& prefix, const Fiber& in, const Fiber& out,
                bool per_output_channels = false) {
    const Fiber both = irreps::restrict_to(out, in);
    for (const auto& [d, rows] : both) {
      const Degree owner = matrix_owner(both, d);
      const int cols = in.channels(d);
      if (owner == d)
        add(prefix + d.str(), {static_cast<Size>(rows), static_cast<Size>(cols)}, Initialisation::normal,
            per_output_channels ? 1.0 / rows : 1 / std::sqrt(cols));
      else
        dict.aliases[prefix + d.str()] = prefix + owner.str();
    }
  }

  void layer(const LayerSpec& spec) {
    const std::string attention = spec.prefix + "GMAB.";
    const Fiber values = spec.value_fiber(), keys = spec.key_fiber();
    if (spec.scale_degree == 0) {
      convolution(attention + "vk.", spec.in, irreps::concatenate(values, keys), spec.sides, 0);
    } else {
      convolution(attention + "v.", spec.in, values, spec.sides, 1);
      convolution(attention + "k.", spec.in, keys, spec.sides, 0);
    }
    matrices(attention + "q.transform.", spec.in, keys);
    if (spec.scale_degree == 0)
      matrices(spec.prefix + "project.1.transform.", irreps::concatenate(values, spec.in), spec.out);
    else
      matrices(spec.prefix + "project.0.transform.", values, spec.out);
  }

  void relu(const ReluSpec& spec) {
    const Fiber turned = spec.turned();
    matrices(spec.prefix + "param_dict.plane_", turned, turned, true);
  }

 private:
  std::map<std::string, std::vector<std::string>> leaves_;
};

}  // namespace

StateDict state_dict(const ModelConfig& config) {
  const Architecture net = architecture(config);
  ParameterCollector collect;
  for (Size i = 0; i < net.extractor.size(); ++i) {
    collect.layer(net.extractor[i]);
    if (i < net.extractor_relu.size()) collect.relu(net.extractor_relu[i]);
  }
  collect.layer(net.regress);
  collect.layer(net.extract);
  collect.layer(net.pool);
  for (Size i = 0; i < net.pair_network.size(); ++i) {
    collect.layer(net.pair_network[i]);
    if (i < net.pair_relu.size()) collect.relu(net.pair_relu[i]);
  }

  const std::string head = "predict_head.", norm = head + "weight_logit_layer.0.normalization.";
  const Size scalars = static_cast<Size>(net.head.channels({0, 0}));
  collect.add(norm + "weight", {scalars}, Initialisation::one);
  collect.add(norm + "bias", {scalars}, Initialisation::zero);
  collect.add(norm + "mean_scale", {scalars}, Initialisation::one);
  collect.add(head + "weight_logit_layer.1.weight", {3, scalars}, Initialisation::bias_uniform,
              static_cast<double>(scalars));
  collect.add(head + "weight_logit_layer.1.bias", {3}, Initialisation::bias_uniform,
              static_cast<double>(scalars));
  const int n = config.predict_head;
  collect.matrices(head + "linear_head.transform.", {{{0, 1}, n}, {{1, 0}, n}, {{1, 1}, n}},
                   {{{0, 1}, 1}, {{1, 0}, 1}, {{1, 1}, 1}});
  collect.dict.buffers = {head + "Q", head + "Q_tensor"};
  return std::move(collect.dict);
}

}  // namespace bitr::model
