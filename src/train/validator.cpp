#include "train/validator.hpp"

#include <algorithm>
#include <bitr/assemble.hpp>
#include <cstdio>

#include "api/internal.hpp"
#include "api/plan.hpp"
#include "core/failure.hpp"
#include "core/guarded.hpp"
#include "data_sets/part.hpp"
#include "train/trainer.hpp"

namespace bitr::train {
namespace {

std::string name_of(const DataPart& part) {
  std::string text = part.kind.empty() ? part.folder.string() : part.kind;
  if (part.protocol) text += " " + std::string(bitr::name(*part.protocol));
  if (!data::is_cropped(part)) return text;
  char share[64];
  if (part.share_low == part.share_high)
    std::snprintf(share, sizeof share, " s=%.4g", part.share_low);
  else
    std::snprintf(share, sizeof share, " s=%.4g–%.4g", part.share_low, part.share_high);
  return text + share;
}

}  // namespace

Validator::Validator(const Device& device, const TrainOptions& options)
    : device_(device), batch_(std::min<std::size_t>(options.batch, 16)) {
  const std::size_t least = least_points(options.model);
  const auto& parts = options.validation.parts.empty() ? options.data.parts : options.validation.parts;
  for (const DataPart& part : parts) {
    const DataSet data = open_data(options, Split::validation, {part}, options.validation.samples,
                                   options.validation.seed ^ 0x76616c6964617465);
    Group group{name_of(part), {}};
    std::string why;
    for (std::size_t i = 0; i < data.samples(); ++i) {
      auto sample = data.sample(0, i);
      if (sample && std::min(sample->source.size(), sample->reference.size()) >= least)
        group.samples.push_back(std::move(*sample));
      else if (why.empty())
        why = sample ? "clouds of less than " + std::to_string(least) + " points" : sample.error().message;
    }
    if (group.samples.empty())
      throw Failure(ErrorCode::bad_file, "validation: no sample of " + group.name + " can be used: " + why);
    groups_.push_back(std::move(group));
  }
}

ValidationResult Validator::run(const model::Weights& weights, std::size_t step) const {
  BatchShape capacity{batch_, 0};
  std::vector<CloudPair> pairs;
  for (const Group& group : groups_)
    for (const DataSample& sample : group.samples) pairs.push_back({sample.source, sample.reference});
  for (std::size_t i = 0; i < pairs.size(); i += batch_)
    capacity.points = std::max(
        capacity.points, shape_of(std::span(pairs).subspan(i, std::min(batch_, pairs.size() - i))).points);
  constexpr std::string_view context = "validation: ";
  Plan plan = value_or_throw(
      make_plan(device_, Internal::model(std::make_shared<const model::Weights>(weights)), capacity),
      context);
  std::vector<Assembly> assemblies;
  for (std::size_t i = 0; i < pairs.size(); i += batch_)
    for (Assembly& assembly :
         value_or_throw(assemble(plan, std::span(pairs).subspan(i, std::min(batch_, pairs.size() - i)),
                                 {.diagnostics = false}),
                        context))
      assemblies.push_back(std::move(assembly));

  ValidationResult result;
  result.step = step;
  std::size_t at = 0;
  for (const Group& group : groups_) {
    std::vector<PoseErrors> errors;
    for (const DataSample& sample : group.samples)
      errors.push_back(errors_of(assemblies[at++].T_reference_source, sample));
    result.groups.push_back({group.name, summarise(errors)});
    result.score += result.groups.back().errors.rotation.median / static_cast<double>(groups_.size());
  }
  return result;
}

}  // namespace bitr::train
