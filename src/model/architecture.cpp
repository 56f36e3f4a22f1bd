#include "model/architecture.hpp"

#include <set>

namespace bitr::model {
namespace {

using irreps::Degree;
using irreps::Fiber;

Fiber pair_fiber(int scalars, int others) {
  return {{{0, 0}, scalars}, {{0, 1}, others}, {{1, 0}, others}, {{1, 1}, others}};
}

std::string index_name(const char* module, int i) { return std::string(module) + std::to_string(i); }

}  // namespace

Fiber LayerSpec::value_fiber() const {
  Fiber::Map parts;
  for (const auto& [d, m] : out) parts[d] = m / div;
  return Fiber(std::move(parts));
}

Fiber LayerSpec::key_fiber() const { return irreps::restrict_to(value_fiber(), in); }

Fiber ReluSpec::turned() const {
  Fiber::Map parts;
  for (const auto& [d, m] : fiber)
    if (d != Degree{0, 0}) parts[d] = m;
  return Fiber(std::move(parts));
}

Architecture architecture(const ModelConfig& config) {
  Architecture net;
  net.input = {config.get_color, config.return_normals, config.centroid_offset};

  const int channels = config.feature_num_channels, coe = config.key_global_merge_coe;
  const Fiber feature{{{0, 0}, channels}, {{1, 0}, channels}};
  const auto hidden = [&](const char* module, const char* stage, int i, const Fiber& in, const Fiber& out,
                          int sides) {
    const std::string name = index_name(stage, 2 * i);
    return LayerSpec{.prefix = index_name(module, 2 * i) + ".",
                     .stage = name,
                     .output = name,
                     .in = in,
                     .out = out,
                     .div = config.div,
                     .heads = config.heads,
                     .sides = sides};
  };
  const auto relu = [&](const char* module, const char* stage, int i, const Fiber& fiber) {
    return ReluSpec{index_name(module, 2 * i + 1) + ".", index_name(stage, 2 * i + 1), fiber};
  };

  constexpr const char *fe = "feature_extract.Gblock.", *fe_stage = "fe.g";
  for (int i = 0; i <= config.feature_num_layers; ++i) {
    net.extractor.push_back(hidden(fe, fe_stage, i, i == 0 ? net.input.fiber() : feature, feature, 1));
    if (i < config.feature_num_layers) net.extractor_relu.push_back(relu(fe, fe_stage, i, feature));
  }
  net.extractor.back().div = net.extractor.back().heads = 1;

  const std::string key = "feature_extract.key_layer.";
  // The misspelling is the official parameter's name.
  net.pool = {.prefix = key + "key_feature_gloabal_pool_weight.",
              .stage = "key.key_feature_gloabal_pool_weight",
              .output = "key.pool_out",
              .in = feature,
              .out = {{{0, 0}, 1 + coe}}};
  net.regress = {.prefix = key + "key_regress.",
                 .stage = "key.key_regress",
                 .output = "key.logit",
                 .in = {{{0, 0}, 3 * channels + 2 * coe}, {{1, 0}, 2 * channels}},
                 .out = {{{0, 0}, config.num_key_points}},
                 .div = config.div,
                 .heads = config.heads};
  net.extract = {.prefix = key + "key_extract.",
                 .stage = "key.key_extract",
                 .output = "key.feat",
                 .in = feature,
                 .out = feature,
                 .div = config.div,
                 .heads = config.heads,
                 .zero_centre = true};

  constexpr const char *bi = "Binet.Gblock.", *bi_stage = "bi.g";
  const Fiber mid = pair_fiber(config.num_channels, config.num_channels);
  for (int i = 0; i < config.num_layers; ++i) {
    net.pair_network.push_back(
        hidden(bi, bi_stage, i, i == 0 ? pair_fiber(channels, channels) : mid, mid, 2));
    net.pair_relu.push_back(relu(bi, bi_stage, i, mid));
  }
  net.head = pair_fiber(4 * config.predict_head, config.predict_head);
  LayerSpec last = hidden(bi, bi_stage, config.num_layers,
                          config.num_layers == 0 ? pair_fiber(channels, channels) : mid, net.head, 2);
  last.div = last.heads = last.scale_degree = 1;
  net.pair_network.push_back(last);
  return net;
}

std::vector<RadialSpec> radial_specs(const Fiber& in, const Fiber& out, int sides) {
  std::vector<RadialSpec> specs;
  std::set<std::pair<Degree, Degree>> owned;
  const auto owner_name = [](Degree i, Degree o) { return "(" + i.str() + "," + o.str() + ")"; };
  for (const auto& [i, ci] : in)
    for (const auto& [o, co] : out) {
      RadialSpec spec{{.in = i, .out = o, .in_channels = ci, .out_channels = co, .tying = {}, .network = {}},
                      owner_name(i, o)};
      const bool mirror_owned = sides == 2 && owned.count({i.swapped(), o.swapped()});
      if (sides == 2 && i.symmetric() && o.symmetric()) {
        spec.block.tying = ops::Tying::symmetrised;
        owned.insert({i, o});
      } else if (mirror_owned) {
        spec.block.tying = ops::Tying::mirrored;
        spec.owner = owner_name(i.swapped(), o.swapped());
      } else {
        owned.insert({i, o});
      }
      specs.push_back(std::move(spec));
    }
  return specs;
}

Degree matrix_owner(const Fiber& fiber, Degree degree) {
  return fiber.has(degree.swapped()) && degree.swapped() < degree ? degree.swapped() : degree;
}

}  // namespace bitr::model
