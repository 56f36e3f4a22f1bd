// A model: the network's configuration and weights, immutable and shared between plans and threads.
#pragma once

#include <bitr/result.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace bitr {

namespace model {
struct Weights;
}

/// Sizes of the network, by the official code's argument names (BITR, NeurIPS 2024). A fiber is a map from a
/// degree of SO(3)×SO(3) to a number of channels.
struct ModelConfig {
  int num_channels = 4;  ///< channels of every degree inside the two-sided (6-D) network
  int predict_head = 2;  ///< channels of degrees (1,0), (0,1), (1,1) that the head reduces; (0,0) has 4×
  int num_layers = 2;    ///< hidden layers of the two-sided network
  int feature_num_layers = 2;  ///< hidden layers of the feature extractor
  int feature_max_deg = 1;  ///< highest degree in the extractor; 1 is the only value the model is defined for
  int feature_num_channels = 4;  ///< channels of every degree in the extractor
  int div = 2;                   ///< values and keys have 1/div of a layer's output channels
  int heads = 2;                 ///< attention heads of the hidden layers ("head" in files)
  int k_neighbor = 24;           ///< neighbours of a point in its cloud
  int re_convert_k = 24;         ///< neighbours of a key-point pair in the 6-D graph
  int num_key_points = 32;       ///< key points per cloud
  int key_mean_num = 24;         ///< points that give a key point its features
  int key_global_merge_coe = 4;  ///< pooled scalars exchanged between the two clouds
  bool return_normals = false;   ///< the model reads unit normals
  bool get_color = false;        ///< the model reads colours instead of the constant 0.5
  // Not in the official code; its models have the values here.
  int neighbor_dilation = 1;  ///< every so many of the nearest k_neighbor · neighbor_dilation points count
  bool relu_square = false;   ///< the projected ReLU divides by |d|² instead of |d|
  bool centroid_offset =
      false;  ///< the model also reads where in its cloud a point is (ops/input_features.hpp)

  bool operator==(const ModelConfig&) const = default;
};

/// `invalid_argument` naming the field, its value and its range.
Result<void> validate(const ModelConfig& config);

/// Which numbers the norms use. `reference`: the official eps (1e-8 in LayerNorm, 1e-6 in the head's
/// GraphNorm). `scale_exact`: eps = 0 in both, so that f(cX, cY) = (R, c t) holds to rounding.
enum class Mode { reference, scale_exact };

/// Points of a cloud.
struct PointRange {
  std::size_t low = 0, high = 0;
};

class Model {
 public:
  const ModelConfig& config() const;
  Mode mode() const;                ///< the mode its file asks for; a plan may override it
  const std::string& name() const;  ///< file stem, or "untrained(seed)"
  bool trained() const;             ///< false for untrained_model() and what was saved from one
  /// How many points the clouds had that it was trained on: neighbours are counted, so that clouds much
  /// denser or sparser than those look different to it. Empty where its file does not say.
  std::optional<PointRange> trained_points() const;
  std::size_t parameter_count() const;  ///< trainable numbers, tied ones counted once
  std::size_t tensor_count() const;     ///< trainable tensors, tied ones counted once

 private:
  friend struct Internal;
  explicit Model(std::shared_ptr<const model::Weights> weights) : weights_(std::move(weights)) {}
  std::shared_ptr<const model::Weights> weights_;
};

struct ModelOptions {
  std::string name =
      "model";  ///< for bytes in memory: reported by name() and in errors; a file has its path and stem
  std::optional<Mode> mode;  ///< overrides the file's
};

/// Reads weights in safetensors form. Tensor names are the official state dict's; aliases may be present but
/// must agree. The configuration comes from the metadata key "bitr.config" (JSON, official argument names);
/// without it, from the shapes, and the mode is `reference`. `bad_file` names a missing, extra, misshapen or
/// non-finite tensor.
Result<Model> load_model(std::span<const std::byte> safetensors, const ModelOptions& options = {});
/// The same from a file; `io` when it cannot be read.
Result<Model> load_model(const std::filesystem::path& path, const ModelOptions& options = {});

/// Reads a PyTorch checkpoint (`torch.save`, zip format): a state dict, or a dict that holds one as
/// "model_state_dict" or "state_dict". Nothing but tensors and plain containers is ever built from it.
Result<Model> load_torch_checkpoint(const std::filesystem::path& path, const ModelOptions& options = {});

/// The official initialisation (Kaiming-uniform radial networks, randn/√fan-in linear maps) from a seed. By
/// f(X,gX)∘f(X,X) = g it assembles complete copies without any training ("U-BITR" in the paper).
Result<Model> untrained_model(const ModelConfig& config = {}, std::uint64_t seed = 0,
                              Mode mode = Mode::scale_exact);

/// A model that the library carries. models/NAME.md tells what it was trained on and how it does.
struct ShippedModel {
  std::string_view name;
  std::string_view summary;  ///< one line
};

/// Every one; the first is what to use for want of anything more specific.
std::span<const ShippedModel> shipped_models();
/// `invalid_argument` when there is none of that name.
Result<Model> shipped_model(std::string_view name);

/// What a person wrote where a model is asked for: a path (with a folder or an extension, or of a file that
/// is there) or the name of a model that ships. Errors as of load_model and shipped_model.
Result<Model> find_model(const std::string& text);

/// How a file holds weights.
enum class WeightPrecision {
  f32,
  f16,  ///< half the size; to 11 bits, and infinite from 65520 on, which load_model() refuses
};

/// Safetensors bytes with canonical names, "bitr.config" and "bitr.mode" in the metadata.
std::vector<std::byte> serialize(const Model& model, WeightPrecision precision = WeightPrecision::f32);

}  // namespace bitr
