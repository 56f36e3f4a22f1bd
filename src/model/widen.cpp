#include "model/widen.hpp"

#include <numeric>
#include <set>

#include "core/failure.hpp"
#include "model/architecture.hpp"

namespace bitr::model {
namespace {

using Eigen::Index;
using irreps::Degree;
using irreps::Fiber;

/// Where a narrow tensor's channels lie in the wide one.
struct Places {
  std::vector<int> of;  ///< the wide channel of each narrow one
  int wide = 0;         ///< channels of the wide tensor

  /// Behind these, the next ones of a concatenation.
  void append(const Places& next) {
    for (const int place : next.of) of.push_back(wide + place);
    wide += next.wide;
  }
};

Places first_channels(int narrow, int wide) {
  Places places{std::vector<int>(static_cast<std::size_t>(narrow)), wide};
  std::iota(places.of.begin(), places.of.end(), 0);
  return places;
}

using FiberPlaces = std::map<Degree, Places>;

FiberPlaces first_channels(const Fiber& narrow, const Fiber& wide) {
  FiberPlaces places;
  for (const auto& [d, m] : wide) places[d] = first_channels(narrow.channels(d), m);
  return places;
}

/// Heads split channels, so a head's own stay with it.
FiberPlaces head_channels(const Fiber& narrow, const Fiber& wide, int heads) {
  FiberPlaces places;
  for (const auto& [d, m] : wide)
    for (int h = 0; h < heads; ++h) places[d].append(first_channels(narrow.channels(d) / heads, m / heads));
  return places;
}

FiberPlaces concatenate(FiberPlaces a, const FiberPlaces& b) {
  for (const auto& [d, places] : b) a[d].append(places);
  return a;
}

/// What an extended feature is made of (ops/extend_features.hpp).
FiberPlaces extended(const FiberPlaces& feature, int globals) {
  const Places scalars = feature.at({0, 0}), vectors = feature.at({1, 0}),
               both_globals = first_channels(2 * globals, 2 * globals);
  FiberPlaces places = feature;
  for (const Places& next : {both_globals, scalars, scalars}) places[{0, 0}].append(next);
  places[{1, 0}].append(vectors);
  return places;
}

class Widener {
 public:
  Widener(const Weights& narrow, Weights& wide) : narrow_(narrow.parameters), wide_(wide.parameters) {}

  void layer(const LayerSpec& narrow, const LayerSpec& wide, const FiberPlaces& in) {
    const std::string attention = wide.prefix + "GMAB.";
    const FiberPlaces values = head_channels(narrow.value_fiber(), wide.value_fiber(), wide.heads),
                      keys = head_channels(narrow.key_fiber(), wide.key_fiber(), wide.heads),
                      out = first_channels(narrow.out, wide.out);
    if (wide.scale_degree == 0) {
      convolution(attention + "vk.", wide, in, concatenate(values, keys));
    } else {
      convolution(attention + "v.", wide, in, values);
      convolution(attention + "k.", wide, in, keys);
    }
    matrices(attention + "q.transform.", in, keys, true, Unread::zero);
    if (wide.scale_degree == 0)
      matrices(wide.prefix + "project.1.transform.", concatenate(values, in), out, true, Unread::kept);
    else
      matrices(wide.prefix + "project.0.transform.", values, out, false, Unread::kept);
  }

  void relu(const ReluSpec& narrow, const ReluSpec& wide) {
    const FiberPlaces turned = first_channels(narrow.turned(), wide.turned());
    matrices(wide.prefix + "param_dict.plane_", turned, turned, false, Unread::kept);
  }

  void head(const Fiber& narrow, const Fiber& wide) {
    const std::string prefix = "predict_head.", norm = prefix + "weight_logit_layer.0.normalization.",
                      logits = prefix + "weight_logit_layer.1.";
    const Places one = first_channels(1, 1), three = first_channels(3, 3);
    const FiberPlaces places = first_channels(narrow, wide);
    for (const char* name : {"weight", "bias", "mean_scale"}) rows(norm + name, places.at({0, 0}));
    matrix(logits + "weight", places.at({0, 0}), three, false, Unread::kept);
    rows(logits + "bias", three);
    for (const Degree d : {Degree{0, 1}, Degree{1, 1}})
      matrix(prefix + "linear_head.transform." + d.str(), places.at(d), one, false, Unread::kept);
  }

 private:
  /// What becomes of a new row of a matrix: as it is, or made to give nothing.
  enum class Unread { kept, zero };

  /// Rows whose input is the same in both: copied to their places.
  void rows(const std::string& name, const Places& places) {
    const Eigen::MatrixXd& from = narrow_.at(name);
    for (std::size_t r = 0; r < places.of.size(); ++r)
      wide_.at(name).row(places.of[r]) = from.row(static_cast<Index>(r));
  }

  /// A mixing of channels, whose input is added where there are as many channels in as out, if it `may_skip`.
  void matrix(const std::string& name, const Places& in, const Places& out, bool may_skip, Unread unread) {
    Eigen::MatrixXd from = narrow_.at(name);
    Eigen::MatrixXd& to = wide_.at(name);
    if (may_skip && in.of.size() == out.of.size()) from.diagonal().array() += 1;
    const std::set<int> placed(out.of.begin(), out.of.end());
    for (int r = 0; r < out.wide; ++r)
      if (unread == Unread::zero || placed.count(r)) {
        to.row(r).setZero();
        if (may_skip && in.wide == out.wide) to(r, r) = -1;
      }
    for (std::size_t r = 0; r < out.of.size(); ++r)
      for (std::size_t c = 0; c < in.of.size(); ++c)
        to(out.of[r], in.of[c]) += from(static_cast<Index>(r), static_cast<Index>(c));
  }

  void matrices(const std::string& prefix, const FiberPlaces& in, const FiberPlaces& out, bool may_skip,
                Unread unread) {
    for (const auto& [d, places] : out)
      if (in.count(d) && wide_.count(prefix + d.str()))
        matrix(prefix + d.str(), in.at(d), places, may_skip, unread);
  }

  void convolution(const std::string& prefix, const LayerSpec& wide, const FiberPlaces& in,
                   const FiberPlaces& out) {
    Fiber fiber_out;
    for (const auto& [d, places] : out) fiber_out.set(d, places.wide);
    for (const RadialSpec& spec : radial_specs(wide.in, fiber_out, wide.sides)) {
      if (spec.block.tying == ops::Tying::mirrored) continue;
      const std::string owner = prefix + "rp." + spec.owner + ".net.";
      for (auto it = narrow_.lower_bound(owner); it != narrow_.end() && it->first.starts_with(owner); ++it) {
        if (it->first.substr(owner.size()).starts_with("6."))
          last_layer(it->first, in.at(spec.block.in), out.at(spec.block.out), spec.block.freq());
        else
          wide_.at(it->first) = it->second;
      }
    }
  }

  /// Rows (channel out, channel in, frequency): from a new channel to an old one nothing comes.
  void last_layer(const std::string& name, const Places& in, const Places& out, int freq) {
    const Eigen::MatrixXd& from = narrow_.at(name);
    Eigen::MatrixXd& to = wide_.at(name);
    for (std::size_t o = 0; o < out.of.size(); ++o) {
      to.middleRows(out.of[o] * in.wide * freq, in.wide * freq).setZero();
      for (std::size_t i = 0; i < in.of.size(); ++i)
        to.middleRows((out.of[o] * in.wide + in.of[i]) * freq, freq) =
            from.middleRows(static_cast<Index>(o * in.of.size() + i) * freq, freq);
    }
  }

  const std::map<std::string, Eigen::MatrixXd>& narrow_;
  std::map<std::string, Eigen::MatrixXd>& wide_;
};

struct Width {
  const char* name;
  int ModelConfig::*channels;
};

constexpr Width widths[] = {{"num_channels", &ModelConfig::num_channels},
                            {"feature_num_channels", &ModelConfig::feature_num_channels},
                            {"predict_head", &ModelConfig::predict_head}};

}  // namespace

Result<Weights> widen(const Weights& narrow, Weights wide) {
  ModelConfig same = wide.config;
  for (const Width& width : widths) {
    const int now = narrow.config.*width.channels, then = wide.config.*width.channels;
    if (then < now)
      return fail(ErrorCode::invalid_argument, std::string(width.name) + " is " + std::to_string(then) +
                                                   ", must be at least the narrower model's " +
                                                   std::to_string(now));
    same.*width.channels = now;
  }
  if (same != narrow.config)
    return fail(ErrorCode::invalid_argument,
                "the configurations differ in more than num_channels, feature_num_channels and predict_head");

  const Architecture from = architecture(narrow.config), to = architecture(wide.config);
  const FiberPlaces input = first_channels(from.input.fiber(), to.input.fiber()),
                    feature = first_channels(from.pool.in, to.pool.in);
  Widener widener(narrow, wide);
  for (std::size_t i = 0; i < to.extractor.size(); ++i)
    widener.layer(from.extractor[i], to.extractor[i], i == 0 ? input : feature);
  for (std::size_t i = 0; i < to.extractor_relu.size(); ++i)
    widener.relu(from.extractor_relu[i], to.extractor_relu[i]);
  widener.layer(from.pool, to.pool, feature);
  widener.layer(from.regress, to.regress, extended(feature, wide.config.key_global_merge_coe));
  widener.layer(from.extract, to.extract, feature);
  for (std::size_t i = 0; i < to.pair_network.size(); ++i)
    widener.layer(from.pair_network[i], to.pair_network[i],
                  first_channels(from.pair_network[i].in, to.pair_network[i].in));
  for (std::size_t i = 0; i < to.pair_relu.size(); ++i) widener.relu(from.pair_relu[i], to.pair_relu[i]);
  widener.head(from.head, to.head);
  wide.mode = narrow.mode;
  wide.trained = narrow.trained;
  return wide;
}

}  // namespace bitr::model
