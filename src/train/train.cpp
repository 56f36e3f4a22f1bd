#include <bitr/io.hpp>
#include <bitr/train.hpp>

#include "core/guarded.hpp"
#include "train/checkpoint.hpp"
#include "train/run.hpp"

namespace bitr {
namespace {

std::filesystem::path with(const std::filesystem::path& model, const char* ending) {
  return model.parent_path() / (model.stem().string() + ending);
}

}  // namespace

std::filesystem::path TrainFiles::last() const { return with(model, ".last.safetensors"); }
std::filesystem::path TrainFiles::checkpoint() const { return with(model, ".checkpoint"); }
std::filesystem::path TrainFiles::metrics() const { return with(model, ".metrics.jsonl"); }
std::filesystem::path TrainFiles::curves() const { return with(model, ".curves.svg"); }

namespace {

ops::LossKind kind_of(TrainLoss loss) {
  switch (loss) {
    case TrainLoss::official:
      return ops::LossKind::official;
    case TrainLoss::robust:
      return ops::LossKind::robust;
    case TrainLoss::direct:
      break;
  }
  return ops::LossKind::direct;
}

}  // namespace

Result<TrainOptions> checkpoint_options(const std::filesystem::path& checkpoint) {
  return guarded([&]() -> Result<TrainOptions> {
    const auto bytes = io::read_file(checkpoint);
    if (!bytes) return tl::unexpected(bytes.error());
    auto read = train::parse_checkpoint(*bytes, checkpoint.string());
    if (!read) return tl::unexpected(read.error());
    return std::move(read->options);
  });
}

Result<TrainSummary> train_model(const Device& device, const TrainOptions& options, const TrainFiles& files,
                                 bool resume, const TrainCallbacks& callbacks) {
  return guarded([&]() -> Result<TrainSummary> {
    const auto make = [&](const model::Weights& weights) {
      // The official norms' eps does not fold.
      return train::make_differentiator(
          device, weights, {.loss = kind_of(options.loss), .as_defined = weights.mode == Mode::reference});
    };
    return train::run(device, options, files, resume, callbacks, make);
  });
}

}  // namespace bitr
